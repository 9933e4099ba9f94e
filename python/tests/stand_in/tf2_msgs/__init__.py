"""Stand-in of the package tf2_msgs, of which there is no wheel."""
