/* cairn merge, run as a program. */
#include "tests/test.h"

#include <inttypes.h>
#include <yaml.h>

#include "cairn/map_file.h"
#include "cairn/pose_table.h"
#include "tests/programs.h"
#include "tests/world.h"

/* A view as a map_server map, named, in the test's folder; scale and raw encode unknown cells
 * otherwise. */
static void write_view(const char *name, const view *v, cairn_map_file_mode mode, int32_t negate,
                       cairn_map_file_image format)
{
    cairn_map_file file = cairn_map_file_default();
    cairn_file_error error;

    file.resolution = (cairn_real)v->resolution;
    file.origin.x = file.origin.y = -(cairn_real)(SIDE * v->resolution / 2);
    file.mode = mode;
    file.negate = negate;
    assert_ok(cairn_map_file_allocate(&file, SIDE, SIDE));
    for (int32_t i = 0; i < SIDE * SIDE; i++) {
        file.occupancy[i] = -1;
        if (v->cells[i] == CAIRN_OCCUPANCY_GRID_OCCUPIED)
            file.occupancy[i] = 100;
        else if (v->cells[i] == CAIRN_OCCUPANCY_GRID_FREE)
            file.occupancy[i] = 0;
    }
    assert_ok(cairn_map_file_draw(&file));
    assert_ok(cairn_map_file_write(&file, files_path(name), format, &error));
    cairn_map_file_free(&file);
}

static int make_maps(void **state)
{
    world w = rooms(1), other = rooms(77);
    view *v[4] = {
        draw(&w, -4, 0, 0.3, -7.2, -0.3, 0.05, 0), draw(&w, 0, 0.2, -2.1, -3.2, 3.2, 0.05, 0),
        draw(&w, 4, 0.3, 1.4, 0.2, 7.2, 0.05, 0), draw(&other, -4, 0, 0.3, -7.2, -0.3, 0.05, 0)};

    if (files_setup(state) != 0)
        return 1;
    write_view("a.yaml", v[0], CAIRN_MAP_FILE_TRINARY, 0, CAIRN_MAP_FILE_PGM);
    write_view("b.yaml", v[1], CAIRN_MAP_FILE_RAW, 0, CAIRN_MAP_FILE_PNG);
    write_view("c.yaml", v[2], CAIRN_MAP_FILE_TRINARY, 1, CAIRN_MAP_FILE_PGM);
    write_view("d.yaml", v[3], CAIRN_MAP_FILE_TRINARY, 0, CAIRN_MAP_FILE_PGM);
    for (int i = 0; i < 4; i++)
        free(v[i]);
    return 0;
}

static int end_maps(void **state)
{
    return files_teardown(state);
}

static void assert_pose(cairn_pose p, double x, double y, double theta)
{
    assert_near(p.x, x, 0.06);
    assert_near(p.y, y, 0.06);
    assert_near(remainder((double)p.theta - theta, 2 * PI), 0, 0.02);
}

/* Poses of the maps, seen from the first one. */
static void assert_transforms(const char *name)
{
    cairn_pose_table_row *row;
    cairn_file_error error;
    int32_t count;
    double c = cos(0.3), s = sin(0.3);

    assert_ok(cairn_pose_table_read(&row, &count, files_path(name), &error));
    assert_int_equal(count, 4);
    assert_pose(row[0].pose, 0, 0, 0);
    assert_pose(row[1].pose, c * 4 + s * 0.2, -s * 4 + c * 0.2, -2.4);
    assert_pose(row[2].pose, c * 8 + s * 0.3, -s * 8 + c * 0.3, 1.1);
    for (int32_t i = 0; i < 4; i++)
        assert_int_equal(strcmp(row[i].verdict, "placed") == 0, i < 3);
    cairn_pose_table_free(row);
}

/* The places of a map: their shares and products add up to 1; the one of most evidence is the
 * accepted one. */
static void assert_places(const char *name, int32_t map, double x, double y)
{
    char *text = files_read(files_path(name), NULL);
    double sum[3] = {0, 0, 0}, most = -1, best[2] = {0, 0};
    int rows = 0;

    assert_int_equal(
        strncmp(text, "map,beside,x,y,theta,evidence,psi,gamma,psi_share,gamma_share,product\n",
                70),
        0);
    for (const char *line = strchr(text, '\n') + 1; *line != 0; line = strchr(line, '\n') + 1) {
        double v[9];
        int32_t of, beside;

        assert_int_equal(sscanf(line, "%" SCNd32 ",%" SCNd32 ",%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf",
                                &of, &beside, &v[0], &v[1], &v[2], &v[3], &v[4], &v[5], &v[6],
                                &v[7], &v[8]),
                         11);
        assert_true(of != beside && beside < 3); /* the unrelated map was placed nowhere */
        assert_true(v[4] >= 0 && v[4] <= 4 && v[6] >= 0 && v[6] <= 1 && v[7] >= 0 && v[7] <= 1);
        if (of != map)
            continue;
        rows++;
        for (int k = 0; k < 3; k++)
            sum[k] += v[6 + k];
        if (v[3] > most) {
            most = v[3];
            best[0] = v[0];
            best[1] = v[1];
        }
    }
    assert_true(rows >= 1);
    for (int k = 0; k < 3; k++)
        assert_near(sum[k], 1, 1e-3);
    assert_near(best[0], x, 0.06);
    assert_near(best[1], y, 0.06);
    free(text);
}

static void three_maps_and_an_unrelated_one(void **state)
{
    outcome o = programs_run("cairn merge @/a.yaml @/b.yaml @/c.yaml @/d.yaml -o @/merged");
    cairn_map_file merged;
    cairn_file_error error;
    char *yaml, *picture;
    int64_t walls = 0, open = 0;

    (void)state;
    assert_string_equal(o.err, "");
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "maps       4, 3 placed"));
    assert_non_null(strstr(o.out, "order      0 1 2"));
    assert_non_null(strstr(o.out, "rejected: "));
    assert_transforms("merged/transforms.csv");
    assert_places("merged/places.csv", 1, cos(0.3) * 4 + sin(0.3) * 0.2,
                  -sin(0.3) * 4 + cos(0.3) * 0.2);
    assert_places("merged/places.csv", 2, cos(0.3) * 8 + sin(0.3) * 0.3,
                  -sin(0.3) * 8 + cos(0.3) * 0.3);
    assert_ok(cairn_map_file_read(&merged, files_path("merged/map.yaml"), &error));
    for (int64_t i = 0; i < (int64_t)merged.width * merged.height; i++) {
        walls += merged.occupancy[i] == 100;
        open += merged.occupancy[i] == 0;
    }
    /* The world is 14 by 8 m, less boxes. */
    assert_in_range((int64_t)((double)open * 0.0025), 70, 112);
    assert_in_range(walls, 800, 6000);
    cairn_map_file_free(&merged);
    yaml = files_read(files_path("merged/transforms.yaml"), NULL);
    picture = files_read(files_path("merged/map.svg"), NULL);
    assert_non_null(strstr(yaml, "order: [0, 1, 2]"));
    assert_non_null(strstr(yaml, "placed: false\n    reason: "));
    assert_non_null(strstr(picture, "3 of 4 maps placed; d.yaml rejected: "));
    free(yaml);
    free(picture);
}

/* Maps by their image, by the folder of cairn map, and by their YAML file: the same results, named
 * as they were given, with the commands that publish their transforms. */
static void maps_by_image_and_folder(void **state)
{
    static const char publisher[] = "transform  ros2 run tf2_ros static_transform_publisher --x ";
    char *bytes, *yaml, *given;
    size_t count = 0;
    cairn_pose_table_row *row;
    cairn_file_error error;
    int32_t rows;
    double x, y, yaw;
    outcome o;

    (void)state;
    assert_int_equal(mkdir(files_path("robot3"), 0777), 0);
    bytes = files_read(files_path("c.pgm"), &count);
    assert_non_null(bytes);
    (void)files_write("robot3/c.pgm", bytes, count);
    free(bytes);
    bytes = files_read(files_path("c.yaml"), NULL);
    (void)files_write_text("robot3/map.yaml", bytes);
    free(bytes);
    o = programs_run("cairn merge @/a.pgm @/b.png @/robot3/ @/d.yaml -o @/given");
    assert_string_equal(o.err, "");
    assert_int_equal(o.code, 0);
    assert_transforms("given/transforms.csv");
    given = files_read(files_path("given/transforms.csv"), NULL);
    bytes = files_read(files_path("merged/transforms.csv"), NULL);
    assert_string_equal(given, bytes);
    free(given);
    free(bytes);
    assert_holds(o.out, "/a.pgm\n");
    assert_holds(o.out, "/b.png\n");
    assert_holds(o.out, "/robot3/\n");
    assert_holds(o.out, "--frame-id map --child-frame-id a/map\n");
    assert_holds(o.out, "--child-frame-id robot3/map\n");
    assert_null(strstr(o.out, "--child-frame-id d/map")); /* not placed */
    assert_ok(cairn_pose_table_read(&row, &rows, files_path("given/transforms.csv"), &error));
    bytes = strstr(strstr(o.out, publisher) + 1, publisher);
    assert_non_null(bytes);
    assert_int_equal(sscanf(bytes + strlen(publisher), "%lf --y %lf --yaw %lf", &x, &y, &yaw), 3);
    assert_near(x, row[1].pose.x, 1e-5);
    assert_near(y, row[1].pose.y, 1e-5);
    assert_near(yaw, row[1].pose.theta, 1e-5);
    cairn_pose_table_free(row);
    yaml = files_read(files_path("given/transforms.yaml"), NULL);
    assert_holds(yaml, "/robot3/\"\n    frame: robot3/map\n    placed: true\n");
    free(yaml);
    /* Two robots of one name have frames of their own. */
    o = programs_run("cairn merge @/a.pgm @/a.yaml -o @/given");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "--child-frame-id robot_a_0/map\n");
    assert_holds(o.out, "--child-frame-id robot_a_1/map\n");
}

/* Of an earlier run of map or align in the folder nothing stays beside the merged map. */
static void files_of_other_runs_do_not_stay(void **state)
{
    static const char *const old[] = {"poses.csv", "poses.tum", "graph.g2o", "stages.svg"};
    char name[64];

    (void)state;
    assert_int_equal(mkdir(files_path("reused"), 0777), 0);
    (void)files_write_text("reused/other.txt", "kept");
    for (size_t i = 0; i < sizeof old / sizeof *old; i++) {
        (void)snprintf(name, sizeof name, "reused/%s", old[i]);
        (void)files_write_text(name, "old");
    }
    assert_int_equal(programs_run("cairn merge @/a.yaml @/b.yaml -o @/reused --quiet").code, 0);
    for (size_t i = 0; i < sizeof old / sizeof *old; i++) {
        (void)snprintf(name, sizeof name, "reused/%s", old[i]);
        assert_int_not_equal(access(files_path(name), F_OK), 0);
    }
    assert_int_equal(access(files_path("reused/map.pgm"), F_OK), 0);
    assert_int_equal(access(files_path("reused/other.txt"), F_OK), 0);
}

/* Names with control characters, or that are not UTF-8, leave the YAML valid. */
static void odd_names(void **state)
{
    char *yaml, *a = files_read(files_path("a.yaml"), NULL);
    yaml_parser_t parser;
    yaml_document_t document;
    outcome o;

    (void)state;
    (void)files_write_text("a\n\t\x01\x7f\xff\"\\.yaml", a);
    free(a);
    o = programs_run("cairn merge '@/a\n\t\x01\x7f\xff\"\\.yaml' @/b.yaml -o @/odd --quiet");
    assert_int_equal(o.code, 0);
    yaml = files_read(files_path("odd/transforms.yaml"), NULL);
    assert_non_null(yaml);
    assert_int_equal(yaml_parser_initialize(&parser), 1);
    yaml_parser_set_input_string(&parser, (const unsigned char *)yaml, strlen(yaml));
    assert_int_equal(yaml_parser_load(&parser, &document), 1);
    assert_non_null(strstr(yaml, "a\\u000a\\u0009\\u0001\\u007f\xEF\xBF\xBD\\u0022\\u005c.yaml\""));
    yaml_document_delete(&document);
    yaml_parser_delete(&parser);
    free(yaml);
}

/* Maps of one name in two folders are two in the legend. */
static void two_of_one_name(void **state)
{
    char *yaml = files_read(files_path("b.yaml"), NULL), *picture;
    char image[64], second[80], *pgm;
    size_t bytes = 0;
    outcome o;

    (void)state;
    assert_int_equal(mkdir(files_path("second"), 0777), 0);
    (void)files_write_text("second/a.yaml", yaml);
    assert_int_equal(sscanf(strstr(yaml, "image: "), "image: '%63[^']", image), 1);
    pgm = files_read(files_path(image), &bytes);
    assert_non_null(pgm);
    free(yaml);
    (void)snprintf(second, sizeof second, "second/%s", image);
    (void)files_write(second, pgm, bytes);
    free(pgm);
    o = programs_run("cairn merge @/a.yaml @/second/a.yaml -o @/twins --quiet");
    assert_string_equal(o.err, "");
    assert_int_equal(o.code, 0);
    picture = files_read(files_path("twins/map.svg"), NULL);
    assert_non_null(picture);
    assert_non_null(strstr(picture, "second/a.yaml"));
    assert_null(strstr(picture, "#c83232")); /* red beside green */
    free(picture);
}

/* A later merging of the same maps accepts the earlier result; order and reference may be given. */
static void a_warm_start(void **state)
{
    outcome o = programs_run("cairn merge @/a.yaml @/b.yaml @/c.yaml @/d.yaml -o @/warm --start "
                             "@/merged/transforms.csv --quiet");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_string_equal(o.out, "");
    assert_transforms("warm/transforms.csv");
    o = programs_run("cairn merge @/a.yaml @/b.yaml @/c.yaml -o @/ordered --reference 1 --order "
                     "1,2,0 --particles 10 "
                     "--seed 3 --scale 0.05,0.05,0.05 --coarsen 1");
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "order      1 2 0"));
    o = programs_run("cairn merge @/a.yaml @/b.yaml -o @/strict --min-score 900");
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "maps       2, 1 placed"));
}

/* By images maps are refused more often; as written none is refused that shares a corner type with
 * another. */
static void by_images_and_as_written(void **state)
{
    outcome o = programs_run(
        "cairn merge @/a.yaml @/b.yaml @/c.yaml -o @/images --perception images --coarsen 1");
    cairn_pose_table_row *row;
    cairn_file_error error;
    int32_t count;

    (void)state;
    assert_string_equal(o.err, "");
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "maps       3, "));
    o = programs_run(
        "cairn merge @/a.yaml @/b.yaml @/d.yaml -o @/written --as-written --order 0,1,2");
    assert_string_equal(o.err, "");
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "maps       3, 3 placed")); /* the unrelated map, too */
    assert_non_null(strstr(o.out, "downsampled 1 by 1"));
    assert_ok(cairn_pose_table_read(&row, &count, files_path("written/transforms.csv"), &error));
    assert_int_equal(count, 3);
    for (int32_t i = 0; i < 3; i++)
        assert_string_equal(row[i].verdict, "placed");
    cairn_pose_table_free(row);
    o = programs_run("cairn merge @/a.yaml @/b.yaml -o @/written --as-written --perception images "
                     "--particles 5 --seed 2");
    assert_int_equal(o.code, 0);
    o = programs_run("cairn merge @/a.yaml -o @/one --as-written");
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "maps       1, 1 placed"));
}

static void assert_words_refused(const char *words, const char *piece)
{
    assert_refused(programs_run("cairn merge %s", words), piece);
}

static void command_lines_are_refused(void **state)
{
    (void)state;
    assert_int_equal(mkdir(files_path("empty"), 0777), 0);
    assert_words_refused("", "no maps");
    assert_words_refused("@/a.yaml", "no -o DIR");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --reference 2",
                         "--reference 2, expected at most 1");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --order 0", "--order 0, expected 2 numbers");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --order 0,0", "expected every map once");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --order 0,1.5", "expected every map once");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --scale 0.05,x",
                         "--scale 0.05,x, expected 2 numbers");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --scale 0.05,0", "no valid cell size");
    assert_words_refused("@/a.yaml @/missing.yaml -o @/no", "missing.yaml");
    assert_words_refused("@/a.yaml @/missing.png -o @/no", "missing.png: ");
    assert_words_refused("@/a.yaml @/empty -o @/no",
                         "empty/map.yaml is not there, expected the YAML");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --start @/missing.csv", "missing.csv");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --pool 1K", "pool");
    assert_words_refused("@/a.yaml @/b.yaml -o @/a.yaml/no", "a.yaml");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --perception vision",
                         "--perception vision, expected evidence or images");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --as-written --perception evidence",
                         "expected one of both");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --as-written --start @/merged/transforms.csv",
                         "--start with --as-written");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --as-written --coarsen 2",
                         "--coarsen with --as-written");
    assert_words_refused("@/a.yaml @/b.yaml -o @/no --as-written --min-score 6",
                         "--min-score with --as-written");
    assert_int_not_equal(access(files_path("no"), F_OK), 0); /* nothing was left */
}

static void help_is_printed(void **state)
{
    outcome o = programs_run("cairn merge --help");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "--min-score NATS"));
    assert_non_null(strstr(o.out, "usage: cairn merge MAP MAP ..."));
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_maps_and_an_unrelated_one),
        cmocka_unit_test(maps_by_image_and_folder),
        cmocka_unit_test(files_of_other_runs_do_not_stay),
        cmocka_unit_test(odd_names),
        cmocka_unit_test(two_of_one_name),
        cmocka_unit_test(a_warm_start),
        cmocka_unit_test(by_images_and_as_written),
        cmocka_unit_test(command_lines_are_refused),
        cmocka_unit_test(help_is_printed),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, make_maps, end_maps);
}
