/* The player's page from its record.
 *
 * Numbers that come in thousands stand as streams: whole numbers of 7 bits a byte, the lowest
 * first, in base 64; signed n as 2 n, or -2 n - 1 below 0. What moves little from one to the next
 * (poses from frame to frame, points along a scan) stands as differences, of which most take one
 * byte. report_player.html reads them.
 *
 *   points, walls   per scan: count, then x, y (ax, ay, bx, by) each as the difference to the last
 *   x, y poses           per frame: count of scans; then runs of scans to leave as they are and of
 *   scans that move, each with the
 *                   differences of x, y, theta to the frame before, of a new scan to the scan
 *                   before marks           per frame: count of doubtful scans, differences of
 *                   their indices; count of regions, differences of x, y; count of forces,
 *                   differences of x, y, then the angle in 1/128 turns and the size in 1/127 of
 *                   the largest of the frame; count of guesses, differences of ax, ay, bx, by,
 *                   strength in 1/127 parts           per frame: count of scans whose part is
 *                   another one than before (none at first); each: difference of its index, part
 *                   + 1 links           count; each: frame, a, b, accepted */
#include "src/core/build.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/report_player.h"
#include "src/host/report_text.h"

#define POSE_UNIT  1e-4 /* m */
#define TURN_UNIT  1e-5 /* rad */
#define POINT_UNIT 2e-3 /* m */
#define MARK_UNIT  5e-3 /* m */
#define TURN_PARTS 128
#define SIZE_PARTS 127

/* ---- streams ---- */

typedef struct stream {
    uint8_t *bytes;
    size_t count, room;
    int failed;
} stream;

static void put(stream *s, uint64_t whole)
{
    if (s->failed)
        return;
    if (s->count + 10 > s->room) {
        size_t room = 2 * s->room + 1024;
        uint8_t *grown = realloc(s->bytes, room);

        if (grown == NULL) {
            s->failed = 1;
            return;
        }
        s->bytes = grown;
        s->room = room;
    }
    for (; whole > 127; whole >>= 7)
        s->bytes[s->count++] = (uint8_t)(whole | 128);
    s->bytes[s->count++] = (uint8_t)whole;
}

static void put_signed(stream *s, int64_t value)
{
    put(s, value >= 0 ? 2 * (uint64_t)value : 2 * (uint64_t)(-(value + 1)) + 1);
}

/* A coordinate in units. */
static int64_t units_of(cairn_real value, double unit)
{
    return (int64_t)rint((double)value / unit);
}

/* The place of the last point, in units. */
typedef struct place {
    int64_t x, y;
} place;

static void put_point(stream *s, place *last, cairn_vec2 p, double unit)
{
    place now;

    now.x = units_of(p.x, unit);
    now.y = units_of(p.y, unit);
    put_signed(s, now.x - last->x);
    put_signed(s, now.y - last->y);
    *last = now;
}

/* Multiples of `every` among first ... first + count - 1. */
static int64_t multiples(int64_t first, int64_t count, int64_t every)
{
    return (first + count + every - 1) / every - (first + every - 1) / every;
}

static stream points_of(const cairn_report_player *player, int64_t every)
{
    stream s = {NULL, 0, 0, 0};
    int64_t at = 0;
    int32_t i, k;

    for (i = 0; i < player->scan_count; i++) {
        const cairn_player_scan *scan = &player->scan[i];
        place last = {0, 0};

        put(&s, (uint64_t)multiples(at, scan->point_count, every));
        for (k = 0; k < scan->point_count; k++, at++)
            if (at % every == 0)
                put_point(&s, &last, scan->point[k], POINT_UNIT);
    }
    return s;
}

static stream walls_of(const cairn_report_player *player, int64_t every)
{
    stream s = {NULL, 0, 0, 0};
    int64_t at = 0;
    int32_t i, k;

    for (i = 0; i < player->scan_count; i++) {
        const cairn_player_scan *scan = &player->scan[i];
        place last = {0, 0};

        put(&s, (uint64_t)multiples(at, scan->segment_count, every));
        for (k = 0; k < scan->segment_count; k++, at++) {
            if (at % every != 0)
                continue;
            put_point(&s, &last, scan->segment[k].a, POINT_UNIT);
            put_point(&s, &last, scan->segment[k].b, POINT_UNIT);
        }
    }
    return s;
}

/* A pose in units. */
typedef struct unit_pose {
    int64_t part[3];
} unit_pose;

static unit_pose pose_in_units(cairn_pose pose)
{
    unit_pose u;

    u.part[0] = units_of(pose.x, POSE_UNIT);
    u.part[1] = units_of(pose.y, POSE_UNIT);
    u.part[2] = units_of(pose.theta, TURN_UNIT);
    return u;
}

/* Scans from i on that have (same 1) or have not (same 0) the poses that the page knows. */
static int32_t run_of(const cairn_player_frame *frame, const unit_pose *known, int32_t known_count,
                      int32_t i, int same)
{
    int32_t first = i;

    for (; i < frame->pose_count; i++) {
        unit_pose now = pose_in_units(frame->pose[i]);

        if ((i < known_count && memcmp(&now, &known[i], sizeof now) == 0) != same)
            break;
    }
    return i - first;
}

static void put_poses(stream *s, const cairn_player_frame *frame, unit_pose *known,
                      int32_t known_count)
{
    int32_t i = 0, left, c;

    put(s, (uint64_t)frame->pose_count);
    while (i < frame->pose_count) {
        left = run_of(frame, known, known_count, i, 1);
        put(s, (uint64_t)left);
        i += left;
        left = run_of(frame, known, known_count, i, 0);
        put(s, (uint64_t)left);
        for (; left > 0; left--, i++) {
            unit_pose now = pose_in_units(frame->pose[i]), base = {{0, 0, 0}};

            if (i < known_count || i > 0)
                base = known[i < known_count ? i : i - 1];
            for (c = 0; c < 3; c++)
                put_signed(s, now.part[c] - base.part[c]);
            known[i] = now;
        }
    }
}

static stream poses_of(const cairn_report_player *player)
{
    stream s = {NULL, 0, 0, 0};
    unit_pose *known = malloc(((size_t)player->scan_count + 1) * sizeof *known);
    int32_t known_count = 0, i;

    s.failed = known == NULL;
    for (i = 0; i < player->frame_count && !s.failed; i++) {
        put_poses(&s, &player->frame[i], known, known_count);
        known_count = player->frame[i].pose_count;
    }
    free(known);
    return s;
}

static void put_doubtful(stream *s, const cairn_player_frame *frame)
{
    int32_t before = 0, i;

    put(s, (uint64_t)frame->doubtful_count);
    for (i = 0; i < frame->doubtful_count; i++) {
        put(s, (uint64_t)(frame->doubtful[i] - before));
        before = frame->doubtful[i];
    }
}

static void put_regions(stream *s, const cairn_player_frame *frame, int64_t every)
{
    place last = {0, 0};
    int32_t i;

    put(s, (uint64_t)multiples(0, frame->region_count, every));
    for (i = 0; i < frame->region_count; i++)
        if (i % every == 0)
            put_point(s, &last, frame->region[i], MARK_UNIT);
}

static double size_of(cairn_vec2 v)
{
    return sqrt((double)v.x * (double)v.x + (double)v.y * (double)v.y);
}

static void put_forces(stream *s, const cairn_player_frame *frame, int64_t every)
{
    double largest = 0;
    place last = {0, 0};
    int32_t i;

    for (i = 0; i < frame->force_count; i++)
        largest = fmax(largest, size_of(frame->force[i].force));
    put(s, (uint64_t)multiples(0, frame->force_count, every));
    for (i = 0; i < frame->force_count; i++) {
        cairn_vec2 force = frame->force[i].force;
        double turns = atan2((double)force.y, (double)force.x) / (2 * (double)CAIRN_PI);

        if (i % every != 0)
            continue;
        put_point(s, &last, frame->force[i].at, MARK_UNIT);
        put(s, (uint64_t)((int32_t)rint((turns + 1) * TURN_PARTS) % TURN_PARTS));
        put(s, (uint64_t)rint(largest > 0 ? size_of(force) / largest * SIZE_PARTS : 0));
    }
}

static void put_guesses(stream *s, const cairn_player_frame *frame, int64_t every)
{
    place last = {0, 0};
    int32_t i;

    put(s, (uint64_t)multiples(0, frame->guess_count, every));
    for (i = 0; i < frame->guess_count; i++) {
        const cairn_report_guess *guess = &frame->guess[i];

        if (i % every != 0)
            continue;
        put_point(s, &last, guess->segment.a, MARK_UNIT);
        put_point(s, &last, guess->segment.b, MARK_UNIT);
        put(s, (uint64_t)rint((double)guess->strength * SIZE_PARTS));
    }
}

/* Every how many-th of what there is in abundance stands on the page. */
typedef struct thinning {
    int64_t points, walls, regions, forces, guesses; /* in all */
    int64_t every_point, every_wall, every_region, every_force, every_guess;
} thinning;

static stream marks_of(const cairn_report_player *player, const thinning *t)
{
    stream s = {NULL, 0, 0, 0};
    int32_t i;

    for (i = 0; i < player->frame_count; i++) {
        put_doubtful(&s, &player->frame[i]);
        put_regions(&s, &player->frame[i], t->every_region);
        put_forces(&s, &player->frame[i], t->every_force);
        put_guesses(&s, &player->frame[i], t->every_guess);
    }
    return s;
}

static int32_t part_of(const cairn_player_frame *frame, int32_t scan)
{
    return frame->part != NULL && scan < frame->pose_count ? frame->part[scan] : -1;
}

static stream parts_of(const cairn_report_player *player)
{
    cairn_player_frame none;
    const cairn_player_frame *before = &none;
    stream s = {NULL, 0, 0, 0};
    int32_t f, i;

    memset(&none, 0, sizeof none);
    for (f = 0; f < player->frame_count; f++) {
        const cairn_player_frame *frame = &player->frame[f];
        int32_t changes = 0, last = 0;

        for (i = 0; i < player->scan_count; i++)
            changes += part_of(frame, i) != part_of(before, i);
        put(&s, (uint64_t)changes);
        for (i = 0; i < player->scan_count && changes > 0; i++) {
            if (part_of(frame, i) == part_of(before, i))
                continue;
            put(&s, (uint64_t)(i - last));
            put(&s, (uint64_t)(part_of(frame, i) + 1));
            last = i;
        }
        before = frame;
    }
    return s;
}

/* The first kept frame that is not before an ordinal. */
static int32_t kept_from(const cairn_report_player *player, int64_t ordinal)
{
    int32_t i = 0;

    while (i < player->frame_count && player->frame[i].ordinal < ordinal)
        i++;
    return i;
}

static stream links_of(const cairn_report_player *player)
{
    stream s = {NULL, 0, 0, 0};
    int32_t i;

    put(&s, (uint64_t)player->link_count);
    for (i = 0; i < player->link_count; i++) {
        put(&s, (uint64_t)kept_from(player, player->link[i].ordinal));
        put(&s, (uint64_t)player->link[i].a);
        put(&s, (uint64_t)player->link[i].b);
        put(&s, (uint64_t)player->link[i].accepted);
    }
    return s;
}

/* ---- thinning ---- */

static int64_t every_of(int64_t count, int64_t most)
{
    return count > most ? (count + most - 1) / most : 1;
}

static thinning thinning_of(const cairn_report_player *player)
{
    thinning t;
    int32_t i;

    memset(&t, 0, sizeof t);
    for (i = 0; i < player->scan_count; i++) {
        t.points += player->scan[i].point_count;
        t.walls += player->scan[i].segment_count;
    }
    for (i = 0; i < player->frame_count; i++) {
        t.regions += player->frame[i].region_count;
        t.forces += player->frame[i].force_count;
        t.guesses += player->frame[i].guess_count;
    }
    t.every_point = every_of(t.points, player->params.points_most);
    t.every_wall = every_of(t.walls, player->params.points_most);
    t.every_region = every_of(t.regions, player->params.forces_most);
    t.every_force = every_of(t.forces, player->params.forces_most);
    t.every_guess = every_of(t.guesses, player->params.forces_most);
    return t;
}

/* ---- the page ---- */

static const char *ordinal_end(int64_t n)
{
    return n % 100 / 10 == 1 ? "th"
           : n % 10 == 1     ? "st"
           : n % 10 == 2     ? "nd"
           : n % 10 == 3     ? "rd"
                             : "th";
}

/* "every 3rd of 1234 points is shown" as one more of the notes. */
static void print_note(cairn_output *output, int *notes, int64_t every, int64_t count,
                       const char *what)
{
    if (every > 1)
        cairn_output_print(output, "%s\"Every %" PRId64 "%s of %" PRId64 " %s is shown.\"",
                           (*notes)++ > 0 ? "," : "", every, ordinal_end(every), count, what);
}

static void print_notes(cairn_output *output, const cairn_report_player *player, const thinning *t)
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
    print_note(output, &notes, t->every_point, t->points, "points");
    print_note(output, &notes, t->every_wall, t->walls, "walls");
    print_note(output, &notes, t->every_force, t->forces, "forces");
    print_note(output, &notes, t->every_region, t->regions, "regions");
    print_note(output, &notes, t->every_guess, t->guesses, "hypotheses' sides");
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

/* Frees the stream; 0 when it is not whole. */
static int print_stream(cairn_output *output, const char *name, stream s)
{
    cairn_output_print(output, ",\n\"%s\":\"", name);
    if (!s.failed)
        cairn_report_print_base64(output, s.bytes, s.count);
    cairn_output_print(output, "\"");
    free(s.bytes);
    return !s.failed;
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

/* 0: no memory. */
static int print_data(cairn_output *output, const cairn_report_player *player)
{
    thinning t = thinning_of(player);
    int32_t i;
    int whole;

    cairn_output_print(output, "{\"title\":");
    cairn_report_print_json(output, player->params.title);
    cairn_output_print(output, ",\n\"subtitle\":");
    cairn_report_print_json(output, player->params.subtitle);
    cairn_output_print(output, ",\n\"step_name\":");
    cairn_report_print_json(output, player->params.step_name);
    cairn_output_print(
        output,
        ",\n\"connect\":%s,\"pose_unit\":%g,\"turn_unit\":%g,\"point_unit\":%g,\"mark_unit\":%g,"
        "\"region_radius\":%.9g,\"scans\":%" PRId32 ",\n\"names\":[",
        player->params.connect ? "true" : "false", POSE_UNIT, TURN_UNIT, POINT_UNIT, MARK_UNIT,
        (double)player->params.region_radius, player->scan_count);
    for (i = 0; i < player->scan_count; i++)
        cairn_output_print(output, "%s%" PRId64, i > 0 ? "," : "", player->scan[i].index);
    cairn_output_print(output, "]");
    print_notes(output, player, &t);
    print_curves(output, player);
    print_frames(output, player);
    whole = print_stream(output, "points", points_of(player, t.every_point));
    whole &= print_stream(output, "walls", walls_of(player, t.every_wall));
    whole &= print_stream(output, "poses", poses_of(player));
    whole &= print_stream(output, "marks", marks_of(player, &t));
    whole &= print_stream(output, "parts", parts_of(player));
    whole &= print_stream(output, "links", links_of(player));
    print_grid(output, player);
    cairn_output_print(output, "}\n");
    return whole;
}

cairn_status cairn_report_player_write(const cairn_report_player *player, const char *path,
                                       cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status;
    int32_t i;
    int whole = 1;

    if (player->frame_count == 0)
        return cairn_file_error_set(error, CAIRN_EMPTY, path, 0,
                                    "no frame to show, expected at least one");
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    for (i = 0; cairn_report_player_page[i] != NULL && whole; i++) {
        const char *line = cairn_report_player_page[i];

        if (strcmp(line, "@title@\n") == 0)
            cairn_report_print_escaped(output, player->params.title);
        else if (strcmp(line, "@data@\n") == 0)
            whole = print_data(output, player);
        else
            cairn_output_bytes(output, line, strlen(line));
    }
    if (!whole) {
        cairn_output_discard(output);
        return cairn_file_error_system(error, path, "write", ENOMEM);
    }
    return cairn_output_commit(output, error);
}
