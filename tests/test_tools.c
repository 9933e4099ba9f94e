/* End-to-end tests of the programs: an arena, its log, poses and a map; messages for bad input. */
#include <sys/stat.h>

#include <math.h>
#include <zlib.h>

#include "cairn/carmen_log.h"
#include "cairn/json_text.h"
#include "cairn/map_file.h"
#include "cairn/output.h"
#include "cairn/pose_graph_file.h"
#include "cairn/pose_table.h"
#include "tests/programs.h"

static const char *const arena_files[] = {"scans.log", "truth.csv", "arena.json", "arena.svg"};
static const char *const map_files[] = {"poses.csv", "map.pgm", "map.yaml", "map.svg"};
static const char *const graph_files[] = {"poses.tum", "graph.g2o", "map.pgm", "map.yaml"};

enum { FILES = 4 };

/* ---- Helpers ---- */

static const char *in_folder(const char *folder, const char *name)
{
    char inner[256];

    (void)snprintf(inner, sizeof inner, "%s/%s", folder, name);
    return files_path(inner);
}

static void assert_same_files(const char *first, const char *second, const char *const *names)
{
    for (int i = 0; i < FILES; i++) {
        size_t a = 0, b = 0;
        char *one = files_read(in_folder(first, names[i]), &a),
             *two = files_read(in_folder(second, names[i]), &b);

        assert_non_null(one);
        assert_non_null(two);
        if (a != b || memcmp(one, two, a) != 0)
            fail_msg("%s of %s and of %s differ", names[i], first, second);
        free(one);
        free(two);
    }
}

static int lines_of(const char *text)
{
    int lines = 0;

    for (; *text != '\0'; text++)
        lines += *text == '\n';
    return lines;
}

/* One line that begins with `start` and states what was expected; nothing else, and exit code 2. */
static void assert_refused_from(outcome o, const char *start, const char *piece)
{
    char whole[512];

    (void)snprintf(whole, sizeof whole, "%s%s", start[0] == '/' ? files_folder : "", start);
    if (o.code != 2 || lines_of(o.err) != 1 || strncmp(o.err, whole, strlen(whole)) != 0 ||
        strstr(o.err, piece) == NULL || strstr(o.err, "expected") == NULL)
        fail_msg("exit code %d, \"%s\", where 2 and one line \"%s...%s...\" was expected", o.code,
                 o.err, whole, piece);
    assert_string_equal(o.out, "");
}

/* ---- A log of a square room, made here ---- */

typedef struct text {
    char *bytes;
    size_t count, capacity;
} text;

static void add(text *t, const char *format, ...)
{
    va_list arguments;

    if (t->capacity - t->count < 256) {
        t->capacity = 2 * t->capacity + 4096;
        t->bytes = realloc(t->bytes, t->capacity);
        assert_non_null(t->bytes);
    }
    va_start(arguments, format);
    t->count += (size_t)vsnprintf(t->bytes + t->count, t->capacity - t->count, format, arguments);
    va_end(arguments);
}

/* Distance to the walls of a square room with sides of 2 * half about the origin. */
static double room_range(double half, double x, double y, double angle)
{
    double c = cos(angle), s = sin(angle);
    double to_x = fabs(c) > 1e-9 ? ((c > 0 ? half : -half) - x) / c : 1e9;
    double to_y = fabs(s) > 1e-9 ? ((s > 0 ? half : -half) - y) / s : 1e9;

    return fmin(to_x, to_y);
}

/* A line of `beams` beams around a whole circle from (x, 0); what: the word instead of each range,
 * or NULL. */
static void add_room_scan_elsewhere(text *t, double half, int beams, double x, double odometry_x,
                                    const char *what, int stamp)
{
    double step = 6.283185307179586 / beams;

    add(t, "ROBOTLASER1 0 -3.14159265 6.28318531 %.9g 50 0.01 0 %d", step, beams);
    for (int i = 0; i < beams; i++)
        if (what != NULL)
            add(t, " %s", what);
        else
            add(t, " %.4f", room_range(half, x, 0, -3.14159265 + i * step));
    add(t, " 0 %g 0 0 %g 0 0 0 0 0 0 0 %d h %d\n", odometry_x, odometry_x, stamp, stamp);
}

static void add_room_scan(text *t, double half, int beams, double x, const char *what, int stamp)
{
    add_room_scan_elsewhere(t, half, beams, x, x, what, stamp);
}

static void write_text(const char *name, text *t)
{
    (void)files_write(name, t->bytes, t->count);
    t->count = 0;
}

/* ---- XML, as far as pictures use it ---- */

static int is_name(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == ':' || c == '_';
}

/* The entity of '&', up to its ';'; NULL when it is none. */
static const char *skip_entity(const char *at)
{
    static const char *const known[] = {"&lt;", "&gt;", "&amp;", "&quot;", "&apos;"};

    if (at[1] == '#' && at[2] >= '0' && at[2] <= '9') {
        for (at += 2; *at >= '0' && *at <= '9'; at++) {
        }
        return *at == ';' ? at + 1 : NULL;
    }
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strncmp(at, known[i], strlen(known[i])) == 0)
            return at + strlen(known[i]);
    return NULL;
}

/* Attributes up to '>' or '/'; NULL when they are malformed or one of them is doubled. */
static const char *skip_attributes(const char *at)
{
    const char *names[64];
    size_t lengths[64];
    int count = 0;

    for (;;) {
        const char *name;
        int blank = 0;

        for (; *at == ' ' || *at == '\n'; at++)
            blank = 1;
        if (*at == '>' || *at == '/')
            return at;
        for (name = at; is_name(*at); at++) {
        }
        if (!blank || at == name || count == 64)
            return NULL;
        names[count] = name;
        lengths[count] = (size_t)(at - name);
        for (int i = 0; i < count; i++)
            if (lengths[i] == lengths[count] && strncmp(names[i], name, lengths[i]) == 0)
                return NULL;
        count++;
        if (at[0] != '=' || at[1] != '"')
            return NULL;
        for (at += 2; *at != '"';) {
            if (*at == '\0' || *at == '<')
                return NULL;
            at = *at == '&' ? skip_entity(at) : at + 1;
            if (at == NULL)
                return NULL;
        }
        at++;
    }
}

/* NULL when the text is one well-formed element, else the place of the fault. */
static const char *xml_fault(const char *at)
{
    const char *open[64];
    size_t lengths[64];
    int depth = 0, roots = 0;

    if (strncmp(at, "<?xml", 5) == 0) {
        at = strstr(at, "?>");
        if (at == NULL)
            return "<?xml";
        at += 2;
    }
    while (*at != '\0') {
        const char *start = at;

        if (*at != '<') {
            if ((unsigned char)*at < ' ' && *at != '\n')
                return start;
            if (depth == 0 && *at != '\n' && *at != ' ')
                return start;
            at = *at == '&' ? skip_entity(at) : at + 1;
            if (at == NULL)
                return start;
        } else if (at[1] == '/') {
            if (depth == 0 || strncmp(at + 2, open[depth - 1], lengths[depth - 1]) != 0 ||
                at[2 + lengths[depth - 1]] != '>')
                return start;
            depth--;
            at += 3 + lengths[depth];
        } else {
            const char *name = ++at;

            for (; is_name(*at); at++) {
            }
            if (at == name || depth == 64 || (depth == 0 && roots++ > 0))
                return start;
            open[depth] = name;
            lengths[depth] = (size_t)(at - name);
            at = skip_attributes(at);
            if (at == NULL || (at[0] == '/' && at[1] != '>'))
                return start;
            depth += *at == '>';
            at += *at == '>' ? 1 : 2;
        }
    }
    return depth > 0 || roots != 1 ? at : NULL;
}

static void assert_picture(const char *folder, const char *name)
{
    char *bytes = files_read(in_folder(folder, name), NULL);
    const char *fault;

    assert_non_null(bytes);
    assert_holds(bytes, "<svg xmlns=\"http://www.w3.org/2000/svg\"");
    fault = xml_fault(bytes);
    if (fault != NULL)
        fail_msg("%s/%s is not well formed at byte %d: %.60s", folder, name, (int)(fault - bytes),
                 fault);
    free(bytes);
}

static void the_xml_checker_sees_faults(void **state)
{
    static const char *const bad[] = {"",
                                      "<a>",
                                      "<a></b>",
                                      "<a><b></a></b>",
                                      "<a b></a>",
                                      "<a b=c></a>",
                                      "<a b=\"c></a>",
                                      "<a>&</a>",
                                      "<a>&x;</a>",
                                      "<a>&#12</a>",
                                      "<a>&#;</a>",
                                      "<a/><b/>",
                                      "<a/>x",
                                      "<a b=\"<\"></a>",
                                      "<a>\x01</a>",
                                      "<a b=\"&\"/>",
                                      "<a b=\"1\"",
                                      "<a>1 < 2</a>",
                                      "</a>",
                                      "<a></a",
                                      "<a b=\"1\" b=\"2\"/>",
                                      "<a b=\"1\"c=\"2\"/>"};

    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        if (xml_fault(bad[i]) == NULL)
            fail_msg("'%s' passes", bad[i]);
    assert_null(xml_fault(
        "<?xml version=\"1.0\"?>\n<a x=\"1 &lt; 2\" y:z=\"\">t &amp;&#160; t<b/><c>\n</c></a>\n"));
}

/* ---- Good input ---- */

/* One arena for many tests: a drive in "drive", scans at places from disturbed poses in
 * "places". */
static void make_arenas(void **state)
{
    outcome o = programs_run(
        "cairn-arena rooms --seed 3 --drive 30 --fov 180 --beams 91 --movers 1 -o @/drive");

    (void)state;
    assert_done(o);
    assert_string_equal(o.err, "");
    assert_int_equal(files_count_in("drive"), FILES);
    o = programs_run("cairn-arena apartment --seed 5 --places 4 --headings 3 --beams 121 --disturb "
                     "0.1,5 -o @/places");
    assert_done(o);
    assert_picture("drive", "arena.svg");
    assert_picture("places", "arena.svg");
}

static void same_seed_same_bytes(void **state)
{
    char *one, *two;

    (void)state;
    assert_done(programs_run(
        "cairn-arena rooms --seed 3 --drive 30 --fov 180 --beams 91 --movers 1 -o @/drive-again"));
    assert_same_files("drive", "drive-again", arena_files);
    assert_done(programs_run(
        "cairn-arena rooms --seed 4 --drive 30 --fov 180 --beams 91 --movers 1 -o @/drive-4"));
    one = files_read(in_folder("drive", "truth.csv"), NULL);
    two = files_read(in_folder("drive-4", "truth.csv"), NULL);
    assert_string_not_equal(one, two);
    free(one);
    free(two);

    assert_done(programs_run("cairn map @/drive/scans.log -o @/map --seed 1"));
    assert_done(
        programs_run("cairn map @/drive/scans.log -o @/map-again/new/folder --seed 1 --quiet"));
    assert_same_files("map", "map-again/new/folder", map_files);
    assert_done(programs_run("cairn align @/places/scans.log -o @/align --seed 1 --steps 20"));
    assert_done(programs_run(
        "cairn align @/places/scans.log -o @/align-again --seed 1 --steps=20 --pool 64M"));
    assert_same_files("align", "align-again", map_files);
    assert_int_equal(files_count_in("map"), FILES + 2);
    assert_same_files("map", "map-again/new/folder", graph_files);
    assert_int_equal(files_count_in("align"), FILES);
    /* Over existing files, once more. */
    assert_done(programs_run("cairn map @/drive/scans.log -o @/align-again"));
    assert_same_files("map", "align-again", map_files);
    assert_int_equal(files_count_in("align-again"), FILES + 2);
    assert_int_equal(files_count_in("drive"), FILES);
}

/* Mean distance of poses.csv from the true positions, the first one aligned with its truth when
 * `relative`. */
static double mean_error(const cairn_pose_table_row *row, int32_t count, const char *truth_path,
                         int32_t relative)
{
    cairn_pose_table_row *truth;
    cairn_pose shift = cairn_pose_identity();
    cairn_file_error error;
    int32_t truths;
    double sum = 0;

    assert_ok(cairn_pose_table_read(&truth, &truths, truth_path, &error));
    assert_int_equal(truths, count);
    if (relative)
        shift = cairn_pose_compose(truth[0].pose, cairn_pose_inverse(row[0].pose));
    for (int32_t i = 0; i < count; i++) {
        cairn_pose pose = cairn_pose_compose(shift, row[i].pose);

        sum += hypot((double)(pose.x - truth[i].pose.x), (double)(pose.y - truth[i].pose.y));
    }
    cairn_pose_table_free(truth);
    return sum / count;
}

static void a_pose_for_every_scan(void **state)
{
    static const struct {
        const char *log, *poses, *truth, *verdicts;
        int32_t relative;
        double error;
    } sample[] = {
        {"drive/scans.log", "map/poses.csv", "drive/truth.csv", "first matched predicted blind ", 1,
         0.1},
        {"places/scans.log", "align/poses.csv", "places/truth.csv", "placed uncertain apart blind ",
         0, 0.05},
        {"places/scans.log", "lum/poses.csv", "places/truth.csv", "aligned apart blind ", 1, 0.2},
        {"places/scans.log", "virtual/poses.csv", "places/truth.csv",
         "placed uncertain apart guessed blind ", 0, 0.05},
        {"places/scans.log", "written/poses.csv", "places/truth.csv", "aligned blind ", 1, 0.5},
        {"places/scans.log", "written-lum/poses.csv", "places/truth.csv", "aligned apart blind ", 1,
         1.0}};

    (void)state;
    assert_done(programs_run(
        "cairn align @/places/scans.log --as-written --virtual --steps 8 -o @/written"));
    assert_done(programs_run(
        "cairn align @/places/scans.log --method gradient --virtual --steps 8 -o @/written-2"));
    assert_same_files("written", "written-2", map_files);
    assert_done(programs_run(
        "cairn align @/places/scans.log --method lum --as-written --steps 8 -o @/written-lum"));
    assert_done(programs_run("cairn align @/places/scans.log --method lum -o @/lum"));
    assert_done(programs_run("cairn align @/places/scans.log --virtual -o @/virtual"));
    for (size_t k = 0; k < sizeof sample / sizeof *sample; k++) {
        char *bytes = files_read(files_path(sample[k].poses), NULL);
        cairn_carmen_log_scans scans;
        cairn_pose_table_row *row;
        int32_t count;

        assert_non_null(bytes);
        assert_memory_equal(
            bytes,
            "index,line,time,x,y,theta,var_x,var_y,var_theta,cov_xy,cov_xtheta,cov_ytheta,support,"
            "verdict\n",
            92);
        free(bytes);
        assert_ok(cairn_carmen_log_load(&scans, files_path(sample[k].log), NULL, NULL));
        assert_ok(cairn_pose_table_read(&row, &count, files_path(sample[k].poses), NULL));
        assert_int_equal(count, scans.count);
        for (int32_t i = 0; i < count; i++) {
            char word[40];

            assert_int_equal(row[i].index, i);
            assert_int_equal(row[i].line, scans.record[i].line);
            assert_int_equal(row[i].stamp_ns, scans.record[i].stamp_ns);
            (void)snprintf(word, sizeof word, "%s ", row[i].verdict);
            assert_holds(sample[k].verdicts, word);
            assert_true(k > 0 || (row[i].support >= 0 && row[i].support <= 1));
        }
        if (k == 0) {
            assert_string_equal(row[0].verdict, "first");
            assert_string_equal(row[1].verdict, "matched");
        }
        if (k == 1)
            assert_true((double)row[0].covariance[0] >= 0); /* the aligner reports it */
        if (!(mean_error(row, count, files_path(sample[k].truth), sample[k].relative) <
              sample[k].error))
            fail_msg("%s is off by %g m", sample[k].poses,
                     mean_error(row, count, files_path(sample[k].truth), sample[k].relative));
        cairn_pose_table_free(row);
        cairn_carmen_log_scans_free(&scans);
    }
}

static void the_map_reads_back(void **state)
{
    static const char *const folders[] = {"map", "align"};

    (void)state;
    for (int k = 0; k < 2; k++) {
        cairn_map_file map;
        cairn_file_error error;
        size_t occupied = 0, open = 0, unknown = 0, count;
        double area;

        assert_ok(cairn_map_file_read(&map, in_folder(folders[k], "map.yaml"), &error));
        count = (size_t)map.width * (size_t)map.height;
        assert_near(map.resolution, 0.05, 1e-9);
        assert_int_equal(map.mode, CAIRN_MAP_FILE_TRINARY);
        for (size_t i = 0; i < count; i++) {
            assert_true(map.pixel[i] == 0 || map.pixel[i] == 205 || map.pixel[i] == 254);
            assert_int_equal(map.occupancy[i], map.pixel[i] == 0     ? 100
                                               : map.pixel[i] == 254 ? 0
                                                                     : -1);
            occupied += map.occupancy[i] == 100;
            open += map.occupancy[i] == 0;
            unknown += map.occupancy[i] < 0;
        }
        /* Walls are thin, rooms are free, cells behind walls are unknown. */
        assert_true(occupied > 200 && occupied < open / 5);
        area = (double)open * 0.05 * 0.05;
        assert_true(area > 15 && area < 150);
        assert_true(unknown > 0);
        cairn_map_file_free(&map);
        assert_picture(folders[k], "map.svg");
    }
    /* The cell size is the requested one. */
    {
        cairn_map_file map;

        assert_done(
            programs_run("cairn map @/drive/scans.log -o @/coarse --resolution 0.2 --range 2"));
        assert_ok(cairn_map_file_read(&map, in_folder("coarse", "map.yaml"), NULL));
        assert_near(map.resolution, 0.2, 1e-7);
        cairn_map_file_free(&map);
    }
}

/* A scanner of 4 m in four walls 4 m apart, of whose beams every fourth does not return: these free
 * cells between the walls, and none behind them. */
static void beams_without_return_end_at_walls(void **state)
{
    enum { BEAMS = 360, SCANS = 8 };
    double step = 6.283185307179586 / BEAMS;
    text t = {NULL, 0, 0};
    cairn_map_file map;
    cairn_file_error error;
    int64_t open = 0, outside = 0;

    (void)state;
    for (int s = 0; s < SCANS; s++) {
        add(&t, "ROBOTLASER1 0 -3.14159265 6.28318531 %.9g 4 0.01 0 %d", step, BEAMS);
        for (int i = 0; i < BEAMS; i++)
            add(&t, " %.4f", (i + s) % 4 == 0 ? 4 : room_range(2, 0, 0, -3.14159265 + i * step));
        add(&t, " 0 0 0 0 0 0 0 0 0 0 0 0 %d h %d\n", s, s);
    }
    write_text("short.log", &t);
    free(t.bytes);
    assert_done(programs_run("cairn map @/short.log -o @/short --quiet"));
    assert_ok(cairn_map_file_read(&map, in_folder("short", "map.yaml"), &error));
    for (int32_t y = 0; y < map.height; y++)
        for (int32_t x = 0; x < map.width; x++) {
            double u = (double)map.origin.x + (x + 0.5) * (double)map.resolution;
            double v = (double)map.origin.y + (y + 0.5) * (double)map.resolution;
            int is_free = map.occupancy[(int64_t)y * map.width + x] == 0;

            open += is_free;
            outside += is_free && (fabs(u) > 2.05 || fabs(v) > 2.05);
        }
    cairn_map_file_free(&map);
    assert_in_range(open, 5500, 6600); /* 6400 cells, less those of the walls */
    assert_int_equal(outside, 0);
}

static void names_of_logs_stay_text(void **state)
{
    text t = {NULL, 0, 0};

    (void)state;
    add_room_scan(&t, 2, 60, 0, NULL, 0);
    add_room_scan(&t, 2, 60, 0.1, NULL, 1);
    write_text("a<b>&\"c\".log", &t);
    assert_done(programs_run("cairn map '@/a<b>&\"c\".log' -o @/named --quiet"));
    assert_picture("named", "map.svg");
    free(t.bytes);
}

static void quiet_and_pipes(void **state)
{
    outcome o;

    (void)state;
    /* No progress bar in a pipe, even in a run long enough for one. */
    o = programs_run("cairn map @/drive/scans.log -o @/quiet");
    assert_done(o);
    assert_string_equal(o.err, "");
    assert_holds(o.out, "scans      30 (0 damaged lines left out)\n");
    assert_holds(o.out, "keyframes  ");
    assert_int_equal(lines_of(o.out), 9);
    o = programs_run("cairn align @/places/scans.log -o @/quiet --steps 300");
    assert_done(o);
    assert_string_equal(o.err, "");
    assert_holds(o.out, "scans      12 (0 damaged lines left out)\n");
    assert_int_equal(lines_of(o.out), 5);
    o = programs_run("cairn map @/drive/scans.log -o @/quiet --quiet");
    assert_done(o);
    assert_string_equal(o.err, "");
    assert_string_equal(o.out, "");
    o = programs_run("cairn align --quiet --steps 2 @/places/scans.log -o @/quiet");
    assert_done(o);
    assert_string_equal(o.err, "");
    assert_string_equal(o.out, "");
}

/* Of an earlier run of map, align or merge in the folder nothing stays that this run does not
 * write; other files do. */
static void files_of_other_runs_do_not_stay(void **state)
{
    static const char *const old[] = {"errors.svg", "stages.svg", "transforms.yaml",
                                      "transforms.csv", "places.csv"};
    char name[64];

    (void)state;
    assert_done(programs_run("cairn map @/drive/scans.log -o @/reused --quiet"));
    for (int pass = 0; pass < 2; pass++) {
        (void)files_write_text("reused/other.txt", "kept");
        for (size_t i = 0; i < sizeof old / sizeof *old; i++) {
            (void)snprintf(name, sizeof name, "reused/%s", old[i]);
            (void)files_write_text(name, "old");
        }
        /* poses.tum and graph.g2o of the first pass go in the second one. */
        assert_done(programs_run(
            pass == 0 ? "cairn map @/drive/scans.log -o @/reused --quiet"
                      : "cairn align --quiet --steps 2 @/places/scans.log -o @/reused"));
        assert_int_equal(files_count_in("reused"), 1 + (pass == 0 ? FILES + 2 : FILES));
    }
}

/* With --filter: the same files except the graph, the same bytes with the same seed and others with
 * another, a page, refusals. */
static void maps_by_particles(void **state)
{
    outcome o = programs_run(
        "cairn map @/drive/scans.log -o @/filter --filter 3 --seed 5 --report @/filter.html");
    cairn_file_error error;
    cairn_pose_table_row *row;
    int32_t count;
    char *one, *two;

    (void)state;
    assert_done(o);
    assert_holds(o.out, "scans      30 (0 damaged lines left out)\n");
    assert_holds(o.out, "particles  3, resampled ");
    assert_int_equal(lines_of(o.out), 7);
    assert_int_equal(files_count_in("filter"), FILES);
    /* Files of an earlier run that this one does not write do not stay. */
    (void)files_write_text("filter/graph.g2o", "old");
    (void)files_write_text("filter/poses.tum", "old");
    (void)files_write_text("filter/other.txt", "kept");
    assert_done(
        programs_run("cairn map @/drive/scans.log -o @/filter --filter 3 --seed 5 --quiet"));
    assert_int_equal(files_count_in("filter"), FILES + 1);
    files_remove(files_path("filter/other.txt"));
    assert_ok(cairn_pose_table_read(&row, &count, files_path("filter/poses.csv"), &error));
    assert_true(mean_error(row, count, files_path("drive/truth.csv"), 1) < 0.1);
    cairn_pose_table_free(row);
    one = files_read(files_path("filter.html"), NULL);
    assert_holds(one, "{\"name\":\"support\"");
    assert_holds(one, "N_eff");
    free(one);
    assert_done(
        programs_run("cairn map @/drive/scans.log -o @/filter-again --filter 3 --seed 5 --quiet"));
    assert_same_files("filter", "filter-again", map_files);
    assert_done(
        programs_run("cairn map @/drive/scans.log -o @/filter-6 --filter 3 --seed 6 --quiet"));
    one = files_read(in_folder("filter", "poses.csv"), NULL);
    two = files_read(in_folder("filter-6", "poses.csv"), NULL);
    assert_string_not_equal(one, two);
    free(one);
    free(two);
    assert_done(programs_run(
        "cairn map @/drive/scans.log -o @/filter-alone --filter 2 --no-odometry --quiet"));
    o = programs_run(
        "cairn map @/drive/scans.log -o @/filter-shape --filter 3 --seed 5 --shape-prior --json");
    assert_holds(o.out, "\"shape_starts\": ");
    assert_done(o);
    assert_done(
        programs_run("cairn map @/drive/scans.log -o @/stated --odometry-sigma 0.05 --quiet"));
    assert_refused_from(programs_run("cairn map @/drive/scans.log -o @/filter-few --no-odometry "
                                     "--odometry-sigma 0.05"),
                        "cairn map: ", "--odometry-sigma with --no-odometry, expected one of them");
    assert_refused_from(programs_run("cairn map @/drive/scans.log -o @/filter-few --shape-prior"),
                        "cairn map: ", "--shape-prior without --filter, expected both");
    assert_refused_from(
        programs_run("cairn map @/drive/scans.log -o @/filter-few --filter 2 --max-keys 2"),
        "cairn map: ",
        "scans.log: needs more than 2 keyframes, expected at most that: raise --max-keys");
    assert_refused_from(
        programs_run("cairn map @/drive/scans.log -o @/filter-few --filter 2 --pool 1K"),
        "cairn map: ", "--pool");
    assert_refused_from(programs_run("cairn map @/drive/scans.log -o @/filter-few --filter 4097"),
                        "cairn map: ", "--filter is '4097'");
    assert_int_equal(access(files_path("filter-few"), F_OK), -1);
}

static void help_and_version(void **state)
{
    static const char *const commands[] = {"align", "map", "info", "match"};
    static const char *const common[] = {"--quiet", "--range-max M", "--help"};
    static const char *const both[] = {"-o DIR", "--resolution M", "--pool BYTES", "--seed N",
                                       "--report FILE"};
    outcome o = programs_run("cairn --help");

    (void)state;
    assert_done(o);
    for (int k = 0; k < 4; k++) {
        char line[64];
        outcome help = programs_run("cairn %s --help", commands[k]),
                brief = programs_run("cairn %s -h", commands[k]);

        assert_done(help);
        assert_string_equal(help.err, "");
        assert_string_equal(help.out, brief.out);
        (void)snprintf(line, sizeof line, "usage: cairn %s %s", commands[k],
                       k < 3 ? "LOG" : "A B [options]");
        assert_memory_equal(help.out, line, strlen(line));
        (void)snprintf(line, sizeof line, "\n  %s ", commands[k]);
        assert_holds(o.out, line);
        for (int i = 0; i < 3; i++)
            assert_holds(help.out, common[i]);
        for (int i = 0; i < 5 && k < 2; i++)
            assert_holds(help.out, both[i]);
    }
    o = programs_run("cairn --version");
    assert_done(o);
    assert_int_equal(lines_of(o.out), 1);
    assert_memory_equal(o.out, "cairn 0.", 8);
    o = programs_run("cairn-arena --help");
    assert_done(o);
    assert_holds(o.out, "usage: cairn-arena ");
    assert_holds(o.out, "rescue");
    assert_string_equal(o.err, "");
}

/* The page of --report: beside the other files, in a new folder, or in the current one. */
static void pages(void **state)
{
    static const char *const commands[] = {
        "map @/drive/scans.log",
        "align @/places/scans.log --method gradient --steps 20",
        "align @/places/scans.log",
        "align @/places/scans.log --method lum",
        "align @/places/scans.log --virtual --spread 0.05,1",
        "align @/places/scans.log --as-written --virtual --steps 3",
        "align @/places/scans.log --method lum --as-written --steps 3"};
    static const char *const pieces[][3] = {
        {"{\"title\":\"scans.log, mapped\"", "\"step_name\":\"scan\"",
         "\n{\"step\":29,\"label\":\""},
        {"{\"title\":\"scans.log, aligned\"", "\"step_name\":\"step\"",
         "\n{\"step\":20,\"label\":\"end\""},
        {"{\"title\":\"scans.log, aligned\"", "\"label\":\"12 submaps, the largest of 1 scans\"",
         "scans placed, the others in red\""},
        {"\"label\":\"start\"", " scans registered one after the other\"",
         "\"label\":\"iteration 1\""},
        {"\"name\":\"hypotheses\"", " scans placed, the others in red\"", "\"label\":\"end: "},
        {"force field simulation with virtual scans", "\"name\":\"hypotheses\"",
         "\"label\":\"end: 3 iterations\""},
        {"Lu and Milios as written", "\"label\":\"start\"", "\"label\":\"iteration 1\""}};
    outcome o;

    (void)state;
    for (size_t k = 0; k < sizeof commands / sizeof *commands; k++) {
        char *page[2];
        size_t count[2];

        o = programs_run("cairn %s -o @/paged --report @/paged/map.html", commands[k]);
        assert_done(o);
        assert_string_equal(o.err, "");
        /* the first command's graph and its other poses go with the second */
        assert_int_equal(files_count_in("paged"), k == 0 ? FILES + 3 : FILES + 1);
        assert_done(programs_run("cairn %s -o @/paged --quiet --report @/elsewhere/a/map.html",
                                 commands[k]));
        assert_int_equal(files_count_in("elsewhere/a"), 1);
        for (int i = 0; i < 2; i++) {
            page[i] = files_read(files_path(i == 0 ? "paged/map.html" : "elsewhere/a/map.html"),
                                 &count[i]);
            assert_non_null(page[i]);
        }
        assert_int_equal(count[0], count[1]);
        assert_memory_equal(page[0], page[1], count[0]);
        for (int i = 0; i < 3; i++)
            assert_holds(page[0], pieces[k][i]);
        assert_holds(page[0], "\"grid\":{\"height\":");
        free(page[0]);
        free(page[1]);
    }
    /* With no window there is no potential. */
    assert_done(programs_run(
        "cairn map @/drive/scans.log --window 0 -o @/paged --report @/paged/map.html"));
    {
        char *page = files_read(files_path("paged/map.html"), NULL);

        assert_holds(page, "{\"name\":\"support\"");
        assert_null(strstr(page, "\"potential P(g)\""));
        free(page);
    }
    /* In the current folder. */
    {
        char before[256], here[256], *programs;

        assert_non_null(getcwd(here, sizeof here));
        programs = cairn_output_path_join(here, programs_folder);
        assert_non_null(programs);
        (void)snprintf(programs_folder, sizeof programs_folder, "%s", programs);
        free(programs);
        (void)snprintf(before, sizeof before, "cd '%s' && ", files_path("elsewhere"));
        o = programs_run_shell(
            before, "cairn map ../drive/scans.log -o b --quiet --report here.html", NULL);
        assert_done(o);
        assert_int_equal(access(files_path("elsewhere/here.html"), F_OK), 0);
    }
}

/* ---- Matches ---- */

typedef struct match_result {
    char verdict[16];
    double x, y, theta; /* of the first hypothesis */
    int32_t hypotheses;
} match_result;

/* Checks that the JSON of a match is valid, and its values. */
static match_result read_match(const char *bytes)
{
    cairn_json json = cairn_json_begin("match", bytes, strlen(bytes));
    match_result result = {"", 0, 0, 0, 0};
    cairn_file_error error;
    cairn_json_token token, name;

    memset(&name, 0, sizeof name);
    for (;;) {
        if (cairn_json_next(&json, &token, &error) != CAIRN_OK)
            fail_msg("%s", error.text);
        if (token.kind == CAIRN_JSON_END)
            return result;
        if (token.kind == CAIRN_JSON_NAME)
            name = token;
        else if (token.kind == CAIRN_JSON_STRING && cairn_json_is(&name, "verdict"))
            (void)cairn_json_copy(&token, result.verdict, sizeof result.verdict);
        else if (token.kind == CAIRN_JSON_NUMBER && cairn_json_is(&name, "x") &&
                 result.hypotheses++ == 0)
            result.x = token.number;
        else if (token.kind == CAIRN_JSON_NUMBER && cairn_json_is(&name, "y") &&
                 result.hypotheses == 1)
            result.y = token.number;
        else if (token.kind == CAIRN_JSON_NUMBER && cairn_json_is(&name, "theta") &&
                 result.hypotheses == 1)
            result.theta = token.number;
    }
}

static void matches(void **state)
{
    cairn_pose_table_row *truth;
    cairn_pose expected;
    match_result result;
    int32_t count;
    char *json;
    outcome o;

    (void)state;
    assert_ok(cairn_pose_table_read(&truth, &count, files_path("drive/truth.csv"), NULL));
    expected = cairn_pose_between(truth[18].pose, truth[20].pose);
    cairn_pose_table_free(truth);
    o = programs_run(
        "cairn match @/drive/scans.log:18 @/drive/scans.log:20 --json -o @/match/new --pictures");
    assert_done(o);
    assert_string_equal(o.err, "");
    assert_int_equal(files_count_in("match/new"), 3);
    assert_picture("match/new", "match.svg");
    assert_picture("match/new", "tangents.svg");
    json = files_read(files_path("match/new/match.json"), NULL);
    assert_string_equal(o.out, json);
    free(json);
    assert_holds(o.out, "/drive/scans.log\", \"index\": 18, \"line\": ");
    result = read_match(o.out);
    assert_string_equal(result.verdict, "found");
    assert_near(result.x, expected.x, 0.03);
    assert_near(result.y, expected.y, 0.03);
    assert_near(result.theta, expected.theta, 0.02);

    /* As text, with a start nearby; the same bytes again; quietly. */
    o = programs_run("cairn match @/drive/scans.log:18 @/drive/scans.log:20 --start %.2f,%.2f,%.1f "
                     "--window 0.5,20",
                     (double)expected.x + 0.1, (double)expected.y - 0.1,
                     (double)expected.theta * 57.3 + 5);
    assert_done(o);
    assert_holds(o.out, "verdict    found\n");
    assert_holds(o.out, "\n   1  ");
    assert_done(programs_run("cairn match @/drive/scans.log:18 @/drive/scans.log:20 -o "
                             "@/match/again --pictures --quiet"));
    for (int k = 0; k < 2; k++) {
        static const char *const names[] = {"match.json", "match.svg"};
        char *one = files_read(in_folder("match/new", names[k]), NULL);
        char *two = files_read(in_folder("match/again", names[k]), NULL);

        assert_string_equal(one, two);
        free(one);
        free(two);
    }
    o = programs_run("cairn match @/drive/scans.log @/drive/scans.log:0 --quiet -o @/match/plain");
    assert_done(o);
    assert_string_equal(o.out, "");
    assert_int_equal(files_count_in("match/plain"), 1);
    json = files_read(files_path("match/plain/match.json"), NULL);
    result = read_match(json);
    free(json);
    assert_near(hypot(result.x, result.y) + fabs(result.theta), 0, 1e-3);
}

/* A copy of a log of FLASER lines in which every pose, of the robot and of the laser, is noise. */
static void overwrite_poses(const char *from, const char *to)
{
    cairn_random random = cairn_random_seed(17, 1);
    char *log = files_read(files_path(from), NULL);
    text t = {NULL, 0, 0};

    for (char *line = strtok(log, "\n"); line != NULL; line = strtok(NULL, "\n")) {
        int32_t count = 0, at = 0;
        char *field = line;

        if (strncmp(line, "FLASER ", 7) == 0)
            count = (int32_t)strtol(line + 7, NULL, 10);
        while (count > 0 && at < count + 2) {
            field = strchr(field, ' ') + 1;
            at++;
        }
        for (char *c = line; c < (count > 0 ? field : line + strlen(line)); c++)
            add(&t, "%c", *c);
        if (count > 0) {
            double x = (double)cairn_random_uniform(&random, -9, 9),
                   y = (double)cairn_random_uniform(&random, -9, 9);
            double theta = (double)cairn_random_uniform(&random, -3, 3);

            for (int k = 0; k < 6; k++)
                field = strchr(field, ' ') + 1;
            add(&t, "%.6f %.6f %.6f %.6f %.6f %.6f %s", x, y, theta, x, y, theta, field);
        }
        add(&t, "\n");
    }
    write_text(to, &t);
    free(t.bytes);
    free(log);
}

/* The poses in a log are not used: with noise in their place the output has the same bytes. */
static void poses_of_a_log_are_not_used(void **state)
{
    static const char *const methods[] = {"default", "shape"};
    char *log = files_read(files_path("drive/scans.log"), NULL), *noise;

    (void)state;
    for (int k = 0; k < 2; k++) {
        char *one, *two;
        outcome o;

        (void)files_write_text("given.log", log);
        assert_done(programs_run(
            "cairn match @/given.log:14 @/given.log:16 --method %s -o @/given --pictures --quiet",
            methods[k]));
        overwrite_poses("drive/scans.log", "given.log");
        noise = files_read(files_path("given.log"), NULL);
        assert_true(strcmp(log, noise) != 0);
        free(noise);
        o = programs_run(
            "cairn match @/given.log:14 @/given.log:16 --method %s -o @/guessed --pictures --json",
            methods[k]);
        assert_done(o);
        assert_true(read_match(o.out).hypotheses > 0);
        for (int i = 0; i < 2; i++) {
            static const char *const names[] = {"match.json", "match.svg"};

            one = files_read(in_folder("given", names[i]), NULL);
            two = files_read(in_folder("guessed", names[i]), NULL);
            assert_string_equal(one, two);
            free(one);
            free(two);
        }
    }
    free(log);
}

/* By shape, with a picture of every stage; poor scans too. */
static void matches_by_shape(void **state)
{
    static const char *const pictures[] = {"match.svg", "tangents.svg", "histogram.svg",
                                           "pairs.svg", "filters.svg"};
    static const char *const scans[][2] = {{"drive/scans.log:14", "drive/scans.log:15"},
                                           {"poor.json:2", "poor.json:1"},
                                           {"poor.json:2", "poor.json:2"}};

    (void)state;
    for (int k = 0; k < 3; k++) {
        outcome o =
            programs_run("cairn match @/%s @/%s --method shape --json -o @/shape --pictures",
                         scans[k][0], scans[k][1]);

        assert_done(o);
        assert_holds("found ambiguous none", read_match(o.out).verdict);
        assert_holds(o.out, "\"method\": \"shape\"");
        assert_int_equal(files_count_in("shape"), 6);
        for (int i = 0; i < 5; i++)
            assert_picture("shape", pictures[i]);
    }
}

/* Uninformative scans, and rotationally symmetric ones: a verdict. */
static void matches_of_poor_scans(void **state)
{
    static const struct {
        const char *a, *b, *verdict;
    } sample[] = {
        {"poor.json:0", "poor.json:0", "none"},      {"poor.json:1", "poor.json:0", "none"},
        {"poor.json:2", "poor.json:2", "ambiguous"}, {"poor.json:2", "poor.json:1", "none"},
        {"drive/scans.log", "poor.json", "none"},    {"poor:7.json", "poor:7.json:0", "none"}};
    text t = {NULL, 0, 0};

    (void)state;
    add(&t, "{\"nrays\":1,\"theta\":[0],\"readings\":[1]}\n{\"nrays\":3,\"theta\":[0,1,2],"
            "\"readings\":[null,null,null]"
            "}\n");
    add(&t, "{\"nrays\":360,\"min_theta\":-3.14,\"max_theta\":3.14,\"readings\":[2");
    for (int i = 1; i < 360; i++)
        add(&t, ",2");
    add(&t, "]}\n");
    write_text("poor.json", &t);
    (void)files_write_text("poor:7.json", "{\"nrays\":1,\"theta\":[0],\"readings\":[1]}");
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        outcome o = programs_run("cairn match @/%s @/%s --json -o @/poor --pictures", sample[i].a,
                                 sample[i].b);

        assert_done(o);
        assert_string_equal(read_match(o.out).verdict, sample[i].verdict);
        assert_picture("poor", "match.svg");
        assert_picture("poor", "tangents.svg");
        o = programs_run("cairn match @/%s @/%s", sample[i].a, sample[i].b);
        assert_done(o);
        assert_holds(o.out, sample[i].verdict);
        if (i == 2) {
            assert_holds(o.out, "unobserved rotation about the centre of B: information ");
            assert_holds(o.out, "     any "); /* the heading's standard deviation */
        }
    }
    free(t.bytes);
}

/* ---- Partly damaged logs ---- */

static void a_damaged_scan_is_left_out(void **state)
{
    char *whole = files_read(files_path("drive/scans.log"), NULL), *line = whole;
    cairn_pose_table_row *row, *all;
    int32_t count, all_count;
    outcome o;

    (void)state;
    /* The fifth scan gets a word instead of its third range. */
    for (int scan = 0; scan < 5; scan++) {
        line = strstr(line + 1, "\nFLASER");
        assert_non_null(line);
    }
    line = strchr(line + 12, ' ');
    line[1] = 'x';
    (void)files_write_text("damaged.log", whole);
    free(whole);
    o = programs_run("cairn map @/damaged.log -o @/damaged-map");
    assert_done(o);
    assert_holds(o.out, "scans      29 (1 damaged lines left out)\n");
    assert_int_equal(lines_of(o.err), 1);
    assert_ok(cairn_pose_table_read(&all, &all_count, files_path("map/poses.csv"), NULL));
    assert_ok(cairn_pose_table_read(&row, &count, files_path("damaged-map/poses.csv"), NULL));
    assert_int_equal(count, 29);
    for (int32_t i = 0; i < count; i++)
        assert_int_equal(row[i].line, all[i < 4 ? i : i + 1].line);
    {
        char place[128];

        (void)snprintf(place, sizeof place, "%s/damaged.log:%d: reading ", files_folder,
                       (int)all[4].line);
        assert_memory_equal(o.err, place, strlen(place));
        assert_holds(o.err, "expected a number");
    }
    cairn_pose_table_free(row);
    cairn_pose_table_free(all);
    o = programs_run("cairn align @/damaged.log -o @/damaged-align --steps 3");
    assert_done(o);
    assert_holds(o.out, "scans      29 (1 damaged lines left out)\n");
    assert_int_equal(lines_of(o.err), 1);
    o = programs_run("cairn align @/damaged.log -o @/damaged-align --steps 3 --quiet");
    assert_done(o);
    assert_string_equal(o.err, "");
}

/* One line in ten is damaged. */
static void a_tenth_of_the_lines_is_damaged(void **state)
{
    char *whole = files_read(files_path("drive/scans.log"), NULL), *line = whole;
    int32_t damaged = 0, scans = 0;
    char summary[64];
    outcome o;

    (void)state;
    for (; (line = strstr(line, "\nFLASER")) != NULL; line++) {
        if (scans++ % 10 != 4)
            continue;
        line[40] = '?';
        damaged++;
    }
    (void)files_write_text("tenth.log", whole);
    free(whole);
    o = programs_run("cairn map @/tenth.log -o @/tenth");
    assert_done(o);
    (void)snprintf(summary, sizeof summary, "(%d damaged lines left out", (int)damaged);
    assert_true(damaged >= 3);
    assert_holds(o.out, summary);
    assert_int_equal(lines_of(o.err), damaged);
}

/* The drive once more as a table of ranges; and both one after another. */
static void tables_of_ranges_and_several_logs(void **state)
{
    text t = {NULL, 0, 0};
    cairn_carmen_log_scans log;
    cairn_pose_table_row *row, *first;
    cairn_pose_graph_file graph;
    int32_t count, first_count;
    outcome o;

    (void)state;
    assert_ok(cairn_carmen_log_load(&log, files_path("drive/scans.log"), NULL, NULL));
    add(&t, "time,x,y,theta");
    for (int32_t k = 0; k < log.record[0].count; k++)
        add(&t, ",%.9g",
            (double)(log.record[0].scan.angle_min + (float)k * log.record[0].scan.angle_step) *
                57.29577951308232);
    for (int32_t i = 0; i < log.count; i++) {
        const cairn_carmen_log_record *r = &log.record[i];

        add(&t, "\n%.6f,%.9g,%.9g,%.9g", (double)r->stamp_ns * 1e-9, (double)r->robot.x,
            (double)r->robot.y, (double)r->robot.theta);
        for (int32_t k = 0; k < r->count; k++)
            add(&t, ",%.9g", (double)r->range[k]);
    }
    (void)files_write_text("drive.csv", t.bytes);
    free(t.bytes);
    assert_done(programs_run("cairn map @/drive.csv -o @/table"));
    assert_ok(cairn_pose_table_read(&first, &first_count, files_path("map/poses.csv"), NULL));
    assert_ok(cairn_pose_table_read(&row, &count, files_path("table/poses.csv"), NULL));
    assert_int_equal(count, first_count);
    for (int32_t i = 0; i < count; i++) {
        assert_near(row[i].pose.x, first[i].pose.x, 0.02);
        assert_near(row[i].pose.y, first[i].pose.y, 0.02);
        assert_near(cairn_wrap_angle(row[i].pose.theta - first[i].pose.theta), 0, 0.01);
    }
    cairn_pose_table_free(row);
    cairn_pose_table_free(first);
    o = programs_run("cairn map @/drive/scans.log @/drive.csv -o @/both");
    assert_done(o);
    assert_ok(cairn_pose_table_read(&row, &count, files_path("both/poses.csv"), NULL));
    assert_int_equal(count, 2 * first_count);
    cairn_pose_table_free(row);
    assert_ok(cairn_pose_graph_file_read(&graph, files_path("table/graph.g2o"), NULL));
    assert_true(graph.vertex_count > 1 && graph.edge_count >= graph.vertex_count - 1);
    cairn_pose_graph_file_free(&graph);
    {
        char *tum = files_read(files_path("table/poses.tum"), NULL);

        assert_int_equal(lines_of(tum), log.count);
        free(tum);
    }
    cairn_carmen_log_scans_free(&log);
    o = programs_run("cairn map @/drive.csv @/missing.log -o @/refused");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "missing.log: cannot open");
    assert_int_equal(files_count_in("refused"), -1);
}

static void damage_of_all_kinds_among_good_scans(void **state)
{
    text t = {NULL, 0, 0};
    cairn_pose_table_row *row;
    int32_t count;
    outcome o;

    (void)state;
    add_room_scan(&t, 2, 90, 0, NULL, 0);
    add(&t, "ROBOTLASER1 0 -3 6 0.1 50 0.01 0 100001 1 2 3\n");
    add_room_scan(&t, 2, 90, 0.1, NULL, 1);
    add_room_scan(&t, 2, 90, 0.15, "nan", 2);
    add_room_scan(&t, 2, 90, 0.2, "50", 3);
    add(&t, "FLASER 10 1 2 3\n");
    add_room_scan(&t, 2, 90, 0.3, NULL, 4);
    add_room_scan(&t, 2, 90, 0.4, NULL, 5);
    t.count -= 200; /* cut inside the last line */
    write_text("mixed.log", &t);
    o = programs_run("cairn map @/mixed.log -o @/mixed");
    assert_done(o);
    assert_int_equal(lines_of(o.err), 3);
    assert_holds(o.err, "/mixed.log:2: the number of readings is \"100001\", expected a whole "
                        "number from 1 to 100000\n");
    assert_holds(o.err, "/mixed.log:6: the FLASER line ends early, expected reading 4\n");
    assert_holds(o.err, "/mixed.log:8: the ROBOTLASER1 line ends early, expected ");
    assert_holds(o.out, "scans      5 (3 damaged lines left out)\n");
    assert_ok(cairn_pose_table_read(&row, &count, files_path("mixed/poses.csv"), NULL));
    assert_int_equal(count, 5);
    assert_string_equal(row[0].verdict, "first");
    assert_string_equal(row[1].verdict, "matched");
    assert_string_equal(row[2].verdict, "blind"); /* nothing known */
    assert_string_equal(row[3].verdict, "blind"); /* nothing came back */
    assert_string_equal(row[4].verdict, "matched");
    assert_near(row[4].pose.x - row[0].pose.x, 0.3, 0.01);
    cairn_pose_table_free(row);
    o = programs_run("cairn align @/mixed.log -o @/mixed --method gradient --steps 5");
    assert_done(o);
    assert_ok(cairn_pose_table_read(&row, &count, files_path("mixed/poses.csv"), NULL));
    assert_int_equal(count, 5);
    assert_string_equal(row[1].verdict, "aligned");
    assert_string_equal(row[2].verdict, "blind");
    assert_near(row[2].pose.x, 0.15, 1e-6);
    cairn_pose_table_free(row);
    free(t.bytes);
}

/* The method as printed has two option names; scan after scan it differs. */
static void aligned_as_written(void **state)
{
    char *of_all, *online;
    outcome o;

    (void)state;
    o = programs_run("cairn align @/places/scans.log -o @/gradient --method gradient --steps 4");
    assert_done(o);
    assert_holds(o.out, "steps      4 (out of steps)\n");
    assert_done(
        programs_run("cairn align @/places/scans.log -o @/written --as-written --steps 4 --quiet"));
    assert_same_files("gradient", "written", map_files);
    o = programs_run("cairn align @/places/scans.log -o @/online --as-written --online --steps 4");
    assert_done(o);
    assert_holds(o.out, "steps      ");
    of_all = files_read(files_path("written/poses.csv"), NULL);
    online = files_read(files_path("online/poses.csv"), NULL);
    assert_string_not_equal(of_all, online);
    free(of_all);
    free(online);
    assert_done(programs_run(
        "cairn align @/places/scans.log -o @/online-again --method gradient --online --steps 4"));
    assert_same_files("online", "online-again", map_files);
}

static void a_log_without_walls(void **state)
{
    text t = {NULL, 0, 0};
    cairn_map_file map;

    (void)state;
    for (int i = 0; i < 3; i++)
        add_room_scan(&t, 2, 90, 0.1 * i, i == 1 ? "nan" : "50", i);
    write_text("blind.log", &t);
    /* Free space is a map too. */
    assert_done(programs_run("cairn map @/blind.log -o @/blind"));
    assert_ok(cairn_map_file_read(&map, in_folder("blind", "map.yaml"), NULL));
    for (size_t i = 0; i < (size_t)map.width * (size_t)map.height; i++)
        assert_true(map.occupancy[i] <= 0);
    cairn_map_file_free(&map);
    assert_picture("blind", "map.svg");
    assert_refused_from(programs_run("cairn align @/blind.log -o @/blind-align"),
                        "cairn align: ", "no scan shows a wall, expected at least one");
    assert_int_equal(files_count_in("blind-align"), -1);
    /* One scan with one beam. */
    add(&t, "FLASER 1 2 0 0 0 0 0 0 1 h 1\n");
    write_text("single.log", &t);
    assert_done(programs_run("cairn map @/single.log -o @/single"));
    assert_refused_from(programs_run("cairn align @/single.log -o @/blind-align"),
                        "cairn align: ", "no scan shows a wall");
    free(t.bytes);
}

/* Keyframes with more points than the initial capacity: all begins anew, and the output does not
 * show it. */
static void large_rooms_get_a_larger_window(void **state)
{
    text t = {NULL, 0, 0};
    cairn_pose_table_row *row;
    int32_t count;
    outcome o;

    (void)state;
    for (int i = 0; i < 12; i++)
        add_room_scan(&t, 8, 900, 0.55 * i - 3, NULL, i);
    write_text("large.log", &t);
    o = programs_run("cairn map @/large.log -o @/large");
    assert_done(o);
    assert_holds(o.out, "keyframes  12 (0 culled)\n");
    assert_ok(cairn_pose_table_read(&row, &count, files_path("large/poses.csv"), NULL));
    assert_int_equal(count, 12);
    for (int i = 0; i < 12; i++)
        assert_near(row[i].pose.x - row[0].pose.x, 0.55 * i, 0.05);
    cairn_pose_table_free(row);
    assert_refused_from(
        programs_run("cairn map @/large.log -o @/too-few --max-keys 5"), "cairn map: ",
        "large.log: needs more than 5 keyframes, expected at most that: raise --max-keys");
    assert_int_equal(files_count_in("too-few"), -1);
    free(t.bytes);
}

/* To and fro in a room, with fewer keyframes than needed. */
static void scans_of_culled_keyframes_are_written(void **state)
{
    enum { TO_AND_FRO = 90 };
    text t = {NULL, 0, 0};
    cairn_pose_graph_file graph;
    cairn_pose_table_row *row;
    int32_t count;
    outcome o;
    char *page;

    (void)state;
    for (int i = 0; i < TO_AND_FRO; i++)
        add_room_scan(&t, 8, 181, 0.55 * abs(i % 18 - 9) - 2.5, NULL, i);
    write_text("to-and-fro.log", &t);
    assert_refused_from(programs_run("cairn map @/to-and-fro.log -o @/goes --max-keys 40"),
                        "cairn map: ", "needs more than 40 keyframes");
    o = programs_run(
        "cairn map @/to-and-fro.log -o @/goes --max-keys 40 --release --report @/goes.html");
    assert_done(o);
    assert_null(strstr(o.out, "(0 released)"));
    assert_ok(cairn_pose_table_read(&row, &count, files_path("goes/poses.csv"), NULL));
    assert_int_equal(count, TO_AND_FRO);
    for (int i = 0; i < TO_AND_FRO; i++) {
        assert_near(row[i].pose.x - row[0].pose.x, 0.55 * (abs(i % 18 - 9) - 9), 0.05);
        assert_near(row[i].pose.y - row[0].pose.y, 0, 0.05);
    }
    cairn_pose_table_free(row);
    assert_ok(cairn_pose_graph_file_read(&graph, files_path("goes/graph.g2o"), NULL));
    assert_true(graph.vertex_count < 40 && graph.vertex_count > 30);
    assert_true(graph.edge_count >= graph.vertex_count - 1);
    cairn_pose_graph_file_free(&graph);
    page = files_read(files_path("goes.html"), NULL);
    assert_holds(page, "keyframes\"");
    free(page);
    assert_refused_from(
        programs_run("cairn map @/to-and-fro.log -o @/goes-not --max-keys 20 --release"),
        "cairn map: ", "--max-keys is '20', expected more with --release");
    assert_int_equal(files_count_in("goes-not"), -1);
    free(t.bytes);
}

/* A robot that returns many times: loops are closed; with --no-loops none is, and no graph is
 * written. */
static void maps_without_loop_closure(void **state)
{
    enum { TO_AND_FRO = 90 };
    text t = {NULL, 0, 0};
    cairn_pose_table_row *row;
    int32_t count;
    outcome o;

    (void)state;
    for (int i = 0; i < TO_AND_FRO; i++)
        add_room_scan(&t, 8, 181, 0.55 * abs(i % 18 - 9) - 2.5, NULL, i);
    write_text("returns.log", &t);
    free(t.bytes);
    o = programs_run("cairn map @/returns.log -o @/returns");
    assert_done(o);
    assert_null(strstr(o.out, "loops      0 closed"));
    assert_int_equal(files_count_in("returns"), FILES + 2);
    o = programs_run("cairn map @/returns.log -o @/no-loops --no-loops");
    assert_done(o);
    assert_holds(o.out, "loops      0 closed, 0 corrections\n");
    assert_int_equal(files_count_in("no-loops"), FILES);
    assert_ok(cairn_pose_table_read(&row, &count, files_path("no-loops/poses.csv"), NULL));
    assert_int_equal(count, TO_AND_FRO);
    for (int i = 0; i < TO_AND_FRO; i++)
        assert_near(row[i].pose.x - row[0].pose.x, 0.55 * (abs(i % 18 - 9) - 9), 0.05);
    cairn_pose_table_free(row);
}

static void poses_far_away(void **state)
{
    text t = {NULL, 0, 0};
    outcome o;

    (void)state;
    add_room_scan(&t, 2, 60, 0, NULL, 0);
    add_room_scan(&t, 2, 60, 2e6, "2", 1);
    write_text("far.log", &t);
    /* no robot moves so far: the jump is ignored */
    assert_done(programs_run("cairn map @/far.log -o @/far"));
    o = programs_run("cairn align @/far.log -o @/far-align");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "/far.log:2: the scan cannot be used: the pose is farther than 1e6 m");
    assert_int_equal(files_count_in("far-align"), -1);
    /* The scans prevail over such odometry. */
    add_room_scan(&t, 2, 60, 0, NULL, 0);
    add_room_scan_elsewhere(&t, 2, 60, 0.1, 2e6, NULL, 1);
    write_text("jump.log", &t);
    assert_done(programs_run("cairn map @/jump.log -o @/jump"));
    free(t.bytes);
}

/* ---- Bad input ---- */

/* One line about the file for either side of a match. */
static void refuse_scan(const char *name, const char *piece)
{
    char start[64];

    (void)snprintf(start, sizeof start, "/%s:", name);
    assert_refused_from(programs_run("cairn match @/%s @/drive/scans.log -o @/refused", name),
                        start, piece);
    assert_refused_from(programs_run("cairn match @/drive/scans.log @/%s -o @/refused", name),
                        start, piece);
    assert_int_equal(files_count_in("refused"), -1);
}

static void scans_that_are_none(void **state)
{
    (void)state;
    (void)files_write_text("empty.json", "");
    refuse_scan("empty.json", "the file is empty, expected a log of scans");
    (void)files_write_text("cut.json", "{\"nrays\": 3,\n\"theta\": [0, 1");
    refuse_scan("cut.json", "cut.json:2: the text ends within an array, expected a comma or ]");
    (void)files_write_text("list.json", "[1]");
    refuse_scan("list.json", "list.json:1: not an object, expected { and the fields of a scan");
    (void)files_write_text("short.json", "{\"nrays\":3,\"theta\":[0,1],\"readings\":[1,2,3]}");
    refuse_scan("short.json", "short.json:1: theta holds 2 numbers, expected 3");
    (void)files_write_text("nan.json", "{\"nrays\":1,\"theta\":[0],\"readings\":[nan]}");
    refuse_scan("nan.json", "nan.json:1: 'n' within an array, expected a value");
    assert_int_equal(mkdir(files_path("folder.json"), 0777), 0);
    refuse_scan("folder.json", "a folder without metadata.yaml, expected a bag of ROS 2 or a file");
    {
        outcome o = programs_run("cairn match @/missing.json @/drive/scans.log -o @/refused");

        assert_int_equal(o.code, 2);
        assert_int_equal(lines_of(o.err), 1);
        assert_holds(o.err, "/missing.json: cannot open: No such file or directory\n");
    }
    /* The folder is checked before the scans. */
    (void)files_write_text("plain", "kept");
    assert_refused_from(programs_run("cairn match @/missing.json b -o @/plain"),
                        "/plain: ", "is a file, expected a folder");
}

/* Two lines for a log that has both a damaged line and no scan: the second one is checked by
 * `piece`. */
static void refuse_log(const char *name, int warnings, const char *first, const char *piece)
{
    static const char *const commands[] = {"align", "map", "info"};

    for (int k = 0; k < 3; k++) {
        outcome o = k < 2 ? programs_run("cairn %s @/%s -o @/refused", commands[k], name)
                          : programs_run("cairn info @/%s", name);
        char start[256];

        (void)snprintf(start, sizeof start, "%s/%s:", files_folder, name);
        if (o.code != 2 || lines_of(o.err) != warnings + 1 ||
            strncmp(o.err, start, strlen(start)) != 0)
            fail_msg("cairn %s: exit code %d: %s", commands[k], o.code, o.err);
        assert_holds(o.err, first);
        assert_holds(o.err, piece);
        assert_string_equal(o.out, "");
        assert_int_equal(files_count_in("refused"), -1);
    }
}

static void logs_that_are_none(void **state)
{
    char *whole = files_read(files_path("drive/scans.log"), NULL);
    const char *none =
        "no whole scan in 1 lines (1 damaged), expected FLASER or ROBOTLASER1 lines "
        "of a CARMEN log, a log of URG or CSM, a table of ranges with a header, or a "
        "bag of ROS\n";
    gzFile zip;
    size_t count = 0;

    (void)state;
    refuse_log("missing.log", 0, "", "missing.log: cannot open: No such file or directory\n");
    (void)files_write_text("empty.log", "");
    refuse_log("empty.log", 0, "", "empty.log: the file is empty, expected a log of scans\n");
    (void)files_write_text("cut.log", "FLASER 5 1.5 2.5 3");
    refuse_log("cut.log", 1, "cut.log:1: the FLASER line ends early, expected reading 4\n", none);
    (void)files_write_text("few.log", "FLASER 2 1.5 2.5 0 0 0 0 0 0 1.5 host\n");
    refuse_log("few.log", 1, "few.log:1: the FLASER line ends early, expected the logger's stamp\n",
               none);
    (void)files_write_text("nan.log", "FLASER 1 1 nan 0 0 0 0 0 1 h 1\n");
    refuse_log("nan.log", 1, "nan.log:1: the laser's pose is nan, expected a finite number\n",
               none);
    (void)files_write_text("beams.log", "FLASER 100001 1 1 1\n");
    refuse_log("beams.log", 1,
               "beams.log:1: the number of readings is \"100001\", expected a whole number", none);
    (void)files_write_text("prose.log", "Call me Ishmael.\n");
    refuse_log("prose.log", 0, "", "no whole scan in 1 lines (0 damaged), expected FLASER");
    assert_int_equal(mkdir(files_path("folder.log"), 0777), 0);
    refuse_log("folder.log", 0, "",
               "folder.log: a folder without metadata.yaml, expected a bag of ROS 2 or a file\n");

    /* A truncated gzip file: the readable part is used; when that is empty it is refused. */
    zip = gzopen(files_path("whole.log.gz"), "wb");
    assert_non_null(zip);
    assert_int_equal(gzwrite(zip, whole, (unsigned)strlen(whole)), (int)strlen(whole));
    assert_int_equal(gzclose(zip), Z_OK);
    free(whole);
    whole = files_read(files_path("whole.log.gz"), &count);
    (void)files_write("cut.log.gz", whole, count / 2);
    (void)files_write("stump.log.gz", whole, 20);
    free(whole);
    {
        outcome o = programs_run("cairn map @/cut.log.gz -o @/cut-map");

        assert_done(o);
        assert_holds(
            o.err,
            "the gzip data end after this line, expected the end of the stream: the file is cut\n");
        assert_holds(o.err, "/cut.log.gz:");
        assert_null(strstr(o.out, "scans      30 "));
    }
    refuse_log("stump.log.gz", 1, "the file is cut", "expected");
}

static void command_lines(void **state)
{
    static const struct {
        const char *arguments, *start, *piece;
    } sample[] = {
        {"cairn map", "cairn map: ", "no log"},
        {"cairn align @/drive/scans.log", "cairn align: ", "no folder to write to (-o)"},
        {"cairn map @/drive/scans.log -o", "cairn map: ", "nothing after '-o'"},
        {"cairn map @/drive/scans.log -o ''", "cairn map: ", "-o is ''"},
        {"cairn map @/drive/scans.log -o @/refused --fast",
         "cairn map: ", "unknown option '--fast'"},
        {"cairn align @/drive/scans.log -o @/refused -x", "cairn align: ", "unknown option '-x'"},
        {"cairn align @/drive/scans.log -o @/refused --method magic",
         "cairn align: ", "unknown method 'magic', expected default, gradient or lum"},
        {"cairn align @/drive/scans.log -o @/refused --method lum --virtual", "cairn align: ",
         "--virtual with --method lum: hypotheses go with default or gradient; expected one of the "
         "two"},
        {"cairn align @/drive/scans.log -o @/refused --method default --as-written",
         "cairn align: ", "--as-written with --method default: the thesis has gradient and lum"},
        {"cairn align @/drive/scans.log -o @/refused --as-written --virtual --spread 0.1,5",
         "cairn align: ",
         "--spread with --as-written: the thesis's methods have no prior on the pose error"},
        {"cairn align @/drive/scans.log -o @/refused --method lum --as-written --spacing 0.1",
         "cairn align: ", "--spacing with --as-written: method lum pairs the scans' own points"},
        {"cairn align @/drive/scans.log -o @/refused --online",
         "cairn align: ", "--online with a method other than gradient"},
        {"cairn align @/drive/scans.log -o @/refused --as-written --online --report "
         "@/refused/map.html",
         "cairn align: ", "--report with --online: the player needs all scans at the start"},
        {"cairn align @/drive/scans.log -o @/refused --headings 4",
         "cairn align: ", "--headings with the poses of the log"},
        {"cairn align @/drive/scans.log -o @/refused --no-poses --spread 1,20",
         "cairn align: ", "--spread with --no-poses: there are no initial poses"},
        {"cairn align @/drive/scans.log -o @/refused --no-poses --as-written --spacing 0.1",
         "cairn align: ", "--spacing with --as-written: it uses the raw readings"},
        {"cairn align @/drive/scans.log -o @/refused --spread 0,1",
         "cairn align: ", "--spread is '0,1'"},
        {"cairn align @/drive/scans.log -o @/refused --steps 0",
         "cairn align: ", "--steps is '0', expected a whole number from 1 to 100000"},
        {"cairn align @/drive/scans.log -o @/refused --steps 1.5",
         "cairn align: ", "--steps is '1.5'"},
        {"cairn align @/drive/scans.log -o @/refused --spacing nan",
         "cairn align: ", "--spacing is 'nan'"},
        {"cairn map @/drive/scans.log -o @/refused --window 1",
         "cairn map: ", "expected 0 or 2 to 64"},
        {"cairn map @/drive/scans.log -o @/refused --window=65", "cairn map: ", "--window is '65'"},
        {"cairn map @/drive/scans.log -o @/refused --resolution 0",
         "cairn map: ", "--resolution is '0'"},
        {"cairn map @/drive/scans.log -o @/refused --resolution 1e-3x",
         "cairn map: ", "--resolution is '1e-3x'"},
        {"cairn map @/drive/scans.log -o @/refused --range inf", "cairn map: ", "--range is 'inf'"},
        {"cairn map @/drive/scans.log -o @/refused --max-keys 1",
         "cairn map: ", "--max-keys is '1'"},
        {"cairn map @/drive/scans.log -o @/refused --filter 3 --release",
         "cairn map: ", "--release with --filter"},
        {"cairn map @/drive/scans.log -o @/refused --filter 3 --no-loops",
         "cairn map: ", "--no-loops with --filter, expected one of them"},
        {"cairn map @/drive/scans.log -o @/refused --release --no-loops",
         "cairn map: ", "--no-loops with --release, expected one of them"},
        {"cairn map @/drive/scans.log -o @/refused --seed=-1", "cairn map: ", "--seed is '-1'"},
        {"cairn map @/drive/scans.log -o @/refused --quiet=yes", "cairn map: ", "'--quiet=yes'"},
        {"cairn map @/drive/scans.log -o @/refused --pool 64",
         "cairn map: ", "--pool is '64', expected at least "},
        {"cairn align @/drive/scans.log -o @/refused --pool 64K",
         "cairn align: ", "--pool is '64K', expected at least "},
        {"cairn map @/drive/scans.log -o @/refused --pool 2T",
         "cairn map: ", "--pool is '2T', expected a number of bytes such as"},
        {"cairn map @/drive/scans.log -o @/refused --pool K", "cairn map: ", "--pool is 'K'"},
        {"cairn map @/drive/scans.log -o @/refused --pool 0", "cairn map: ", "--pool is '0'"},
        {"cairn align @/drive/scans.log -o @/refused --max-scans 29", "cairn align: ",
         "holds 30 scans, expected at most 29: raise --max-scans, or use cairn map"},
        {"cairn map @/drive/scans.log -o @/refused --resolution 0.001",
         "map: ", "cells are too many, expected up to 67108864: choose a coarser resolution"},
        {"cairn match", "cairn match: ", "no scans, expected A and B"},
        {"cairn match @/drive/scans.log", "cairn match: ", "only one scan, expected A and B"},
        {"cairn match a b c", "cairn match: ", "one word too many, 'c'"},
        {"cairn match a b --method magic",
         "cairn match: ", "unknown method 'magic', expected default or shape"},
        {"cairn match a b --start 1,2",
         "cairn match: ", "--start is '1,2', expected three numbers X,Y,DEG"},
        {"cairn match a b --start 1,2,3,4", "cairn match: ", "--start is '1,2,3,4'"},
        {"cairn match a b --start 1,nan,3", "cairn match: ", "--start is '1,nan,3'"},
        {"cairn match a b --start 2e5,0,0", "cairn match: ", "--start is '2e5,0,0'"},
        {"cairn match a b --window 1,1",
         "cairn match: ", "--window without --start, expected both or none"},
        {"cairn match a b --start 0,0,0 --window 1", "cairn match: ", "--window is '1'"},
        {"cairn match a b --start 0,0,0 --window 1,-1", "cairn match: ", "--window is '1,-1'"},
        {"cairn match a b --pictures",
         "cairn match: ", "--pictures without a folder to write to, expected -o DIR"},
        {"cairn match a b --spacing 0", "cairn match: ", "--spacing is '0'"},
        {"cairn match @/drive/scans.log:30 @/drive/scans.log",
         "cairn match: ", "holds 30 scans, expected an index from 0 to 29, not 30"},
        {"cairn match @/drive/scans.log @/poor.json:3",
         "cairn match: ", "holds 3 scans, expected an index from 0 to 2, not 3"},
        {"cairn match @/drive/scans.log @/drive/scans.log --pool 1K",
         "cairn match: ", "--pool is '1K', expected at least"},
        {"cairn info", "cairn info: ", "no log"},
        {"cairn info --range-max 0 @/drive/scans.log", "cairn info: ", "--range-max is '0'"},
        {"cairn-arena", "cairn-arena: ", "scene"},
        {"cairn-arena atlantis -o @/refused", "cairn-arena: ", "'atlantis'"},
        {"cairn-arena rooms", "cairn-arena: ", "-o"},
        {"cairn-arena rooms maze -o @/refused", "cairn-arena: ", "'maze'"},
        {"cairn-arena rooms -o @/refused --speed 3", "cairn-arena: ", "'--speed'"},
        {"cairn-arena rooms -o @/refused --beams 1", "cairn-arena: ", "--beams"},
        {"cairn-arena rooms -o @/refused --beams 1e9", "cairn-arena: ", "--beams"},
        {"cairn-arena rooms -o @/refused --noise nan", "cairn-arena: ", "--noise"},
        {"cairn-arena rooms -o @/refused --size 10", "cairn-arena: ", "--size"},
        {"cairn-arena rooms -o @/refused --seed", "cairn-arena: ", "--seed"},
        {"cairn-arena rooms -o @/refused --size 2x2", "cairn-arena: ", "2"},
    };
    long long least = 0;
    outcome o;

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        assert_refused_from(programs_run("%s", sample[i].arguments), sample[i].start,
                            sample[i].piece);
        assert_int_equal(files_count_in("refused"), -1);
    }
    /* A pool of exactly the required size suffices. */
    o = programs_run("cairn align @/drive/scans.log -o @/just --steps 2 --pool 1K");
    assert_int_equal(o.code, 2);
    assert_int_equal(sscanf(strstr(o.err, "at least "), "at least %lld", &least), 1);
    o = programs_run("cairn align @/drive/scans.log -o @/just --steps 2 --pool %lld", least - 16);
    assert_int_equal(o.code, 2);
    o = programs_run("cairn align @/drive/scans.log -o @/just --steps 2 --pool %lld", least);
    assert_int_equal(o.code, 0);
}

/* ---- Output folders ---- */

static void assert_old(const char *folder)
{
    char *bytes = files_read(in_folder(folder, "map.svg"), NULL);

    assert_non_null(bytes);
    assert_string_equal(bytes, "old");
    free(bytes);
    assert_int_equal(files_count_in(folder), 1);
}

static void folders_that_cannot_be_written(void **state)
{
    outcome o;

    (void)state;
    (void)files_write_text("file", "kept");
    assert_refused_from(programs_run("cairn map @/drive/scans.log -o @/file"),
                        "/file: ", "is a file, expected a folder");
    assert_refused_from(programs_run("cairn align @/drive/scans.log -o @/file/inner"), "/file",
                        "is a file, expected a folder");
    assert_refused_from(programs_run("cairn-arena rooms -o @/file"), "cairn-arena: ", "expected");
    assert_int_equal(files_count_in("file"), -1);

    /* A folder has the name of a file to be written: nothing else is written either. */
    assert_int_equal(mkdir(files_path("taken"), 0777), 0);
    assert_int_equal(mkdir(files_path("taken/map.svg"), 0777), 0);
    assert_refused_from(programs_run("cairn map @/drive/scans.log -o @/taken"),
                        "/taken/map.svg: ", "is a folder, expected");
    assert_int_equal(files_count_in("taken"), 1);

    /* A page that cannot be written is reported before the work. */
    assert_refused_from(
        programs_run("cairn map @/drive/scans.log -o @/unpaged --report @/file/map.html"), "/file",
        "is a file, expected a folder");
    assert_refused_from(programs_run("cairn align @/drive/scans.log -o @/unpaged --report @/taken"),
                        "/taken: ", "is a folder, expected");
    assert_refused_from(programs_run("cairn map @/drive/scans.log -o @/unpaged --report @/taken/"),
                        "/taken/: ", "is a folder, expected the name of a page");
    assert_int_equal(files_count_in("unpaged"), -1);
    /* The disk is full: the map is complete, and the old file stays. */
    (void)files_write_text("kept.html", "kept");
    {
        char command[1024], *kept;

        (void)snprintf(command, sizeof command,
                       "cairn map '%s/drive/scans.log' --resolution 0.2 --quiet -o '%s/unpaged' "
                       "--report '%s/kept.html'",
                       files_folder, files_folder, files_folder);
        o = programs_run_shell("trap '' XFSZ; ulimit -f 80;", command, NULL);
        assert_int_equal(o.code, 2);
        assert_int_equal(lines_of(o.err), 1);
        assert_holds(o.err, "kept.html: cannot write: File too large\n");
        assert_int_equal(files_count_in("unpaged"), FILES + 2);
        kept = files_read(files_path("kept.html"), NULL);
        assert_string_equal(kept, "kept");
        free(kept);
    }

    if (geteuid() != 0) {
        assert_int_equal(mkdir(files_path("closed"), 0555), 0);
        o = programs_run("cairn map @/drive/scans.log -o @/closed");
        assert_int_equal(o.code, 2);
        assert_holds(o.err, "/closed: cannot write in this folder: Permission denied\n");
        o = programs_run("cairn-arena rooms -o @/closed");
        assert_int_equal(o.code, 2);
        assert_int_equal(files_count_in("closed"), 0);
    }

    /* The disk is full after the first file: the folder is unchanged, a new one does not exist. */
    assert_int_equal(mkdir(files_path("old"), 0777), 0);
    (void)files_write_text("old/map.svg", "old");
    for (int k = 0; k < 2; k++) {
        char command[1024];

        (void)snprintf(command, sizeof command, "cairn map '%s/drive/scans.log' --quiet -o '%s/%s'",
                       files_folder, files_folder, k == 0 ? "old" : "new/deep");
        o = programs_run_shell("trap '' XFSZ; ulimit -f 40;", command, NULL);
        assert_int_equal(o.code, 2);
        assert_int_equal(lines_of(o.err), 1);
        assert_holds(o.err, "map.pgm: cannot write: File too large\n");
        assert_old("old");
        assert_int_equal(files_count_in("new"), -1);
    }
}

/* A refused run leaves the files of an earlier one. */
static void a_refused_run_leaves_the_folder(void **state)
{
    static const char *const arguments[] = {
        "cairn map @/missing.log", "cairn align @/drive/scans.log --max-scans 3",
        "cairn map @/drive/scans.log --resolution 0.001", "cairn align @/blind.log",
        "cairn map @/large.log --max-keys 3"};

    (void)state;
    for (size_t i = 0; i < sizeof arguments / sizeof *arguments; i++) {
        outcome o = programs_run("%s -o @/old", arguments[i]);

        assert_int_equal(o.code, 2);
        assert_old("old");
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_xml_checker_sees_faults),
        cmocka_unit_test(make_arenas),
        cmocka_unit_test(same_seed_same_bytes),
        cmocka_unit_test(a_pose_for_every_scan),
        cmocka_unit_test(the_map_reads_back),
        cmocka_unit_test(pages),
        cmocka_unit_test(matches),
        cmocka_unit_test(matches_of_poor_scans),
        cmocka_unit_test(poses_of_a_log_are_not_used),
        cmocka_unit_test(matches_by_shape),
        cmocka_unit_test(beams_without_return_end_at_walls),
        cmocka_unit_test(names_of_logs_stay_text),
        cmocka_unit_test(quiet_and_pipes),
        cmocka_unit_test(files_of_other_runs_do_not_stay),
        cmocka_unit_test(maps_by_particles),
        cmocka_unit_test(help_and_version),
        cmocka_unit_test(a_damaged_scan_is_left_out),
        cmocka_unit_test(a_tenth_of_the_lines_is_damaged),
        cmocka_unit_test(tables_of_ranges_and_several_logs),
        cmocka_unit_test(damage_of_all_kinds_among_good_scans),
        cmocka_unit_test(aligned_as_written),
        cmocka_unit_test(a_log_without_walls),
        cmocka_unit_test(large_rooms_get_a_larger_window),
        cmocka_unit_test(scans_of_culled_keyframes_are_written),
        cmocka_unit_test(maps_without_loop_closure),
        cmocka_unit_test(poses_far_away),
        cmocka_unit_test(logs_that_are_none),
        cmocka_unit_test(scans_that_are_none),
        cmocka_unit_test(command_lines),
        cmocka_unit_test(folders_that_cannot_be_written),
        cmocka_unit_test(a_refused_run_leaves_the_folder),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
