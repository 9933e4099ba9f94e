/* The player's page: well-formed, its data decoded as the page decodes them, thinned to the limits,
 * the same bytes for the same calls, complete or absent. */
#include "tests/files.h"

#include <math.h>

#include "cairn/json_text.h"
#include "cairn/report.h"
#include "src/host/files/map_file_image.h"

/* ---- Decoding of a page ---- */

typedef struct bytes {
    uint8_t *data;
    size_t count, at;
} bytes;

typedef struct page {
    char *html, *data;
    char title[256], subtitle[256], step_name[64];
    int32_t connect, image, scans;
    double pose_unit, turn_unit, point_unit, mark_unit, region_radius;
    int64_t name[64];
    int32_t names;
    char note[8][256];
    int32_t notes;
    char curve[4][3][64];
    int32_t curves;
    int64_t step[1024];
    char label[1024][64];
    double value[1024][4];
    int32_t values[1024];
    int32_t frames;
    bytes points, walls, poses, marks, parts, links, png;
    double grid[5]; /* height, resolution, x, y, theta */
    int32_t grids;
} page;

static cairn_json_token next(cairn_json *json, cairn_json_kind kind)
{
    cairn_json_token token;
    cairn_file_error error;

    if (cairn_json_next(json, &token, &error) != CAIRN_OK)
        fail_msg("%s", error.text);
    if (kind != CAIRN_JSON_END)
        assert_int_equal(token.kind, kind);
    return token;
}

static double next_number(cairn_json *json)
{
    return next(json, CAIRN_JSON_NUMBER).number;
}

static void next_text(cairn_json *json, char *text, size_t size)
{
    cairn_json_token token = next(json, CAIRN_JSON_STRING);

    assert_true(cairn_json_copy(&token, text, size) < size);
}

static int digit_of(char c)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *found = c != '\0' ? strchr(digits, c) : NULL;

    assert_non_null(found);
    return (int)(found - digits);
}

static bytes next_bytes(cairn_json *json)
{
    cairn_json_token token = next(json, CAIRN_JSON_STRING);
    bytes b = {malloc(token.length + 1), 0, 0};

    assert_non_null(b.data);
    assert_int_equal(token.length % 4, 0);
    for (size_t i = 0; i < token.length; i += 4) {
        int pads = (token.text[i + 2] == '=') + (token.text[i + 3] == '=');
        uint32_t group = 0;

        assert_true(pads == 0 || i + 4 == token.length);
        for (size_t k = 0; k < 4; k++)
            group = group << 6 | (uint32_t)(k < 4 - (size_t)pads ? digit_of(token.text[i + k]) : 0);
        for (int k = 0; k < 3 - pads; k++)
            b.data[b.count++] = (uint8_t)(group >> (16 - 8 * k));
    }
    return b;
}

static uint64_t whole(bytes *b)
{
    uint64_t value = 0;
    int shift = 0;

    do {
        assert_true(b->at < b->count && shift < 64);
        value |= (uint64_t)(b->data[b->at] & 127) << shift;
        shift += 7;
    } while (b->data[b->at++] > 127);
    return value;
}

static int64_t signed_of(bytes *b)
{
    uint64_t value = whole(b);

    return value % 2 == 0 ? (int64_t)(value / 2) : -(int64_t)(value / 2) - 1;
}

static void read_frames(cairn_json *json, page *p)
{
    cairn_json_token token;

    (void)next(json, CAIRN_JSON_ARRAY);
    while ((token = next(json, CAIRN_JSON_END)).kind == CAIRN_JSON_OBJECT) {
        int32_t f = p->frames++;

        assert_true(f < 1024);
        while ((token = next(json, CAIRN_JSON_END)).kind == CAIRN_JSON_NAME) {
            if (cairn_json_is(&token, "step")) {
                p->step[f] = (int64_t)next_number(json);
            } else if (cairn_json_is(&token, "label")) {
                next_text(json, p->label[f], sizeof p->label[f]);
            } else {
                assert_int_equal(cairn_json_is(&token, "values"), 1);
                (void)next(json, CAIRN_JSON_ARRAY);
                while ((token = next(json, CAIRN_JSON_END)).kind != CAIRN_JSON_ARRAY_END) {
                    assert_true(token.kind == CAIRN_JSON_NUMBER || token.kind == CAIRN_JSON_NULL);
                    p->value[f][p->values[f]++] =
                        token.kind == CAIRN_JSON_NULL ? (double)NAN : token.number;
                }
            }
        }
    }
    assert_int_equal(token.kind, CAIRN_JSON_ARRAY_END);
}

static void read_curves(cairn_json *json, page *p)
{
    static const char *const fields[] = {"name", "unit", "note"};
    cairn_json_token token;

    (void)next(json, CAIRN_JSON_ARRAY);
    while ((token = next(json, CAIRN_JSON_END)).kind == CAIRN_JSON_OBJECT) {
        for (int i = 0; i < 3; i++) {
            token = next(json, CAIRN_JSON_NAME);
            assert_int_equal(cairn_json_is(&token, fields[i]), 1);
            next_text(json, p->curve[p->curves][i], sizeof p->curve[0][0]);
        }
        (void)next(json, CAIRN_JSON_OBJECT_END);
        p->curves++;
    }
}

static void read_grid(cairn_json *json, page *p)
{
    static const char *const fields[] = {"height", "resolution", "x", "y", "theta"};
    cairn_json_token token = next(json, CAIRN_JSON_END);

    if (token.kind == CAIRN_JSON_NULL)
        return;
    assert_int_equal(token.kind, CAIRN_JSON_OBJECT);
    p->grids++;
    for (int i = 0; i < 5; i++) {
        token = next(json, CAIRN_JSON_NAME);
        assert_int_equal(cairn_json_is(&token, fields[i]), 1);
        p->grid[i] = next_number(json);
    }
    token = next(json, CAIRN_JSON_NAME);
    assert_int_equal(cairn_json_is(&token, "png"), 1);
    p->png = next_bytes(json);
    (void)next(json, CAIRN_JSON_OBJECT_END);
}

/* One field of the data; 0 when it is not a list. */
static int read_list(cairn_json *json, const cairn_json_token *name, page *p)
{
    cairn_json_token token;

    if (cairn_json_is(name, "names")) {
        (void)next(json, CAIRN_JSON_ARRAY);
        while ((token = next(json, CAIRN_JSON_END)).kind == CAIRN_JSON_NUMBER)
            p->name[p->names++ % 64] = (int64_t)token.number;
    } else if (cairn_json_is(name, "notes")) {
        (void)next(json, CAIRN_JSON_ARRAY);
        while ((token = next(json, CAIRN_JSON_END)).kind == CAIRN_JSON_STRING)
            (void)cairn_json_copy(&token, p->note[p->notes++], sizeof p->note[0]);
    } else if (cairn_json_is(name, "curves")) {
        read_curves(json, p);
    } else if (cairn_json_is(name, "frames")) {
        read_frames(json, p);
    } else if (cairn_json_is(name, "grid")) {
        read_grid(json, p);
    } else {
        return 0;
    }
    return 1;
}

static void read_data(page *p)
{
    const struct {
        const char *name;
        double *number;
    } numbers[] = {{"pose_unit", &p->pose_unit},
                   {"turn_unit", &p->turn_unit},
                   {"point_unit", &p->point_unit},
                   {"mark_unit", &p->mark_unit},
                   {"region_radius", &p->region_radius}};
    const struct {
        const char *name;
        bytes *stream;
    } streams[] = {{"points", &p->points}, {"walls", &p->walls}, {"poses", &p->poses},
                   {"marks", &p->marks},   {"parts", &p->parts}, {"links", &p->links}};
    cairn_json json = cairn_json_begin("data", p->data, strlen(p->data));
    cairn_json_token token;
    int fields = 0;

    (void)next(&json, CAIRN_JSON_OBJECT);
    while ((token = next(&json, CAIRN_JSON_END)).kind == CAIRN_JSON_NAME) {
        int known = read_list(&json, &token, p);

        for (size_t i = 0; i < 6 && !known; i++) {
            if (i < 5 && (known = cairn_json_is(&token, numbers[i].name)) != 0)
                *numbers[i].number = next_number(&json);
            else if ((known = cairn_json_is(&token, streams[i].name)) != 0)
                *streams[i].stream = next_bytes(&json);
        }
        fields++;
        if (known)
            continue;
        if (cairn_json_is(&token, "title"))
            next_text(&json, p->title, sizeof p->title);
        else if (cairn_json_is(&token, "subtitle"))
            next_text(&json, p->subtitle, sizeof p->subtitle);
        else if (cairn_json_is(&token, "step_name"))
            next_text(&json, p->step_name, sizeof p->step_name);
        else if (cairn_json_is(&token, "connect"))
            p->connect = next(&json, CAIRN_JSON_END).kind == CAIRN_JSON_TRUE;
        else if (cairn_json_is(&token, "image"))
            p->image = (int32_t)next_number(&json);
        else if (cairn_json_is(&token, "scans"))
            p->scans = (int32_t)next_number(&json);
        else
            fail_msg("a field that nothing reads: %.*s", (int)token.length, token.text);
    }
    assert_int_equal(fields, 21 + (p->image > 0));
    assert_int_equal(next(&json, CAIRN_JSON_END).kind, CAIRN_JSON_END);
}

/* Elements close in order, attributes are quoted; the text of scripts and styles is skipped. */
static void assert_well_formed(const char *html)
{
    char open[32][32];
    int depth = 0;

    assert_int_equal(strncmp(html, "<!DOCTYPE html>\n", 16), 0);
    html += 16;
    while ((html = strchr(html, '<')) != NULL) {
        const char *end = strchr(html, '>');
        size_t name;
        int quotes = 0;

        assert_non_null(end);
        for (const char *c = html + 1; c < end; c++) {
            assert_true(*c != '<' && *c != '\'');
            quotes += *c == '"';
        }
        assert_int_equal(quotes % 2, 0);
        if (html[1] == '/') {
            name = strcspn(html + 2, " >");
            assert_true(depth > 0);
            depth--;
            if (strlen(open[depth]) != name || memcmp(open[depth], html + 2, name) != 0)
                fail_msg("</%.*s> closes <%s>", (int)name, html + 2, open[depth]);
        } else if (end[-1] != '/') {
            name = strcspn(html + 1, " >");
            assert_true(depth < 32 && name < 32);
            memcpy(open[depth], html + 1, name);
            open[depth][name] = '\0';
            if (strcmp(open[depth], "script") == 0)
                end = strstr(end, "</script>") - 1;
            else if (strcmp(open[depth], "style") == 0)
                end = strstr(end, "</style>") - 1;
            depth++;
        }
        html = end + 1;
    }
    assert_int_equal(depth, 0);
}

static page *read_page(const char *path)
{
    static const char start[] = "<script type=\"application/json\" id=\"data\">\n";
    page *p = calloc(1, sizeof *p);
    char *data, *end;

    assert_non_null(p);
    p->html = files_read(path, NULL);
    assert_non_null(p->html);
    assert_well_formed(p->html);
    /* Nothing of the network. */
    assert_null(strstr(p->html, "http"));
    assert_null(strstr(p->html, " src="));
    assert_null(strstr(p->html, "@data@"));
    assert_null(strstr(p->html, "@title@"));
    data = strstr(p->html, start);
    assert_non_null(data);
    data += strlen(start);
    end = strstr(data, "</script>");
    assert_non_null(end);
    assert_null(memchr(data, '<', (size_t)(end - data)));
    p->data = malloc((size_t)(end - data) + 1);
    assert_non_null(p->data);
    memcpy(p->data, data, (size_t)(end - data));
    p->data[end - data] = '\0';
    read_data(p);
    return p;
}

/* Hash of all calls that make the page. */
#define assert_data(p, in_double, in_float)                                                        \
    assert_golden(test_hash(TEST_HASH_START, (p)->data, strlen((p)->data)), UINT64_C(in_double),   \
                  UINT64_C(in_float))

static void free_page(page *p)
{
    free(p->html);
    free(p->data);
    free(p->points.data);
    free(p->walls.data);
    free(p->poses.data);
    free(p->marks.data);
    free(p->parts.data);
    free(p->links.data);
    free(p->png.data);
    free(p);
}

static page *write_page(const cairn_report_player *player)
{
    cairn_file_error error;
    const char *path = files_path("page.html");

    if (cairn_report_player_write(player, path, &error) != CAIRN_OK)
        fail_msg("%s", error.text);
    return read_page(path);
}

/* ---- Records ---- */

static cairn_report_player *open_player(const cairn_report_player_params *params)
{
    cairn_report_player *player = NULL;

    assert_ok(cairn_report_player_open(&player, params));
    assert_non_null(player);
    return player;
}

static void add_scans(cairn_report_player *player, int32_t count)
{
    cairn_report_scan scan;

    memset(&scan, 0, sizeof scan);
    for (int32_t i = 0; i < count; i++)
        assert_ok(cairn_report_player_add_scan(player, &scan, i));
}

static cairn_status add_poses(cairn_report_player *player, int64_t step, const cairn_pose *pose,
                              int32_t count)
{
    cairn_report_frame frame;

    memset(&frame, 0, sizeof frame);
    frame.step = step;
    frame.pose = pose;
    frame.pose_count = count;
    return cairn_report_player_add_frame(player, &frame);
}

/* Decodes the next frame's poses from the stream and those of the frame before. */
static int32_t next_poses(page *p, int64_t (*pose)[3], int32_t before)
{
    int32_t count = (int32_t)whole(&p->poses), i = 0;

    while (i < count) {
        i += (int32_t)whole(&p->poses);
        for (uint64_t left = whole(&p->poses); left > 0; left--, i++) {
            assert_true(i < count);
            for (int c = 0; c < 3; c++)
                pose[i][c] = (i < before ? pose[i][c]
                              : i > 0    ? pose[i - 1][c]
                                         : 0) +
                             signed_of(&p->poses);
        }
    }
    assert_int_equal(i, count);
    return count;
}

static void test_texts(void **state)
{
    static const cairn_report_curve curves[] = {{"potential \"P\"", "m", "a\nnote"},
                                                {"<b>", NULL, NULL}};
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player;
    page *p;

    (void)state;
    params.title = "a</script><b>\"&\\\x01 \xC3\xA9 \xFF \xE2\x82";
    params.subtitle = "\xED\xA0\x80|\xC0\x80|\xF0\x80\x80\x80|\xF4\x90\x80\x80|\xE0\x80\x80|\xF5|"
                      "\xF0\x9F\x98\x80";
    params.step_name = "scan";
    params.curve = curves;
    params.curve_count = 2;
    params.connect = 1;
    params.image = 3;
    params.region_radius = CAIRN_REAL(0.25);
    player = open_player(&params);
    assert_ok(add_poses(player, -3, NULL, 0));
    p = write_page(player);
    assert_string_equal(p->title,
                        "a</script><b>\"&\\\x01 \xC3\xA9 \xEF\xBF\xBD \xEF\xBF\xBD\xEF\xBF\xBD");
    assert_non_null(strstr(p->html, "<title>\na&lt;/script&gt;&lt;b&gt;&quot;&amp;\\ \xC3\xA9 "
                                    "\xEF\xBF\xBD \xEF\xBF\xBD\xEF\xBF\xBD</title>"));
#define BAD "\xEF\xBF\xBD"
    assert_string_equal(p->subtitle, BAD BAD BAD "|" BAD BAD "|" BAD BAD BAD BAD "|" BAD BAD BAD BAD
                                                 "|" BAD BAD BAD "|" BAD "|\xF0\x9F\x98\x80");
    assert_string_equal(p->step_name, "scan");
    assert_int_equal(p->connect, 1);
    assert_int_equal(p->image, 3);
    assert_near(p->region_radius, 0.25, 0);
    assert_near(p->pose_unit, 1e-4, 0);
    assert_near(p->turn_unit, 1e-5, 0);
    assert_near(p->point_unit, 2e-3, 0);
    assert_near(p->mark_unit, 5e-3, 0);
    assert_int_equal(p->curves, 2);
    assert_string_equal(p->curve[0][0], "potential \"P\"");
    assert_string_equal(p->curve[0][1], "m");
    assert_string_equal(p->curve[0][2], "a\nnote");
    assert_string_equal(p->curve[1][0], "<b>");
    assert_string_equal(p->curve[1][1], "");
    assert_int_equal(p->frames, 1);
    assert_int_equal(p->step[0], -3);
    assert_string_equal(p->label[0], "");
    assert_int_equal(p->values[0], 2);
    assert_true(isnan(p->value[0][0]) && isnan(p->value[0][1]));
    assert_int_equal(p->notes, 0);
    assert_int_equal(p->scans, 0);
    assert_int_equal(p->grids, 0);
    free_page(p);
    cairn_report_player_free(player);

    params = cairn_report_player_default();
    player = open_player(&params);
    assert_ok(add_poses(player, 0, NULL, 0));
    p = write_page(player);
    assert_string_equal(p->title, "");
    assert_string_equal(p->step_name, "step");
    assert_int_equal(p->connect, 0);
    assert_int_equal(p->image, 0);
    assert_int_equal(p->values[0], 0);
    free_page(p);
    cairn_report_player_free(player);
}

static void test_scans(void **state)
{
    cairn_vec2 point[3] = {
        {1, 2}, {CAIRN_REAL(1.1), CAIRN_REAL(-3.0031)}, {CAIRN_REAL(-1000.0), 0}};
    cairn_segment segment[2] = {{{0, 1}, {2, 3}}, {{2, 3}, {-4, CAIRN_REAL(0.5)}}};
    static const double walls[8] = {0, 1, 2, 3, 2, 3, -4, 0.5};
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player = open_player(&params);
    cairn_report_scan scan = {point, segment, 3, 2}, empty = {NULL, NULL, 0, 0},
                      one = {point, NULL, 1, 0};
    int64_t x = 0, y = 0;
    page *p;

    (void)state;
    assert_ok(cairn_report_player_add_scan(player, &scan, 5));
    assert_ok(cairn_report_player_add_scan(player, &empty, 7));
    assert_ok(cairn_report_player_add_scan(player, &one, INT64_C(1) << 40));
    assert_ok(add_poses(player, 0, NULL, 0));
    p = write_page(player);
    assert_int_equal(p->scans, 3);
    assert_int_equal(p->names, 3);
    assert_int_equal(p->name[0], 5);
    assert_int_equal(p->name[1], 7);
    assert_int_equal(p->name[2], INT64_C(1) << 40);
    assert_int_equal(whole(&p->points), 3);
    for (int i = 0; i < 3; i++) {
        x += signed_of(&p->points);
        y += signed_of(&p->points);
        assert_near((double)x * p->point_unit, point[i].x, p->point_unit / 2 + NUMBER(1e-9, 1e-4));
        assert_near((double)y * p->point_unit, point[i].y, p->point_unit / 2 + NUMBER(1e-9, 1e-4));
    }
    assert_int_equal(whole(&p->points), 0);
    assert_int_equal(whole(&p->points), 1);
    assert_int_equal(signed_of(&p->points), 500);
    assert_int_equal(signed_of(&p->points), 1000);
    assert_int_equal(p->points.at, p->points.count);
    assert_int_equal(whole(&p->walls), 2);
    x = y = 0;
    for (int i = 0; i < 4; i++) {
        x += signed_of(&p->walls);
        y += signed_of(&p->walls);
        assert_near((double)x * p->point_unit, walls[2 * i], 1e-9);
        assert_near((double)y * p->point_unit, walls[2 * i + 1], 1e-9);
    }
    assert_int_equal(whole(&p->walls), 0);
    assert_int_equal(whole(&p->walls), 0);
    assert_int_equal(p->walls.at, p->walls.count);
    assert_data(p, 0x7fd2a256e5701b62, 0x7fd2a256e5701b62);
    free_page(p);
    cairn_report_player_free(player);
}

/* Poses of every frame are decoded to half a unit; those at rest take two bytes a run. */
static void test_poses(void **state)
{
    enum { SCANS = 40, FRAMES = 30 };
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player = open_player(&params);
    cairn_random random = cairn_random_seed(3, 0);
    cairn_pose pose[FRAMES][SCANS];
    int32_t count[FRAMES], known = 0;
    int64_t got[SCANS][3];
    page *p;

    (void)state;
    memset(pose, 0, sizeof pose);
    add_scans(player, SCANS);
    for (int f = 0; f < FRAMES; f++) {
        /* It grows, shrinks once, and ends with a frame in which nothing moves. */
        count[f] = f == FRAMES - 1 ? count[f - 1] : f == 20 ? 3 : f * 2 < SCANS ? f * 2 : SCANS;
        for (int i = 0; i < count[f]; i++) {
            int moves = f < FRAMES - 1 && cairn_random_below(&random, 3) > 0;

            if (f > 0)
                pose[f][i] = pose[f - 1][i];
            if (moves || f == 0 || i >= count[f - 1]) {
                pose[f][i].x = cairn_random_uniform(&random, -100, 100);
                pose[f][i].y = cairn_random_uniform(&random, -1, 1);
                pose[f][i].theta = cairn_random_uniform(&random, -3, 3);
            }
        }
        assert_ok(add_poses(player, 10 * f, pose[f], count[f]));
    }
    p = write_page(player);
    assert_int_equal(p->frames, FRAMES);
    for (int f = 0; f < FRAMES; f++) {
        size_t before = p->poses.at;

        assert_int_equal(p->step[f], 10 * f);
        known = next_poses(p, got, known);
        assert_int_equal(known, count[f]);
        for (int i = 0; i < known; i++) {
            assert_int_equal(got[i][0], llrint((double)pose[f][i].x / p->pose_unit));
            assert_int_equal(got[i][1], llrint((double)pose[f][i].y / p->pose_unit));
            assert_int_equal(got[i][2], llrint((double)pose[f][i].theta / p->turn_unit));
        }
        if (f == FRAMES - 1)
            assert_int_equal(p->poses.at - before, 3);
    }
    assert_int_equal(p->poses.at, p->poses.count);
    assert_data(p, 0x743def99716285f9, 0x1f9d3e8a108c242e);
    free_page(p);
    cairn_report_player_free(player);
}

/* The farthest accepted pose is exact, and small steps from it. */
static void test_far_poses(void **state)
{
    cairn_pose pose[2] = {{CAIRN_REAL(-1e9), CAIRN_REAL(1e9), CAIRN_REAL(-1e9)},
                          {CAIRN_REAL(-1e9), 5, 1}};
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player = open_player(&params);
    int64_t got[2][3];
    page *p;

    (void)state;
    add_scans(player, 2);
    assert_ok(add_poses(player, 0, pose, 2));
    p = write_page(player);
    assert_int_equal(next_poses(p, got, 0), 2);
    assert_int_equal(got[0][0], INT64_C(-10000000000000));
    assert_int_equal(got[0][1], INT64_C(10000000000000));
    assert_int_equal(got[0][2], INT64_C(-100000000000000));
    assert_int_equal(got[1][0], INT64_C(-10000000000000));
    assert_int_equal(got[1][1], 50000);
    assert_int_equal(got[1][2], 100000);
    free_page(p);
    cairn_report_player_free(player);
}

static void test_marks(void **state)
{
    static const cairn_report_curve curves[] = {{"a", "", ""}, {"b", "", ""}, {"c", "", ""}};
    static const uint8_t low_confidence[5] = {0, 1, 0, 0, 2};
    static const cairn_vec2 region[2] = {{1, -2}, {CAIRN_REAL(1.05), 3}};
    static const cairn_report_force force[4] = {
        {{0, 1}, {0, 2}}, {{1, 1}, {-4, 0}}, {{1, 0}, {0, 0}}, {{2, 2}, {1, -1}}};
    static const cairn_report_hypothesis guess[2] = {
        {{{1, 2}, {3, CAIRN_REAL(-1.5)}}, CAIRN_REAL(0.5)}, {{{0, 0}, {1, 2}}, 1}};
    static const int64_t ends[8] = {200, 400, 600, -300, 0, 0, 200, 400};
    static const uint64_t turns[4] = {32, 64, 0, 112}, sizes[4] = {64, 127, 0, 45};
    static const double at[8] = {0, 1, 1, 1, 1, 0, 2, 2};
    double value[3] = {-0.125, (double)INFINITY, 1e300};
    cairn_pose pose[5];
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player;
    cairn_report_frame frame;
    int64_t x = 0, y = 0;
    page *p;

    (void)state;
    params.curve = curves;
    params.curve_count = 3;
    player = open_player(&params);
    add_scans(player, 5);
    memset(pose, 0, sizeof pose);
    memset(&frame, 0, sizeof frame);
    frame.label = "\xCF\x83 0.1 m";
    frame.pose = pose;
    frame.pose_count = 5;
    frame.low_confidence = low_confidence;
    frame.value = value;
    frame.region = region;
    frame.region_count = 2;
    frame.force = force;
    frame.force_count = 4;
    frame.hypothesis = guess;
    frame.hypothesis_count = 2;
    assert_ok(cairn_report_player_add_frame(player, &frame));
    assert_ok(add_poses(player, 1, pose, 5));
    p = write_page(player);
    assert_string_equal(p->label[0], "\xCF\x83 0.1 m");
    assert_int_equal(p->values[0], 3);
    assert_near(p->value[0][0], -0.125, 0);
    assert_true(isnan(p->value[0][1]));
    if (sizeof(cairn_real) > 4)
        assert_near(p->value[0][2], 1e300, 0);
    assert_int_equal(whole(&p->marks), 2);
    assert_int_equal(whole(&p->marks), 1);
    assert_int_equal(whole(&p->marks), 3);
    assert_int_equal(whole(&p->marks), 2);
    assert_int_equal(signed_of(&p->marks), 200);
    assert_int_equal(signed_of(&p->marks), -400);
    assert_int_equal(signed_of(&p->marks), 10);
    assert_int_equal(signed_of(&p->marks), 1000);
    assert_int_equal(whole(&p->marks), 4);
    for (int i = 0; i < 4; i++) {
        x += signed_of(&p->marks);
        y += signed_of(&p->marks);
        assert_near((double)x * p->mark_unit, at[2 * i], 1e-9);
        assert_near((double)y * p->mark_unit, at[2 * i + 1], 1e-9);
        assert_int_equal(whole(&p->marks), turns[i]);
        assert_int_equal(whole(&p->marks), sizes[i]);
    }
    assert_int_equal(whole(&p->marks), 2);
    x = y = 0;
    for (int i = 0; i < 8; i += 2) {
        x += signed_of(&p->marks);
        y += signed_of(&p->marks);
        assert_int_equal(x, ends[i]);
        assert_int_equal(y, ends[i + 1]);
        if (i == 2 || i == 6)
            assert_int_equal(whole(&p->marks), i == 2 ? 64 : 127);
    }
    for (int i = 0; i < 4; i++)
        assert_int_equal(whole(&p->marks), 0);
    assert_int_equal(p->marks.at, p->marks.count);
    assert_data(p, 0x0174a883f880b1e3, 0xc65ecbac80e7012e);
    free_page(p);
    cairn_report_player_free(player);
}

/* Components are stored where they change, between kept frames. */
static void test_parts(void **state)
{
    static const int32_t part[4][4] = {{-1, 1, 1, -1}, {3, 3, 3, 3}, {-1, 1, 1, 3}, {0, 0, 0, 0}};
    static const int32_t count[4] = {4, 4, 3, 4};
    /* Frames 0, 2, 3 are kept; frame 2 has three scans, so the fourth is in no component there. */
    static const uint64_t expected[] = {2, 1, 2, 1, 2, 0, 4, 0, 1, 1, 1, 1, 1, 1, 1};
    static const uint64_t last[] = {2, 1, 2, 1, 2, 0, 2, 1, 0, 1, 0};
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player;
    cairn_pose pose[4];
    cairn_report_frame frame;
    page *p;

    (void)state;
    params.max_frames = 3;
    player = open_player(&params);
    add_scans(player, 4);
    memset(pose, 0, sizeof pose);
    memset(&frame, 0, sizeof frame);
    frame.pose = pose;
    for (int f = 0; f < 4; f++) {
        frame.step = f;
        frame.submap = part[f];
        frame.pose_count = count[f];
        assert_ok(cairn_report_player_add_frame(player, &frame));
    }
    p = write_page(player);
    assert_int_equal(p->frames, 3);
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        assert_int_equal(whole(&p->parts), expected[i]);
    assert_int_equal(p->parts.at, p->parts.count);
    assert_data(p, 0x53e5a226c8c2e96d, 0x53e5a226c8c2e96d);
    free_page(p);
    /* No components any more, and frame 3 is removed. */
    assert_ok(add_poses(player, 4, pose, 4));
    p = write_page(player);
    for (size_t i = 0; i < sizeof last / sizeof *last; i++)
        assert_int_equal(whole(&p->parts), last[i]);
    assert_int_equal(p->parts.at, p->parts.count);
    free_page(p);
    cairn_report_player_free(player);
}

/* A loop closure is shown from the first frame kept after it was added. */
static void test_links(void **state)
{
    static const uint64_t expected[] = {3, 0, 0, 1, 1, 1, 1, 2, 0, 3, 2, 0, 1};
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player;
    page *p;

    (void)state;
    params.max_frames = 3;
    player = open_player(&params);
    add_scans(player, 3);
    assert_ok(cairn_report_player_add_link(player, 0, 1, 5));
    for (int f = 0; f < 7; f++) {
        if (f == 1) /* of the frames 0, 4 and 6 */
            assert_ok(cairn_report_player_add_link(player, 1, 2, 0));
        assert_ok(add_poses(player, f, NULL, 0));
    }
    assert_ok(cairn_report_player_add_link(player, 2, 0, 1));
    assert_status(cairn_report_player_add_link(player, -1, 0, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_add_link(player, 0, -1, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_add_link(player, 3, 0, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_add_link(player, 0, 3, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_add_link(NULL, 0, 0, 1), CAIRN_BAD_ARGUMENT);
    p = write_page(player);
    assert_int_equal(p->frames, 3);
    assert_int_equal(p->step[1], 4);
    assert_int_equal(p->step[2], 6);
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        assert_int_equal(whole(&p->links), expected[i]);
    assert_int_equal(p->links.at, p->links.count);
    assert_data(p, 0xa4875d529441c313, 0xa4875d529441c313);
    free_page(p);
    cairn_report_player_free(player);
}

static void test_grid(void **state)
{
    uint8_t pixel[6] = {0, 1, 2, 3, 4, 5}, turned[6] = {3, 4, 5, 0, 1, 2}, *png, *wide;
    cairn_report_grid grid = {pixel, 3, 2, CAIRN_REAL(0.5), {1, -2, CAIRN_REAL(0.25)}};
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player = open_player(&params);
    size_t count;
    page *p;

    (void)state;
    assert_ok(add_poses(player, 0, NULL, 0));
    assert_ok(cairn_report_player_set_grid(player, &grid));
    p = write_page(player);
    assert_int_equal(p->grids, 1);
    assert_near(p->grid[0], 2, 0);
    assert_near(p->grid[1], 0.5, 0);
    assert_near(p->grid[2], 1, 0);
    assert_near(p->grid[3], -2, 0);
    assert_near(p->grid[4], 0.25, 0);
    assert_ok(cairn_image_encode_png(&png, &count, turned, 3, 2, 1));
    assert_int_equal(p->png.count, count);
    assert_memory_equal(p->png.data, png, count);
    free(png);
    free_page(p);

    /* A refused grid leaves the last one; a later one replaces it, coarser when it is large. */
    grid.width = 0;
    assert_status(cairn_report_player_set_grid(player, &grid), CAIRN_BAD_ARGUMENT);
    grid.width = 3;
    grid.height = 0;
    assert_status(cairn_report_player_set_grid(player, &grid), CAIRN_BAD_ARGUMENT);
    grid.height = 2;
    grid.resolution = 0;
    assert_status(cairn_report_player_set_grid(player, &grid), CAIRN_BAD_ARGUMENT);
    grid.resolution = (cairn_real)NAN;
    assert_status(cairn_report_player_set_grid(player, &grid), CAIRN_BAD_ARGUMENT);
    grid.resolution = (cairn_real)INFINITY;
    assert_status(cairn_report_player_set_grid(player, &grid), CAIRN_BAD_ARGUMENT);
    grid.resolution = 1;
    grid.origin.theta = (cairn_real)NAN;
    assert_status(cairn_report_player_set_grid(player, &grid), CAIRN_NOT_FINITE);
    grid.origin.theta = 0;
    grid.pixel = NULL;
    assert_status(cairn_report_player_set_grid(player, &grid), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_set_grid(player, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_set_grid(NULL, &grid), CAIRN_BAD_ARGUMENT);
    p = write_page(player);
    assert_near(p->grid[1], 0.5, 0);
    free_page(p);
    wide = calloc(1, 5000);
    assert_non_null(wide);
    grid.pixel = wide;
    grid.width = 5000;
    grid.height = 1;
    assert_ok(cairn_report_player_set_grid(player, &grid));
    p = write_page(player);
    assert_near(p->grid[0], 1, 0);
    assert_near(p->grid[1], 3, 0);
    free_page(p);
    free(wide);
    cairn_report_player_free(player);
}

/* ---- Thinning ---- */

/* The kept frames of `count`: multiples of the least power of two that leaves few enough, and the
 * last. Poses per frame are `each`. */
static int32_t reference_stride(int32_t count, int32_t frames_most, int64_t poses_most,
                                int64_t each)
{
    int32_t stride = 1;

    for (;; stride *= 2) {
        int32_t kept = (count - 1) / stride + 1 + ((count - 1) % stride != 0);

        if (kept <= 2 || (kept <= frames_most && kept * each <= poses_most))
            return stride;
    }
}

static void test_thinned_frames(void **state)
{
    static const struct {
        int32_t count, most;
        int64_t poses;
    } cases[] = {{5, 5, 100},         {6, 5, 100},     {7, 5, 100},   {1000, 5, 1000},
                 {5000, 600, 100000}, {1000, 2, 1000}, {100, 50, 60}, {100, 50, 2},
                 {513, 512, 9999},    {1, 2, 2},       {2, 2, 2},     {3, 2, 2}};
    cairn_pose pose[3];

    (void)state;
    memset(pose, 0, sizeof pose);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        cairn_report_player_params params = cairn_report_player_default();
        cairn_report_player *player;
        int32_t stride = 1, f = 0;
        page *p;

        params.max_frames = cases[k].most;
        params.max_poses = cases[k].poses;
        player = open_player(&params);
        add_scans(player, 3);
        for (int32_t i = 0; i < cases[k].count; i++) {
            int32_t now = reference_stride(i + 1, cases[k].most, cases[k].poses, 3);

            assert_ok(add_poses(player, i, pose, 3));
            stride = now > stride ? now : stride;
        }
        p = write_page(player);
        for (int32_t i = 0; i < cases[k].count; i++)
            if (i % stride == 0 || i == cases[k].count - 1)
                assert_int_equal(p->step[f++], i);
        assert_int_equal(p->frames, f);
        if (stride == 1) {
            assert_int_equal(p->notes, 0);
        } else {
            char note[128];

            (void)snprintf(note, sizeof note, "%d of %d frames are shown: every %d%s and the last.",
                           (int)f, (int)cases[k].count, (int)stride,
                           stride % 10 == 2 && stride % 100 != 12 ? "nd" : "th");
            assert_int_equal(p->notes, 1);
            assert_string_equal(p->note[0], note);
        }
        free_page(p);
        cairn_report_player_free(player);
    }
}

static void test_thinned_points(void **state)
{
    enum { EACH = 11 };
    cairn_vec2 point[EACH], region[EACH];
    cairn_segment segment[EACH];
    cairn_report_force force[EACH];
    cairn_report_hypothesis guess[EACH];
    cairn_report_scan scan = {point, segment, EACH, EACH};
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player;
    cairn_report_frame frame;
    int64_t at = 0;
    page *p;

    (void)state;
    for (int i = 0; i < EACH; i++) {
        point[i].x = (cairn_real)i;
        point[i].y = 0;
        segment[i].a = segment[i].b = region[i] = point[i];
        force[i].at = force[i].force = point[i];
        guess[i].segment = segment[i];
        guess[i].strength = 0;
    }
    memset(&frame, 0, sizeof frame);
    frame.hypothesis = guess;
    frame.hypothesis_count = EACH;
    frame.region = region;
    frame.region_count = EACH;
    frame.force = force;
    frame.force_count = EACH - 1;
    params.max_points = 9;  /* of 22: every 3rd */
    params.max_forces = 10; /* of 20 forces every 2nd, of 22 regions every 3rd */
    player = open_player(&params);
    for (int i = 0; i < 2; i++) {
        assert_ok(cairn_report_player_add_scan(player, &scan, i));
        frame.step = i;
        assert_ok(cairn_report_player_add_frame(player, &frame));
    }
    p = write_page(player);
    assert_int_equal(p->notes, 5);
    assert_string_equal(p->note[4], "Every 3rd of 22 hypotheses' sides is shown.");
    assert_string_equal(p->note[0], "Every 3rd of 22 points is shown.");
    assert_string_equal(p->note[1], "Every 3rd of 22 walls is shown.");
    assert_string_equal(p->note[2], "Every 2nd of 20 forces is shown.");
    assert_string_equal(p->note[3], "Every 3rd of 22 regions is shown.");
    for (int i = 0; i < 2; i++) {
        int64_t x = 0, wall = 0;

        /* Points 0, 3, 6, 9 of the first, 1, 4, 7, 10 of the second scan: every third through
         * both. */
        assert_int_equal(whole(&p->points), 4);
        assert_int_equal(whole(&p->walls), 4);
        for (int k = 0; k < 4; k++, at += 3) {
            x += signed_of(&p->points);
            assert_int_equal(signed_of(&p->points), 0);
            assert_int_equal(x, 500 * (at - EACH * i));
            wall += signed_of(&p->walls);
            assert_int_equal(wall, x);
            for (int n = 0; n < 3; n++)
                assert_int_equal(signed_of(&p->walls), 0);
        }
        assert_int_equal(whole(&p->marks), 0);
        assert_int_equal(whole(&p->marks), 4);
        for (int k = 0; k < 4; k++) {
            assert_int_equal(signed_of(&p->marks), k > 0 ? 600 : 0);
            assert_int_equal(signed_of(&p->marks), 0);
        }
        assert_int_equal(whole(&p->marks), 5);
        for (int k = 0; k < 5; k++) {
            assert_int_equal(signed_of(&p->marks), k > 0 ? 400 : 0);
            assert_int_equal(signed_of(&p->marks), 0);
            assert_int_equal(whole(&p->marks), 0);
            assert_int_equal(whole(&p->marks), llrint(127.0 * 2 * k / 9));
        }
        assert_int_equal(whole(&p->marks), 4);
        for (int k = 0; k < 4; k++) {
            assert_int_equal(signed_of(&p->marks), k > 0 ? 600 : 0);
            for (int n = 0; n < 4; n++)
                assert_int_equal(whole(&p->marks), 0);
        }
    }
    assert_int_equal(p->points.at, p->points.count);
    assert_int_equal(p->walls.at, p->walls.count);
    assert_int_equal(p->marks.at, p->marks.count);
    assert_data(p, 0x0acfdee1ee7fff94, 0x0acfdee1ee7fff94);
    free_page(p);
    cairn_report_player_free(player);
}

/* A whole log: a page of a few MB, however long the log. */
static void test_whole_log(void **state)
{
    enum { SCANS = 3000, POINTS = 100, FRAMES = 3000 };
    cairn_vec2 *point = calloc(POINTS, sizeof *point);
    cairn_pose *pose = calloc(SCANS, sizeof *pose);
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player = open_player(&params);
    cairn_random random = cairn_random_seed(1, 0);
    cairn_report_scan scan = {point, NULL, POINTS, 0};
    page *p;

    (void)state;
    assert_true(point != NULL && pose != NULL);
    for (int i = 0; i < SCANS; i++) {
        for (int k = 0; k < POINTS; k++) {
            point[k].x = cairn_random_uniform(&random, -8, 8);
            point[k].y = cairn_random_uniform(&random, -8, 8);
        }
        assert_ok(cairn_report_player_add_scan(player, &scan, i));
        pose[i].x = cairn_random_uniform(&random, -50, 50);
        /* The last ten move. */
        for (int k = i > 9 ? i - 9 : 0; k <= i; k++)
            pose[k].y += cairn_random_uniform(&random, CAIRN_REAL(-0.01), CAIRN_REAL(0.01));
        assert_ok(add_poses(player, i, pose, i + 1));
    }
    p = write_page(player);
    assert_in_range(p->frames, 300, 600);
    assert_int_equal(p->step[p->frames - 1], FRAMES - 1);
    assert_true(strlen(p->html) < 3000000);
    assert_int_equal(p->notes, 2);
    assert_string_equal(p->note[1], "Every 2nd of 300000 points is shown.");
    assert_data(p, 0x51c4e65d647c32b4, 0xc04a26f01211bfd0);
    free_page(p);
    cairn_report_player_free(player);
    free(point);
    free(pose);
}

/* ---- Files and refusals ---- */

static void test_same_bytes(void **state)
{
    char *html[2];
    size_t count[2];

    (void)state;
    for (int run = 0; run < 2; run++) {
        cairn_report_player_params params = cairn_report_player_default();
        cairn_report_player *player = open_player(&params);
        cairn_pose pose[2] = {{1, 2, 3}, {4, 5, CAIRN_REAL(0.5)}};
        cairn_file_error error;

        add_scans(player, 2);
        assert_ok(add_poses(player, 0, pose, 2));
        pose[1].x += 1;
        assert_ok(add_poses(player, 1, pose, 2));
        assert_ok(cairn_report_player_write(player, files_path("same.html"), &error));
        /* Writing changes nothing. */
        assert_ok(cairn_report_player_write(player, files_path("same.html"), &error));
        html[run] = files_read(files_path("same.html"), &count[run]);
        cairn_report_player_free(player);
    }
    assert_int_equal(count[0], count[1]);
    assert_memory_equal(html[0], html[1], count[0]);
    free(html[0]);
    free(html[1]);
}

static void test_write_failures(void **state)
{
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player = open_player(&params);
    cairn_file_error error;
    char *kept;
    int before = files_count();

    (void)state;
    assert_status(cairn_report_player_write(player, files_path("none.html"), &error), CAIRN_EMPTY);
    assert_non_null(strstr(error.text, "no frame to show, expected at least one"));
    assert_ok(add_poses(player, 0, NULL, 0));
    assert_status(cairn_report_player_write(player, files_path("missing/page.html"), &error),
                  CAIRN_IO);
    assert_status(cairn_report_player_write(player, files_folder, &error), CAIRN_IO);
    assert_status(cairn_report_player_write(player, "/dev/full", &error), CAIRN_IO);
    assert_int_equal(files_count(), before);
    (void)files_write_text("kept.html", "kept");
    params.max_frames = 2;
    assert_int_equal(chmod(files_path("kept.html"), 0444), 0);
    assert_ok(cairn_report_player_write(player, files_path("kept.html"), &error));
    kept = files_read(files_path("kept.html"), NULL);
    assert_well_formed(kept);
    free(kept);
    cairn_report_player_free(player);
    cairn_report_player_free(NULL);
}

static void test_open_refusals(void **state)
{
    cairn_report_player_params good = cairn_report_player_default(), bad;
    cairn_report_player *player = NULL;

    (void)state;
    assert_int_equal(good.max_frames, 600);
    assert_int_equal(good.max_poses, 2000000);
    assert_int_equal(good.max_points, 200000);
    assert_int_equal(good.max_forces, 150000);
#define REFUSED(change)                                                                            \
    bad = good;                                                                                    \
    bad.change;                                                                                    \
    assert_status(cairn_report_player_open(&player, &bad), CAIRN_BAD_ARGUMENT);                    \
    assert_null(player)
    REFUSED(curve_count = -1);
    REFUSED(curve_count = 5);
    REFUSED(curve_count = 1);
    REFUSED(connect = 2);
    REFUSED(image = -1);
    REFUSED(image = 1025);
    REFUSED(max_frames = 1);
    REFUSED(max_poses = 1);
    REFUSED(max_points = 0);
    REFUSED(max_forces = 0);
    REFUSED(region_radius = -1);
    REFUSED(region_radius = (cairn_real)NAN);
    REFUSED(region_radius = (cairn_real)INFINITY);
#undef REFUSED
    assert_status(cairn_report_player_open(&player, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_open(NULL, &good), CAIRN_BAD_ARGUMENT);
}

static void test_scan_refusals(void **state)
{
    cairn_vec2 point[2] = {{0, 0}, {1, 1}};
    cairn_segment segment[1] = {{{0, 0}, {1, 1}}};
    cairn_report_scan good = {point, segment, 2, 1}, bad;
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player = open_player(&params);
    cairn_real *coordinates[] = {&point[1].x,     &point[1].y,     &segment[0].a.x,
                                 &segment[0].a.y, &segment[0].b.x, &segment[0].b.y};
    page *p;

    (void)state;
    assert_status(cairn_report_player_add_scan(NULL, &good, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_add_scan(player, NULL, 0), CAIRN_BAD_ARGUMENT);
#define REFUSED(change)                                                                            \
    bad = good;                                                                                    \
    bad.change;                                                                                    \
    assert_status(cairn_report_player_add_scan(player, &bad, 0), CAIRN_BAD_ARGUMENT)
    REFUSED(point_count = -1);
    REFUSED(segment_count = -1);
    REFUSED(point = NULL);
    REFUSED(segment = NULL);
#undef REFUSED
    for (size_t i = 0; i < 6; i++) {
        cairn_real kept = *coordinates[i];

        *coordinates[i] = (cairn_real)NAN;
        assert_status(cairn_report_player_add_scan(player, &good, 0), CAIRN_NOT_FINITE);
        *coordinates[i] = CAIRN_REAL(-1.1e9);
        assert_status(cairn_report_player_add_scan(player, &good, 0), CAIRN_NOT_FINITE);
        *coordinates[i] = kept;
    }
    assert_ok(add_poses(player, 0, NULL, 0));
    p = write_page(player);
    assert_int_equal(p->scans, 0);
    free_page(p);
    cairn_report_player_free(player);
}

static void test_frame_refusals(void **state)
{
    cairn_pose pose[2] = {{0, 0, 0}, {1, 1, 1}};
    cairn_vec2 region[1] = {{0, 0}};
    cairn_report_force force[1] = {{{0, 0}, {1, 1}}};
    cairn_report_hypothesis guess[1] = {{{{0, 0}, {1, 1}}, 1}};
    static const int32_t low[2] = {-1, -2}, high[2] = {0, 2};
    cairn_report_frame good, bad;
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player = open_player(&params);
    cairn_real *numbers[] = {&pose[1].x,
                             &pose[1].y,
                             &pose[1].theta,
                             &region[0].x,
                             &region[0].y,
                             &force[0].at.x,
                             &force[0].at.y,
                             &force[0].force.x,
                             &force[0].force.y,
                             &guess[0].segment.a.x,
                             &guess[0].segment.a.y,
                             &guess[0].segment.b.x,
                             &guess[0].segment.b.y};
    page *p;

    (void)state;
    memset(&good, 0, sizeof good);
    good.step = 5;
    good.pose = pose;
    good.pose_count = 2;
    good.region = region;
    good.region_count = 1;
    good.force = force;
    good.force_count = 1;
    good.hypothesis = guess;
    good.hypothesis_count = 1;
    add_scans(player, 2);
    assert_status(cairn_report_player_add_frame(NULL, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_report_player_add_frame(player, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_report_player_add_frame(player, &good));
    /* the same step */
    assert_status(cairn_report_player_add_frame(player, &good), CAIRN_BAD_ARGUMENT);
    good.step = 6;
#define REFUSED(change)                                                                            \
    bad = good;                                                                                    \
    bad.change;                                                                                    \
    assert_status(cairn_report_player_add_frame(player, &bad), CAIRN_BAD_ARGUMENT)
    REFUSED(pose_count = -1);
    REFUSED(pose_count = 3);
    REFUSED(region_count = -1);
    REFUSED(force_count = -1);
    REFUSED(hypothesis_count = -1);
    REFUSED(pose = NULL);
    REFUSED(region = NULL);
    REFUSED(force = NULL);
    REFUSED(hypothesis = NULL);
    REFUSED(submap = low);
    REFUSED(submap = high);
#undef REFUSED
    guess[0].strength = CAIRN_REAL(1.01);
    assert_status(cairn_report_player_add_frame(player, &good), CAIRN_BAD_ARGUMENT);
    guess[0].strength = CAIRN_REAL(-0.01);
    assert_status(cairn_report_player_add_frame(player, &good), CAIRN_BAD_ARGUMENT);
    guess[0].strength = 0;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        cairn_real kept = *numbers[i];

        *numbers[i] = (cairn_real)NAN;
        assert_status(cairn_report_player_add_frame(player, &good), CAIRN_NOT_FINITE);
        *numbers[i] = CAIRN_REAL(1.1e9);
        assert_status(cairn_report_player_add_frame(player, &good), CAIRN_NOT_FINITE);
        *numbers[i] = kept;
    }
    assert_ok(cairn_report_player_add_frame(player, &good));
    p = write_page(player);
    assert_int_equal(p->frames, 2);
    free_page(p);
    cairn_report_player_free(player);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_texts),          cmocka_unit_test(test_scans),
        cmocka_unit_test(test_poses),          cmocka_unit_test(test_far_poses),
        cmocka_unit_test(test_marks),          cmocka_unit_test(test_parts),
        cmocka_unit_test(test_links),          cmocka_unit_test(test_grid),
        cmocka_unit_test(test_thinned_frames), cmocka_unit_test(test_thinned_points),
        cmocka_unit_test(test_whole_log),      cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_write_failures), cmocka_unit_test(test_open_refusals),
        cmocka_unit_test(test_scan_refusals),  cmocka_unit_test(test_frame_refusals),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
