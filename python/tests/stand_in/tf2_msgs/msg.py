"""Stand-in of tf2_msgs/TFMessage: a single geometry_msgs/TransformStamped goes over the wire."""

from geometry_msgs.msg import TransformStamped

# rclpy does this for the type of a publisher, which is the class below.
type(TransformStamped).__import_type_support__()
# What comes over the wire is read as a message with this one transform.
TransformStamped.transforms = property(lambda transform: [transform])


class _OneTransform(type(TransformStamped)):
    def __instancecheck__(cls, message):
        return type(message) is TransformStamped


class TFMessage(TransformStamped, metaclass=_OneTransform):
    """The only one of the transforms in its place."""

    def __new__(cls, transforms):
        (transform,) = transforms
        return transform
