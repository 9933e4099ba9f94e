/* The tree of frames of a bag.
 *
 * Method: of each link parent -> child the first transform is kept, and all of them by time. A
 * mounting is composed along the links from the sensor and from the base up to the first frame
 * above both.
 *
 * Limits: 64 links from a frame to the root. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/logs/scan_log_work.h"

/* The maximum number of links above a frame. */
enum { MAX_DEPTH = 64 };

/* A transform that differs by more than this, in m and as sine of half the angle, has moved. */
static const double MOVED_M = 0.01, MOVED_SINE = 0.005;

char *cairn_scan_log_copy_frame(cairn_ros_text name)
{
    char *copy;

    if (name.length > 0 && name.bytes[0] == '/') {
        name.bytes++;
        name.length--;
    }
    copy = malloc(name.length + 1);
    if (copy != NULL) {
        memcpy(copy, name.bytes, name.length);
        copy[name.length] = 0;
    }
    return copy;
}

/* Returns 1 when a name in a message is that of a frame. */
static int is_frame(cairn_ros_text name, const char *frame)
{
    size_t skip = name.length > 0 && name.bytes[0] == '/';

    return name.length - skip == strlen(frame) &&
           memcmp(name.bytes + skip, frame, name.length - skip) == 0;
}

static cairn_scan_log_link *find_link(const cairn_scan_log_frames *frames,
                                      const cairn_ros_stamped *transform)
{
    for (int32_t i = 0; i < frames->count; i++)
        if (is_frame(transform->child, frames->link[i].child) &&
            is_frame(transform->header.frame, frames->link[i].parent))
            return &frames->link[i];
    return NULL;
}

/* Appends a link. */
static cairn_status new_link(cairn_scan_log_frames *frames, const char *topic,
                             const cairn_ros_stamped *transform)
{
    cairn_scan_log_link *grown;

    if (frames->count == CAIRN_BAG_MAX_TOPICS)
        return CAIRN_FULL;
    if (frames->count == frames->capacity) {
        int32_t capacity = 2 * frames->capacity + 16;

        grown = realloc(frames->link, (size_t)capacity * sizeof *grown);
        if (grown == NULL)
            return CAIRN_NO_MEMORY;
        frames->link = grown;
        frames->capacity = capacity;
    }
    grown = &frames->link[frames->count++];
    memset(grown, 0, sizeof *grown);
    grown->parent = cairn_scan_log_copy_frame(transform->header.frame);
    grown->child = cairn_scan_log_copy_frame(transform->child);
    grown->topic = strdup(topic);
    grown->first = transform->transform;
    return grown->parent != NULL && grown->child != NULL && grown->topic != NULL ? CAIRN_OK
                                                                                 : CAIRN_NO_MEMORY;
}

/* Returns 1 when two transforms differ. */
static int has_moved(const cairn_ros_transform *a, const cairn_ros_transform *b)
{
    double cosine = 0;

    for (int i = 0; i < 3; i++)
        if (fabs(a->translation[i] - b->translation[i]) > MOVED_M)
            return 1;
    for (int i = 0; i < 4; i++)
        cosine += a->rotation[i] * b->rotation[i];
    return 1 - cosine * cosine > MOVED_SINE * MOVED_SINE;
}

cairn_status cairn_scan_log_frames_add(cairn_scan_log_frames *frames, const char *topic,
                                       const cairn_ros_stamped *transform)
{
    cairn_scan_log_link *link = find_link(frames, transform);
    cairn_status status = CAIRN_OK;

    if (link == NULL) {
        status = new_link(frames, topic, transform);
        link = &frames->link[frames->count - 1];
    }
    if (status != CAIRN_OK)
        return status;
    link->moves |= has_moved(&link->first, &transform->transform);
    return cairn_scan_log_track_add(&link->track, transform->header.stamp_ns,
                                    &transform->transform);
}

/* Returns the link above a frame; NULL: none. */
static cairn_scan_log_link *link_above(const cairn_scan_log_frames *frames, const char *child)
{
    for (int32_t i = 0; i < frames->count; i++)
        if (strcmp(frames->link[i].child, child) == 0)
            return &frames->link[i];
    return NULL;
}

cairn_scan_log_link *cairn_scan_log_frames_odometry(const cairn_scan_log_frames *frames,
                                                    const char *sensor)
{
    cairn_scan_log_link *link = link_above(frames, sensor);

    for (int depth = 0; link != NULL && depth < MAX_DEPTH; depth++) {
        const char *name =
            strrchr(link->parent, '/') != NULL ? strrchr(link->parent, '/') + 1 : link->parent;

        if (strncmp(name, "odom", 4) == 0)
            return link;
        link = link_above(frames, link->parent);
    }
    return NULL;
}

/* Rotates a vector by a unit quaternion x, y, z, w. */
static void rotate(const double q[4], const double v[3], double out[3])
{
    /* t = 2 q x v; out = v + w t + q x t */
    double t[3] = {2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]),
                   2 * (q[0] * v[1] - q[1] * v[0])};

    out[0] = v[0] + q[3] * t[0] + q[1] * t[2] - q[2] * t[1];
    out[1] = v[1] + q[3] * t[1] + q[2] * t[0] - q[0] * t[2];
    out[2] = v[2] + q[3] * t[2] + q[0] * t[1] - q[1] * t[0];
}

/* Returns a * b. */
static cairn_ros_transform compose(const cairn_ros_transform *a, const cairn_ros_transform *b)
{
    const double *p = a->rotation, *q = b->rotation;
    cairn_ros_transform c;

    rotate(p, b->translation, c.translation);
    for (int i = 0; i < 3; i++)
        c.translation[i] += a->translation[i];
    c.rotation[0] = p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1];
    c.rotation[1] = p[3] * q[1] - p[0] * q[2] + p[1] * q[3] + p[2] * q[0];
    c.rotation[2] = p[3] * q[2] + p[0] * q[1] - p[1] * q[0] + p[2] * q[3];
    c.rotation[3] = p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2];
    return c;
}

static cairn_ros_transform inverse(const cairn_ros_transform *a)
{
    cairn_ros_transform b = {{0, 0, 0},
                             {-a->rotation[0], -a->rotation[1], -a->rotation[2], a->rotation[3]}};

    rotate(b.rotation, a->translation, b.translation);
    for (int i = 0; i < 3; i++)
        b.translation[i] = -b.translation[i];
    return b;
}

/* Composes the transform `above` -> `frame`; 0 when `above` is not above. *moving is set to a link
 * that moves, if there is one. */
static int climb(const cairn_scan_log_frames *frames, const char *frame, const char *above,
                 cairn_ros_transform *transform, const cairn_scan_log_link **moving)
{
    static const cairn_ros_transform identity = {{0, 0, 0}, {0, 0, 0, 1}};

    *transform = identity;
    for (int depth = 0; depth < MAX_DEPTH; depth++) {
        const cairn_scan_log_link *link;

        if (strcmp(frame, above) == 0)
            return 1;
        link = link_above(frames, frame);
        if (link == NULL)
            return 0;
        *transform = compose(&link->first, transform);
        *moving = link->moves ? link : *moving;
        frame = link->parent;
    }
    return 0;
}

/* Projects a transform to the plane. */
static void project(const cairn_ros_transform *transform, cairn_scan_log_mounting *mounting)
{
    const double *q = transform->rotation;
    double up = 1 - 2 * (q[0] * q[0] + q[1] * q[1]);

    mounting->pose.x = (cairn_real)transform->translation[0];
    mounting->pose.y = (cairn_real)transform->translation[1];
    mounting->pose.theta =
        (cairn_real)atan2(2 * (q[0] * q[1] + q[2] * q[3]), 1 - 2 * (q[1] * q[1] + q[2] * q[2]));
    mounting->upside_down = up < 0;
    mounting->tilt = acos(fmin(fabs(up), 1));
}

int32_t cairn_scan_log_frames_mounting(const cairn_scan_log_frames *frames, const char *base,
                                       const char *sensor, cairn_scan_log_mounting *mounting)
{
    const cairn_scan_log_link *link = link_above(frames, sensor);
    cairn_ros_transform above_sensor, above_base;
    const char *above = base;

    memset(mounting, 0, sizeof *mounting);
    for (int depth = 0; depth < MAX_DEPTH; depth++) {
        mounting->moving = NULL;
        if (climb(frames, sensor, above, &above_sensor, &mounting->moving) &&
            climb(frames, base, above, &above_base, &mounting->moving)) {
            above_base = inverse(&above_base);
            above_sensor = compose(&above_base, &above_sensor);
            project(&above_sensor, mounting);
            mounting->topic = strcmp(base, sensor) != 0 && link != NULL ? link->topic : NULL;
            return 1;
        }
        if (link_above(frames, above) == NULL)
            return 0;
        above = link_above(frames, above)->parent;
    }
    return 0;
}

void cairn_scan_log_frames_free(cairn_scan_log_frames *frames)
{
    for (int32_t i = 0; i < frames->count; i++) {
        free(frames->link[i].parent);
        free(frames->link[i].child);
        free(frames->link[i].topic);
        cairn_scan_log_track_free(&frames->link[i].track);
    }
    free(frames->link);
    memset(frames, 0, sizeof *frames);
}
