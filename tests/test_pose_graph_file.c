/* g2o files: round trips, every fault with its line, chained poses; solving, dropped links, the
 * picture, the command. */
#include "tests/programs.h"

#include <math.h>

#include "cairn/pose_graph_file.h"

#define INFORMATION " 100 0 0 100 0 400\n"

static cairn_pose_graph_file read_text(const char *text)
{
    cairn_pose_graph_file file;
    cairn_file_error error;

    if (cairn_pose_graph_file_read(&file, files_write_text("graph.g2o", text), &error) != CAIRN_OK)
        fail_msg("%s", error.text);
    return file;
}

static void refuse(const char *text, cairn_status status, int64_t line, const char *words)
{
    cairn_pose_graph_file file;
    cairn_file_error error;

    assert_status(cairn_pose_graph_file_read(&file, files_write_text("bad.g2o", text), &error),
                  status);
    assert_null(file.vertex);
    assert_null(file.edge);
    assert_int_equal(error.line, line);
    assert_holds(error.text, words);
}

static void every_fault_has_its_line(void **state)
{
    (void)state;
#define TWO "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
    refuse("", CAIRN_EMPTY, 0, "no EDGE_SE2");
    refuse(TWO, CAIRN_EMPTY, 0, "no EDGE_SE2");
    refuse("VERTEX_SE2 0 0 0\n", CAIRN_BAD_FORMAT, 1, "VERTEX_SE2 with fields missing");
    refuse("\nVERTEX_SE2 0 0 0 0 0\n", CAIRN_BAD_FORMAT, 2, "VERTEX_SE2 with fields missing");
    refuse("VERTEX_SE2 -1 0 0 0\n", CAIRN_BAD_FORMAT, 1, "not a vertex id");
    refuse("VERTEX_SE2 1.5 0 0 0\n", CAIRN_BAD_FORMAT, 1, "not a vertex id");
    refuse("VERTEX_SE2 1 0 x 0\n", CAIRN_BAD_FORMAT, 1, "expected a number");
    refuse("VERTEX_SE2 1 0 0 nan\n", CAIRN_NOT_FINITE, 1, "expected a finite number");
    refuse("VERTEX_SE2 1 inf 0 0\n", CAIRN_NOT_FINITE, 1, "expected a finite number");
    refuse(TWO "# a comment\nVERTEX_SE2 1 0 0 0\nEDGE_SE2 0 1 1 0 0" INFORMATION, CAIRN_BAD_FORMAT,
           4, "duplicate vertex 1, expected unique ids (first on line 2)");
    refuse(TWO "EDGE_SE2 0 1 1 0 0 1 0 0 1 0\n", CAIRN_BAD_FORMAT, 3,
           "EDGE_SE2 with fields missing");
    refuse(TWO "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 1\n", CAIRN_BAD_FORMAT, 3,
           "EDGE_SE2 with fields missing");
    refuse(TWO "EDGE_SE2 0 1 1 nan 0" INFORMATION, CAIRN_NOT_FINITE, 3, "finite");
    refuse(TWO "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 inf\n", CAIRN_NOT_FINITE, 3, "finite");
    refuse(TWO "EDGE_SE2 a 1 1 0 0" INFORMATION, CAIRN_BAD_FORMAT, 3, "not a vertex id");
    refuse(TWO "EDGE_SE2 0 b 1 0 0" INFORMATION, CAIRN_BAD_FORMAT, 3, "not a vertex id");
    refuse(TWO "EDGE_SE2 1 1 1 0 0" INFORMATION, CAIRN_BAD_FORMAT, 3, "to itself");
    refuse(TWO "EDGE_SE2 0 1 1 0 0 1 1 0 1 0 1\n", CAIRN_BAD_FORMAT, 3, "singular");
    refuse(TWO "EDGE_SE2 0 1 1 0 0 1 0 0 -1 0 1\n", CAIRN_BAD_FORMAT, 3, "negative eigenvalue");
    refuse(TWO "EDGE_SE2 0 1 1 0 0" INFORMATION "EDGE_SE2 0 7 1 0 0" INFORMATION, CAIRN_BAD_FORMAT,
           4, "an edge with vertex 7");
    refuse(TWO "EDGE_SE2 9 1 1 0 0" INFORMATION, CAIRN_BAD_FORMAT, 3, "an edge with vertex 9");
    refuse(TWO "EDGE_SE2 0 1 1 0 0" INFORMATION "FIX\n", CAIRN_BAD_FORMAT, 4,
           "FIX without a vertex");
    refuse(TWO "EDGE_SE2 0 1 1 0 0" INFORMATION "FIX 0 5\n", CAIRN_BAD_FORMAT, 4,
           "FIX of vertex 5");
    refuse(TWO "EDGE_SE2 0 1 1 0 0" INFORMATION "FIX x\n", CAIRN_BAD_FORMAT, 4, "not a vertex id");
    refuse("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n", CAIRN_UNSUPPORTED, 1,
           "expected VERTEX_SE2, EDGE_SE2 or FIX");
    refuse(TWO "VERTEX_SE2 2 0 0 0\nVERTEX_SE2 3 0 0 0\nEDGE_SE2 0 1 1 0 0" INFORMATION
               "EDGE_SE2 3 2 1 0 0" INFORMATION,
           CAIRN_BAD_FORMAT, 3, "2 connected components: no edges join vertex 2 to vertex 0");
    refuse("EDGE_SE2 0 1 1 0 0" INFORMATION "EDGE_SE2 5 6 1 0 0" INFORMATION, CAIRN_BAD_FORMAT, 2,
           "2 connected components: no edges join vertex 5");
    {
        cairn_pose_graph_file file;
        cairn_file_error error;

        assert_status(cairn_pose_graph_file_read(&file, files_path("none.g2o"), &error), CAIRN_IO);
    }
}

static void files_come_back_as_they_were(void **state)
{
    const char *text = "EDGE_SE2 4 9 1.5 -0.25 0.5 10 1 2 30 3 40\n"
                       "VERTEX_SE2 9 1 2 3\n"
                       "FIX 9 4\n"
                       "\n# comment\n"
                       "  VERTEX_SE2\t4 -1 0.125 -3\r\n";
    cairn_pose_graph_file file = read_text(text), back;
    char *bytes;

    (void)state;
    assert_int_equal(file.vertex_count, 2);
    assert_int_equal(file.edge_count, 1);
    assert_int_equal(file.chained, 0);
    assert_int_equal(file.vertex[0].id, 4);
    assert_int_equal(file.vertex[0].line, 6);
    assert_int_equal(file.vertex[0].fixed, 1);
    assert_int_equal(file.vertex[1].id, 9);
    assert_int_equal(file.edge[0].first, 0);
    assert_int_equal(file.edge[0].second, 1);
    assert_int_equal(file.edge[0].line, 1);
    assert_ok(cairn_pose_graph_file_write(files_path("back.g2o"), &file, NULL));
    bytes = files_read(files_path("back.g2o"), NULL);
    assert_string_equal(bytes, "VERTEX_SE2 4 -1 0.125 -3\nFIX 4\nVERTEX_SE2 9 1 2 3\nFIX 9\n"
                               "EDGE_SE2 4 9 1.5 -0.25 0.5 10 1 2 30 3 40\n");
    back = read_text(bytes);
    assert_memory_equal(&back.edge[0].first_second, &file.edge[0].first_second, sizeof(cairn_pose));
    assert_memory_equal(&back.edge[0].information, &file.edge[0].information, sizeof(cairn_sym3));
    file.vertex[1].pose.x = (cairn_real)NAN;
    assert_status(cairn_pose_graph_file_write(files_path("nan.g2o"), &file, NULL),
                  CAIRN_NOT_FINITE);
    assert_int_equal(access(files_path("nan.g2o"), F_OK), -1);
    file.vertex[1].pose.x = 0;
    assert_status(cairn_pose_graph_file_write(files_path("none/out.g2o"), &file, NULL), CAIRN_IO);
    free(bytes);
    cairn_pose_graph_file_free(&file);
    cairn_pose_graph_file_free(&back);
}

/* Without vertices: edges between consecutive ids are used first, wherever they stand, in either
 * direction. */
static void poses_come_from_the_edges(void **state)
{
    cairn_pose_graph_file file = read_text(
        "EDGE_SE2 10 12 50 0 0" INFORMATION "EDGE_SE2 10 11 1 0 1.5707963267948966" INFORMATION
        "EDGE_SE2 12 11 -2 0 0" INFORMATION "EDGE_SE2 12 20 0 1 0" INFORMATION);
    const double x[4] = {0, 1, 1, 0}, y[4] = {0, 0, 2, 2};

    (void)state;
    assert_int_equal(file.vertex_count, 4);
    assert_int_equal(file.chained, 1);
    assert_int_equal(file.vertex[3].id, 20);
    for (int32_t v = 0; v < 4; v++) {
        assert_near(file.vertex[v].pose.x, x[v], 1e-6);
        assert_near(file.vertex[v].pose.y, y[v], 1e-6);
        assert_near(file.vertex[v].pose.theta, v == 0 ? 0 : 1.5707963, 1e-6);
    }
    cairn_pose_graph_file_free(&file);
}

/* Trees of steps along the axes, their edges shuffled and some reversed, with gaps in the ids.
 * Behind them edges from every vertex to the next, false unless their ids are consecutive, too, and
 * they are used first. */
static void trees_are_chained(void **state)
{
    enum { MAX_COUNT = 40 };
    cairn_random random = cairn_random_seed(9, 0);

    (void)state;
    for (int32_t round = 0; round < 30; round++) {
        int32_t count = 2 + cairn_random_below(&random, MAX_COUNT - 1), id[MAX_COUNT], x[MAX_COUNT],
                y[MAX_COUNT], order[MAX_COUNT];
        char *text = malloc(20000), *end = text;
        cairn_pose_graph_file file;

        id[0] = 3;
        x[0] = y[0] = 0;
        for (int32_t i = 1; i < count; i++) {
            int32_t swap = 1 + cairn_random_below(&random, i);

            id[i] = id[i - 1] + 1 + cairn_random_below(&random, 2);
            order[i] = i;
            order[i] = order[swap];
            order[swap] = i;
        }
        for (int32_t k = 1; k < count; k++)
            x[k] = cairn_random_below(&random, 50) - 25,
            y[k] = cairn_random_below(&random, 50) - 25;
        for (int32_t twice = 0; twice < 2; twice++)
            for (int32_t k = 1; k < count; k++) {
                int32_t to = order[k], from = twice ? to - 1 : cairn_random_below(&random, to),
                        sign = 1;

                if (!twice && to % 3 == 0) {
                    int32_t swapped = from;

                    from = to;
                    to = swapped;
                }
                if (twice)
                    sign = id[to] == id[from] + 1 ? 1 : -1;
                end +=
                    sprintf(end, "EDGE_SE2 %d %d %d %d 0" INFORMATION, (int)id[from], (int)id[to],
                            (int)(sign * (x[to] - x[from])), (int)(sign * (y[to] - y[from])));
            }
        file = read_text(text);
        assert_int_equal(file.vertex_count, count);
        for (int32_t v = 0; v < count; v++) {
            assert_int_equal(file.vertex[v].id, id[v]);
            assert_near(file.vertex[v].pose.x, x[v], 1e-4);
            assert_near(file.vertex[v].pose.y, y[v], 1e-4);
        }
        cairn_pose_graph_file_free(&file);
        free(text);
    }
}

/* A ring of 20 poses, a metre apart, with links to the next and the next but one, and `bad` wrong
 * ones at the end. */
static char *a_ring(int32_t bad)
{
    cairn_random random = cairn_random_seed(7, 0);
    char *text = malloc(20000), *end = text;

    for (int32_t k = 1; k <= 2; k++)
        for (int32_t i = 0; i < 20; i++) {
            double turn = 2 * 3.14159265358979 / 20, dx = 0, dy = 0;

            for (int32_t s = 0; s < k; s++) {
                dx += cos(turn * s);
                dy += sin(turn * s);
            }
            dx += 0.02 * (double)cairn_random_uniform(&random, -1, 1);
            dy += 0.02 * (double)cairn_random_uniform(&random, -1, 1);
            end += sprintf(end, "EDGE_SE2 %d %d %.6f %.6f %.6f 2500 0 0 2500 0 10000\n", (int)i,
                           (int)((i + k) % 20), dx, dy,
                           turn * k + 0.01 * (double)cairn_random_uniform(&random, -1, 1));
        }
    for (int32_t i = 0; i < bad; i++)
        end += sprintf(end, "EDGE_SE2 %d %d 0 0 %d.5 2500 0 0 2500 0 10000\n", (int)i, (int)(i + 9),
                       (int)(i % 3));
    return text;
}

static void bad_links_are_dropped(void **state)
{
    (void)state;
    for (int32_t bad = 0; bad <= 10; bad += 5)
        for (int32_t keep_all = 0; keep_all < 2; keep_all++) {
            char *text = a_ring(bad);
            cairn_pose_graph_file file = read_text(text);
            cairn_pose_graph_file_solution out;
            double chi2;

            memset(&out, 0, sizeof out);
            out.keep_all = keep_all;
            assert_ok(cairn_pose_graph_file_solve(&file, &out));
            assert_int_equal(out.robust, bad > 0 && !keep_all);
            assert_int_equal(out.outliers, keep_all ? 0 : bad);
            for (int32_t e = 0; e < file.edge_count; e++)
                assert_int_equal(out.outlier[e], !keep_all && e >= 40);
            assert_true(out.pool_bytes > 5000);
            chi2 = (double)out.state.chi2;
            if (bad == 0 || !keep_all) {
                assert_true(chi2 > 1 && chi2 < 63 + 6 * sqrt(126.0));
                assert_near(out.pose[10].y, 6.3, 0.2); /* the ring's diameter */
            } else {
                assert_true(chi2 > 1000);
            }
            if (out.outliers > 0)
                assert_true(out.chi2_all > 100 * chi2);
            else
                assert_near(out.chi2_all, chi2, NUMBER(1e-6, 1e-2) * chi2);
            assert_true(out.chi2_initial > chi2);
            assert_near(file.vertex[0].pose.x, 0, 0);
            cairn_pose_graph_file_solution_free(&out);
            assert_null(out.pose);
            cairn_pose_graph_file_free(&file);
            free(text);
        }
}

/* A chain of three whose ends are 3 m apart and whose links measure 1 m each: FIXed poses stay, the
 * other is between. */
static void fixed_poses_stay(void **state)
{
    (void)state;
    for (int both = 0; both < 2; both++) {
        cairn_pose_graph_file file = read_text(
            both ? "VERTEX_SE2 4 0 0 0\nVERTEX_SE2 5 1 1 0.2\nVERTEX_SE2 6 3 0 0\nFIX 4 6\n"
                   "EDGE_SE2 4 5 1 0 0" INFORMATION "EDGE_SE2 5 6 1 0 0" INFORMATION
                 : "VERTEX_SE2 4 0 0 0\nVERTEX_SE2 5 1 1 0.2\nVERTEX_SE2 6 3 0 0\nFIX 6\n"
                   "EDGE_SE2 4 5 1 0 0" INFORMATION "EDGE_SE2 5 6 1 0 0" INFORMATION);
        cairn_pose_graph_file_solution out;

        memset(&out, 0, sizeof out);
        out.keep_all = 1;
        assert_ok(cairn_pose_graph_file_solve(&file, &out));
        assert_near(out.pose[2].x, 3, 0);
        assert_near(out.pose[2].y, 0, 0);
        assert_near(out.pose[0].x, both ? 0 : 1, NUMBER(1e-6, 1e-3));
        assert_near(out.pose[1].x, both ? 1.5 : 2, NUMBER(1e-6, 1e-3));
        assert_near(out.pose[1].y, 0, NUMBER(1e-6, 1e-3));
        cairn_pose_graph_file_solution_free(&out);
        cairn_pose_graph_file_free(&file);
    }
}

/* A square of side x side poses, a metre apart and each with its own heading, with exact links to
 * the right and upwards; the given poses are off by up to 0.2 m and 0.1 rad, all but the first. */
static cairn_pose_graph_file a_grid(int32_t side)
{
    cairn_random random = cairn_random_seed(5, 0);
    cairn_pose *truth = malloc((size_t)(side * side) * sizeof *truth);
    cairn_pose_graph_file file = {calloc((size_t)(side * side), sizeof *file.vertex),
                                  calloc((size_t)(2 * side * side), sizeof *file.edge), side * side,
                                  0, 0};

    for (int32_t i = 0; i < side * side; i++) {
        cairn_pose off = {cairn_random_uniform(&random, -1, 1) / 5,
                          cairn_random_uniform(&random, -1, 1) / 5,
                          cairn_random_uniform(&random, -1, 1) / 10};
        int32_t column = i % side, row = i / side;
        const int32_t before[2] = {column > 0 ? i - 1 : -1, i - side};

        truth[i].x = (cairn_real)column;
        truth[i].y = (cairn_real)row;
        truth[i].theta = i == 0 ? 0 : cairn_random_uniform(&random, -3, 3);
        file.vertex[i].id = i;
        file.vertex[i].pose = i == 0 ? truth[i] : cairn_pose_compose(truth[i], off);
        for (int32_t k = 0; k < 2; k++)
            if (before[k] >= 0)
                file.edge[file.edge_count++] =
                    (cairn_pose_graph_file_edge){before[k],
                                                 i,
                                                 0,
                                                 cairn_pose_between(truth[before[k]], truth[i]),
                                                 {100, 0, 0, 100, 0, 400}};
    }
    free(truth);
    return file;
}

/* A factor that needs more memory than the initial large pages, detected before it is computed. */
static void large_graphs_are_solved(void **state)
{
    enum { SIDE = 90 };
    cairn_pose_graph_file file = a_grid(SIDE);

    (void)state;
    for (int32_t sparse = 0; sparse < 2; sparse++) {
        cairn_pose_graph_file_solution out;
        cairn_status status;

        memset(&out, 0, sizeof out);
        out.solver = sparse ? CAIRN_POSE_GRAPH_FILE_SPARSE : CAIRN_POSE_GRAPH_FILE_BUILTIN;
        status = cairn_pose_graph_file_solve(&file, &out);
        if (sparse && status == CAIRN_UNSUPPORTED)
            continue;
        assert_ok(status);
        assert_true(out.pool_bytes > (size_t)4 << 20);
        assert_int_equal(out.outliers, 0);
        for (int32_t i = 0; i < SIDE * SIDE; i++) {
            int32_t column = i % SIDE, row = i / SIDE;

            assert_near(out.pose[i].x, column, NUMBER(1e-6, 5e-3));
            assert_near(out.pose[i].y, row, NUMBER(1e-6, 5e-3));
        }
        cairn_pose_graph_file_solution_free(&out);
    }
    cairn_pose_graph_file_free(&file);
}

static void the_picture_shows_dropped_links_in_red(void **state)
{
    char *text = a_ring(3), *picture;
    cairn_pose_graph_file file = read_text(text);
    cairn_pose_graph_file_solution out;
    int32_t moves = 0;

    (void)state;
    memset(&out, 0, sizeof out);
    assert_ok(cairn_pose_graph_file_solve(&file, &out));
    assert_ok(cairn_pose_graph_file_draw(files_path("graph.svg"), &file, &out, "a <ring>", NULL));
    picture = files_read(files_path("graph.svg"), NULL);
    assert_holds(picture, "a &lt;ring&gt;");
    assert_holds(picture, "without 3 links, red");
    for (const char *c = strstr(picture, "class=\"dropped\""); c != NULL;
         c = strstr(c + 1, "class=\"dropped\""))
        for (const char *d = strstr(c, "d=\"") + 3; *d != '"'; d++)
            moves += *d == 'M';
    assert_int_equal(moves, 2 * 3);
    moves = 0;
    for (const char *d = picture; *d != '\0'; d++)
        moves += d[0] == 'M' && d[1] >= '0' && d[1] <= '9';
    assert_int_equal(moves, 2 * 43);
    assert_golden(test_hash(TEST_HASH_START, picture, strlen(picture)),
                  UINT64_C(0x9400b3633957e219), UINT64_C(0x92f19ce31fd945c7));
    free(picture);
    assert_status(cairn_pose_graph_file_draw(files_path("none/graph.svg"), &file, &out, "", NULL),
                  CAIRN_IO);
    cairn_pose_graph_file_solution_free(&out);
    cairn_pose_graph_file_free(&file);
    free(text);
}

/* Graphs far from the origin, wide and tall: each fills its panels. */
static void pictures_fit_their_panels(void **state)
{
    static const char *const texts[] = {
        "VERTEX_SE2 0 10 -50 0\nVERTEX_SE2 1 17 -49 0\nVERTEX_SE2 2 12 -51 0\n"
        "EDGE_SE2 0 1 7 1 0" INFORMATION "EDGE_SE2 1 2 -5 -2 0" INFORMATION,
        "VERTEX_SE2 0 -10 50 0\nVERTEX_SE2 1 -11 43 0\nVERTEX_SE2 2 -12 44 0\n"
        "EDGE_SE2 0 1 -1 -7 0" INFORMATION "EDGE_SE2 1 2 -1 1 0" INFORMATION,
    };
    static const uint64_t known[] = {UINT64_C(0x859b81739faa4a15), UINT64_C(0x31642c01d46fcf56)};

    (void)state;
    for (int k = 0; k < 2; k++) {
        cairn_pose_graph_file file = read_text(texts[k]);
        cairn_pose_graph_file_solution out;
        char *picture;

        memset(&out, 0, sizeof out);
        assert_ok(cairn_pose_graph_file_solve(&file, &out));
        assert_ok(cairn_pose_graph_file_draw(files_path("far.svg"), &file, &out, "far", NULL));
        picture = files_read(files_path("far.svg"), NULL);
        assert_golden(test_hash(TEST_HASH_START, picture, strlen(picture)), known[k], known[k]);
        free(picture);
        cairn_pose_graph_file_solution_free(&out);
        cairn_pose_graph_file_free(&file);
    }
}

static void the_command(void **state)
{
    char *text = a_ring(4), *written;
    outcome o;

    (void)state;
    (void)files_write_text("ring.g2o", text);
    free(text);
    o = programs_run("cairn graph @/ring.g2o -o @/solved.g2o --report");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "poses      20 (composed from the links");
    assert_holds(o.out, "outliers   4 links rejected");
    assert_holds(o.out, "ring.g2o:41: link 0 -> 9 rejected");
    assert_holds(o.out, "ring.g2o:44: link 3 -> 12 rejected");
    assert_int_equal(access(files_path("solved.svg"), F_OK), 0);
    written = files_read(files_path("solved.g2o"), NULL);
    assert_holds(written, "VERTEX_SE2 19 ");
    free(written);
    o = programs_run("cairn graph @/solved.g2o --keep-all");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "outliers   0\n");
    o = programs_run("cairn graph @/solved.g2o --quiet");
    assert_string_equal(o.out, "");
    o = programs_run("cairn graph @/solved.g2o --solver sparse");
    assert_true(o.code == 0 || strstr(o.err, "tools/deps.sh solver") != NULL);
    o = programs_run("cairn graph @/solved.g2o --solver best");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "expected builtin or sparse");
    o = programs_run("cairn graph");
    assert_int_equal(o.code, 2);
    o = programs_run("cairn graph @/solved.g2o --report");
    assert_int_equal(o.code, 2);
    o = programs_run("cairn graph @/nothing.g2o");
    assert_int_equal(o.code, 2);
    (void)files_write_text("self.g2o", "EDGE_SE2 3 3 1 0 0" INFORMATION);
    o = programs_run("cairn graph @/self.g2o -o @/never.g2o");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "self.g2o:1: an edge from a vertex to itself, expected two vertices");
    assert_int_equal(access(files_path("never.g2o"), F_OK), -1);
    o = programs_run("cairn graph @/ring.g2o -o @/none/out.g2o");
    assert_int_equal(o.code, 2);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_fault_has_its_line),
        cmocka_unit_test(files_come_back_as_they_were),
        cmocka_unit_test(poses_come_from_the_edges),
        cmocka_unit_test(trees_are_chained),
        cmocka_unit_test(bad_links_are_dropped),
        cmocka_unit_test(large_graphs_are_solved),
        cmocka_unit_test(fixed_poses_stay),
        cmocka_unit_test(the_picture_shows_dropped_links_in_red),
        cmocka_unit_test(pictures_fit_their_panels),
        cmocka_unit_test(the_command),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
