/* Writing of a player's page: the recorded data as JSON within the page of report_player.html.
 *
 * Format: large arrays are streams of integers in base 64. An integer is a base-128 varint (7 bits
 * a byte, lowest first, as LEB128). A signed n is mapped to 2 n, or to -2 n - 1 below 0 (zigzag).
 * Slowly varying values (poses from frame to frame, points along a scan) are delta coded, so that
 * most take one byte.
 *
 *   points, walls  per scan: count; then x, y (ax, ay, bx, by), each relative to the last x, y
 *   poses          per frame: count of scans; then runs of unchanged and of changed scans; of each
 *                  changed scan: x, y, theta relative to the previous frame, of a new scan relative
 *                  to the scan before it
 *   marks          per frame: count of scans with low confidence, their indices (deltas); count of
 *                  regions, x, y (deltas); count of forces, x, y (deltas), angle in 1/128 turns and
 *                  size in 1/127 of the frame's largest; count of hypotheses, ax, ay, bx, by
 *                  (deltas), strength in 1/127
 *   parts          per frame: count of scans whose submap has changed (none at first); of each: its
 *                  index (delta), submap + 1
 *   links          count; of each: frame, a, b, accepted */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/pictures/report_player.h"
#include "src/host/pictures/report_text.h"

/* Quantization of coordinates and angles. */
#define POSE_UNIT  1e-4 /* m */
#define TURN_UNIT  1e-5 /* rad */
#define POINT_UNIT 2e-3 /* m */
#define MARK_UNIT  5e-3 /* m */
#define TURN_PARTS 128
#define SIZE_PARTS 127

/* ---- Streams ---- */

/* A growing array of bytes on the heap. */
typedef struct byte_stream {
    uint8_t *bytes;
    size_t count, capacity;
    int failed; /* 1: out of memory */
} byte_stream;

/* Appends an unsigned integer as a varint. */
static void put_unsigned(byte_stream *stream, uint64_t whole)
{
    if (stream->failed)
        return;
    if (stream->count + 10 > stream->capacity) {
        size_t capacity = 2 * stream->capacity + 1024;
        uint8_t *grown = realloc(stream->bytes, capacity);

        if (grown == NULL) {
            stream->failed = 1;
            return;
        }
        stream->bytes = grown;
        stream->capacity = capacity;
    }
    for (; whole > 127; whole >>= 7)
        stream->bytes[stream->count++] = (uint8_t)(whole | 128);
    stream->bytes[stream->count++] = (uint8_t)whole;
}

/* Appends a signed integer, zigzag coded. */
static void put_signed(byte_stream *stream, int64_t value)
{
    put_unsigned(stream, value >= 0 ? 2 * (uint64_t)value : 2 * (uint64_t)(-(value + 1)) + 1);
}

/* Quantizes a coordinate to integer units. */
static int64_t quantize(cairn_real value, double unit)
{
    return (int64_t)rint((double)value / unit);
}

/* The last point, in units. */
typedef struct quantized_point {
    int64_t x, y;
} quantized_point;

/* Appends a point relative to the last one. */
static void put_point(byte_stream *stream, quantized_point *last, cairn_vec2 point, double unit)
{
    quantized_point current;

    current.x = quantize(point.x, unit);
    current.y = quantize(point.y, unit);
    put_signed(stream, current.x - last->x);
    put_signed(stream, current.y - last->y);
    *last = current;
}

/* Returns the number of multiples of `stride` among first ... first + count - 1. */
static int64_t multiples(int64_t first, int64_t count, int64_t stride)
{
    return (first + count + stride - 1) / stride - (first + stride - 1) / stride;
}

static byte_stream points_of(const cairn_report_player *player, int64_t stride)
{
    byte_stream stream = {NULL, 0, 0, 0};
    int64_t index = 0;
    int32_t i, k;

    for (i = 0; i < player->scan_count; i++) {
        const cairn_player_scan *scan = &player->scan[i];
        quantized_point last = {0, 0};

        put_unsigned(&stream, (uint64_t)multiples(index, scan->point_count, stride));
        for (k = 0; k < scan->point_count; k++, index++)
            if (index % stride == 0)
                put_point(&stream, &last, scan->point[k], POINT_UNIT);
    }
    return stream;
}

static byte_stream walls_of(const cairn_report_player *player, int64_t stride)
{
    byte_stream stream = {NULL, 0, 0, 0};
    int64_t index = 0;
    int32_t i, k;

    for (i = 0; i < player->scan_count; i++) {
        const cairn_player_scan *scan = &player->scan[i];
        quantized_point last = {0, 0};

        put_unsigned(&stream, (uint64_t)multiples(index, scan->segment_count, stride));
        for (k = 0; k < scan->segment_count; k++, index++) {
            if (index % stride != 0)
                continue;
            put_point(&stream, &last, scan->segment[k].a, POINT_UNIT);
            put_point(&stream, &last, scan->segment[k].b, POINT_UNIT);
        }
    }
    return stream;
}

/* A quantized pose: x, y, theta in units. */
typedef struct quantized_pose {
    int64_t value[3];
} quantized_pose;

/* Quantizes a pose. */
static quantized_pose quantize_pose(cairn_pose pose)
{
    quantized_pose quantized;

    quantized.value[0] = quantize(pose.x, POSE_UNIT);
    quantized.value[1] = quantize(pose.y, POSE_UNIT);
    quantized.value[2] = quantize(pose.theta, TURN_UNIT);
    return quantized;
}

/* Returns the length of the run of scans from i on with unchanged (same 1) or changed (same 0)
 * poses. */
static int32_t run_length(const cairn_player_frame *frame, const quantized_pose *known,
                          int32_t known_count, int32_t i, int same)
{
    int32_t first = i;

    for (; i < frame->pose_count; i++) {
        quantized_pose now = quantize_pose(frame->pose[i]);

        if ((i < known_count && memcmp(&now, &known[i], sizeof now) == 0) != same)
            break;
    }
    return i - first;
}

/* Appends the poses of a frame as runs of unchanged and changed scans, and updates `known`. */
static void put_poses(byte_stream *stream, const cairn_player_frame *frame, quantized_pose *known,
                      int32_t known_count)
{
    int32_t i = 0, run, c;

    put_unsigned(stream, (uint64_t)frame->pose_count);
    while (i < frame->pose_count) {
        run = run_length(frame, known, known_count, i, 1);
        put_unsigned(stream, (uint64_t)run);
        i += run;
        run = run_length(frame, known, known_count, i, 0);
        put_unsigned(stream, (uint64_t)run);
        for (; run > 0; run--, i++) {
            quantized_pose now = quantize_pose(frame->pose[i]), base = {{0, 0, 0}};

            if (i < known_count || i > 0)
                base = known[i < known_count ? i : i - 1];
            for (c = 0; c < 3; c++)
                put_signed(stream, now.value[c] - base.value[c]);
            known[i] = now;
        }
    }
}

static byte_stream poses_of(const cairn_report_player *player)
{
    byte_stream stream = {NULL, 0, 0, 0};
    quantized_pose *known = malloc(((size_t)player->scan_count + 1) * sizeof *known);
    int32_t known_count = 0, i;

    stream.failed = known == NULL;
    for (i = 0; i < player->frame_count && !stream.failed; i++) {
        put_poses(&stream, &player->frame[i], known, known_count);
        known_count = player->frame[i].pose_count;
    }
    free(known);
    return stream;
}

static void put_low_confidence(byte_stream *stream, const cairn_player_frame *frame)
{
    int32_t previous = 0, i;

    put_unsigned(stream, (uint64_t)frame->low_confidence_count);
    for (i = 0; i < frame->low_confidence_count; i++) {
        put_unsigned(stream, (uint64_t)(frame->low_confidence[i] - previous));
        previous = frame->low_confidence[i];
    }
}

static void put_regions(byte_stream *stream, const cairn_player_frame *frame, int64_t stride)
{
    quantized_point last = {0, 0};
    int32_t i;

    put_unsigned(stream, (uint64_t)multiples(0, frame->region_count, stride));
    for (i = 0; i < frame->region_count; i++)
        if (i % stride == 0)
            put_point(stream, &last, frame->region[i], MARK_UNIT);
}

static double size_of(cairn_vec2 vector)
{
    return sqrt((double)vector.x * (double)vector.x + (double)vector.y * (double)vector.y);
}

/* Appends the forces of a frame, angle and size quantized. */
static void put_forces(byte_stream *stream, const cairn_player_frame *frame, int64_t stride)
{
    double largest = 0;
    quantized_point last = {0, 0};
    int32_t i;

    for (i = 0; i < frame->force_count; i++)
        largest = fmax(largest, size_of(frame->force[i].force));
    put_unsigned(stream, (uint64_t)multiples(0, frame->force_count, stride));
    for (i = 0; i < frame->force_count; i++) {
        cairn_vec2 force = frame->force[i].force;
        double turns = atan2((double)force.y, (double)force.x) / (2 * (double)CAIRN_PI);

        if (i % stride != 0)
            continue;
        put_point(stream, &last, frame->force[i].at, MARK_UNIT);
        put_unsigned(stream, (uint64_t)((int32_t)rint((turns + 1) * TURN_PARTS) % TURN_PARTS));
        put_unsigned(stream,
                     (uint64_t)rint(largest > 0 ? size_of(force) / largest * SIZE_PARTS : 0));
    }
}

static void put_hypotheses(byte_stream *stream, const cairn_player_frame *frame, int64_t stride)
{
    quantized_point last = {0, 0};
    int32_t i;

    put_unsigned(stream, (uint64_t)multiples(0, frame->hypothesis_count, stride));
    for (i = 0; i < frame->hypothesis_count; i++) {
        const cairn_report_hypothesis *hypothesis = &frame->hypothesis[i];

        if (i % stride != 0)
            continue;
        put_point(stream, &last, hypothesis->segment.a, MARK_UNIT);
        put_point(stream, &last, hypothesis->segment.b, MARK_UNIT);
        put_unsigned(stream, (uint64_t)rint((double)hypothesis->strength * SIZE_PARTS));
    }
}

/* Subsampling factors of the arrays that are too large: each n-th element is written. */
typedef struct subsampling {
    int64_t points, walls, regions, forces, hypotheses; /* total counts */
    int64_t point_stride, wall_stride, region_stride, force_stride, hypothesis_stride;
} subsampling;

static byte_stream marks_of(const cairn_report_player *player, const subsampling *factors)
{
    byte_stream stream = {NULL, 0, 0, 0};
    int32_t i;

    for (i = 0; i < player->frame_count; i++) {
        put_low_confidence(&stream, &player->frame[i]);
        put_regions(&stream, &player->frame[i], factors->region_stride);
        put_forces(&stream, &player->frame[i], factors->force_stride);
        put_hypotheses(&stream, &player->frame[i], factors->hypothesis_stride);
    }
    return stream;
}

static int32_t submap_of(const cairn_player_frame *frame, int32_t scan)
{
    return frame->submap != NULL && scan < frame->pose_count ? frame->submap[scan] : -1;
}

/* Encodes the changes of the scans' submaps from frame to frame. */
static byte_stream submaps_of(const cairn_report_player *player)
{
    cairn_player_frame none;
    const cairn_player_frame *previous = &none;
    byte_stream stream = {NULL, 0, 0, 0};
    int32_t f, i;

    memset(&none, 0, sizeof none);
    for (f = 0; f < player->frame_count; f++) {
        const cairn_player_frame *frame = &player->frame[f];
        int32_t changes = 0, last = 0;

        for (i = 0; i < player->scan_count; i++)
            changes += submap_of(frame, i) != submap_of(previous, i);
        put_unsigned(&stream, (uint64_t)changes);
        for (i = 0; i < player->scan_count && changes > 0; i++) {
            if (submap_of(frame, i) == submap_of(previous, i))
                continue;
            put_unsigned(&stream, (uint64_t)(i - last));
            put_unsigned(&stream, (uint64_t)(submap_of(frame, i) + 1));
            last = i;
        }
        previous = frame;
    }
    return stream;
}

/* Returns the first kept frame with an ordinal not below the given one. */
static int32_t first_kept_frame(const cairn_report_player *player, int64_t ordinal)
{
    int32_t i = 0;

    while (i < player->frame_count && player->frame[i].ordinal < ordinal)
        i++;
    return i;
}

static byte_stream links_of(const cairn_report_player *player)
{
    byte_stream stream = {NULL, 0, 0, 0};
    int32_t i;

    put_unsigned(&stream, (uint64_t)player->link_count);
    for (i = 0; i < player->link_count; i++) {
        put_unsigned(&stream, (uint64_t)first_kept_frame(player, player->link[i].ordinal));
        put_unsigned(&stream, (uint64_t)player->link[i].a);
        put_unsigned(&stream, (uint64_t)player->link[i].b);
        put_unsigned(&stream, (uint64_t)player->link[i].accepted);
    }
    return stream;
}

/* ---- Subsampling ---- */

static int64_t stride_for(int64_t count, int64_t maximum)
{
    return count > maximum ? (count + maximum - 1) / maximum : 1;
}

/* Computes the subsampling factors from the limits of the player. */
static subsampling find_subsampling(const cairn_report_player *player)
{
    subsampling factors;
    int32_t i;

    memset(&factors, 0, sizeof factors);
    for (i = 0; i < player->scan_count; i++) {
        factors.points += player->scan[i].point_count;
        factors.walls += player->scan[i].segment_count;
    }
    for (i = 0; i < player->frame_count; i++) {
        factors.regions += player->frame[i].region_count;
        factors.forces += player->frame[i].force_count;
        factors.hypotheses += player->frame[i].hypothesis_count;
    }
    factors.point_stride = stride_for(factors.points, player->params.max_points);
    factors.wall_stride = stride_for(factors.walls, player->params.max_points);
    factors.region_stride = stride_for(factors.regions, player->params.max_forces);
    factors.force_stride = stride_for(factors.forces, player->params.max_forces);
    factors.hypothesis_stride = stride_for(factors.hypotheses, player->params.max_forces);
    return factors;
}

/* ---- The page ---- */

static const char *ordinal_end(int64_t n)
{
    return n % 100 / 10 == 1 ? "th"
           : n % 10 == 1     ? "st"
           : n % 10 == 2     ? "nd"
           : n % 10 == 3     ? "rd"
                             : "th";
}

/* Prints a note such as "Every 3rd of 1234 points is shown." */
static void print_note(cairn_output *output, int *notes, int64_t stride, int64_t count,
                       const char *what)
{
    if (stride > 1)
        cairn_output_print(output, "%s\"Every %" PRId64 "%s of %" PRId64 " %s is shown.\"",
                           (*notes)++ > 0 ? "," : "", stride, ordinal_end(stride), count, what);
}

/* Prints the notes about subsampled data. */
static void print_notes(cairn_output *output, const cairn_report_player *player,
                        const subsampling *factors)
{
    int64_t kept = player->frame_count;
    int notes = 0;

    cairn_output_print(output, ",\n\"notes\":[");
    if (kept < player->ordinals)
        cairn_output_print(output,
                           "\"%" PRId64 " of %" PRId64 " frames are shown: every %" PRId64
                           "%s and the last.\"",
                           kept, player->ordinals, player->stride, ordinal_end(player->stride));
    notes = kept < player->ordinals;
    print_note(output, &notes, factors->point_stride, factors->points, "points");
    print_note(output, &notes, factors->wall_stride, factors->walls, "walls");
    print_note(output, &notes, factors->force_stride, factors->forces, "forces");
    print_note(output, &notes, factors->region_stride, factors->regions, "regions");
    print_note(output, &notes, factors->hypothesis_stride, factors->hypotheses,
               "hypotheses' sides");
    cairn_output_print(output, "]");
}

static void print_curves(cairn_output *output, const cairn_report_player *player)
{
    int32_t i;

    cairn_output_print(output, ",\n\"curves\":[");
    for (i = 0; i < player->params.curve_count; i++) {
        cairn_output_print(output, "%s{\"name\":", i > 0 ? "," : "");
        cairn_report_print_json(output, player->curve[i].name);
        cairn_output_print(output, ",\"unit\":");
        cairn_report_print_json(output, player->curve[i].unit);
        cairn_output_print(output, ",\"note\":");
        cairn_report_print_json(output, player->curve[i].note);
        cairn_output_print(output, "}");
    }
    cairn_output_print(output, "]");
}

static void print_frames(cairn_output *output, const cairn_report_player *player)
{
    int32_t i, c;

    cairn_output_print(output, ",\n\"frames\":[");
    for (i = 0; i < player->frame_count; i++) {
        const cairn_player_frame *frame = &player->frame[i];

        cairn_output_print(output, "%s\n{\"step\":%" PRId64 ",\"label\":", i > 0 ? "," : "",
                           frame->step);
        cairn_report_print_json(output, frame->label);
        cairn_output_print(output, ",\"values\":[");
        for (c = 0; c < player->params.curve_count; c++) {
            if (fabs(frame->value[c]) <= (double)CAIRN_REAL_MAX)
                cairn_output_print(output, "%s%.7g", c > 0 ? "," : "", frame->value[c]);
            else
                cairn_output_print(output, "%snull", c > 0 ? "," : "");
        }
        cairn_output_print(output, "]}");
    }
    cairn_output_print(output, "]");
}

/* Prints and frees a stream; 0: it is incomplete. */
static int print_stream(cairn_output *output, const char *name, byte_stream stream)
{
    cairn_output_print(output, ",\n\"%s\":\"", name);
    if (!stream.failed)
        cairn_report_print_base64(output, stream.bytes, stream.count);
    cairn_output_print(output, "\"");
    free(stream.bytes);
    return !stream.failed;
}

static void print_grid(cairn_output *output, const cairn_report_player *player)
{
    const cairn_report_grid *grid = &player->grid;

    if (player->grid_png == NULL) {
        cairn_output_print(output, ",\n\"grid\":null");
        return;
    }
    cairn_output_print(output,
                       ",\n\"grid\":{\"height\":%" PRId32
                       ",\"resolution\":%.9g,\"x\":%.9g,\"y\":%.9g,\"theta\":%.9g,"
                       "\"png\":\"",
                       grid->height, (double)grid->resolution, (double)grid->origin.x,
                       (double)grid->origin.y, (double)grid->origin.theta);
    cairn_report_print_base64(output, player->grid_png, player->grid_bytes);
    cairn_output_print(output, "\"}");
}

/* Prints the data of the page; 0: out of memory. */
static int print_data(cairn_output *output, const cairn_report_player *player)
{
    subsampling factors = find_subsampling(player);
    int32_t i;
    int complete;

    cairn_output_print(output, "{\"title\":");
    cairn_report_print_json(output, player->params.title);
    cairn_output_print(output, ",\n\"subtitle\":");
    cairn_report_print_json(output, player->params.subtitle);
    cairn_output_print(output, ",\n\"step_name\":");
    cairn_report_print_json(output, player->params.step_name);
    if (player->params.image)
        cairn_output_print(output, ",\n\"image\":%d", (int)player->params.image);
    cairn_output_print(
        output,
        ",\n\"connect\":%s,\"pose_unit\":%g,\"turn_unit\":%g,\"point_unit\":%g,\"mark_unit\":%g,"
        "\"region_radius\":%.9g,\"scans\":%" PRId32 ",\n\"names\":[",
        player->params.connect ? "true" : "false", POSE_UNIT, TURN_UNIT, POINT_UNIT, MARK_UNIT,
        (double)player->params.region_radius, player->scan_count);
    for (i = 0; i < player->scan_count; i++)
        cairn_output_print(output, "%s%" PRId64, i > 0 ? "," : "", player->scan[i].index);
    cairn_output_print(output, "]");
    print_notes(output, player, &factors);
    print_curves(output, player);
    print_frames(output, player);
    complete = print_stream(output, "points", points_of(player, factors.point_stride));
    complete &= print_stream(output, "walls", walls_of(player, factors.wall_stride));
    complete &= print_stream(output, "poses", poses_of(player));
    complete &= print_stream(output, "marks", marks_of(player, &factors));
    complete &= print_stream(output, "parts", submaps_of(player));
    complete &= print_stream(output, "links", links_of(player));
    print_grid(output, player);
    cairn_output_print(output, "}\n");
    return complete;
}

cairn_status cairn_report_player_write(const cairn_report_player *player, const char *path,
                                       cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status;
    int32_t i;
    int complete = 1;

    if (player->frame_count == 0)
        return cairn_file_error_set(error, CAIRN_EMPTY, path, 0,
                                    "no frame to show, expected at least one");
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    for (i = 0; cairn_report_player_page[i] != NULL && complete; i++) {
        const char *line = cairn_report_player_page[i];

        if (strcmp(line, "@title@\n") == 0)
            cairn_report_print_escaped(output, player->params.title);
        else if (strcmp(line, "@data@\n") == 0)
            complete = print_data(output, player);
        else
            cairn_output_bytes(output, line, strlen(line));
    }
    if (!complete) {
        cairn_output_discard(output);
        return cairn_file_error_system(error, path, "write", ENOMEM);
    }
    return cairn_output_commit(output, error);
}
