/* Models of shapes as files: written ones are read back bit by bit, every line is checked, pictures
 * show all, mirroring twice restores the model. */
#include "tests/test.h"

#include <math.h>

#include "cairn/shape_model_file.h"
#include "src/host/files/map_file_image.h"
#include "tests/files.h"
#include "tests/xml.h"

static cairn_file_error error;

/* A cross of two bars. */
static cairn_shape_model_file make(void)
{
    static const cairn_vec2 corners[] = {{40, 0},   {60, 0},  {60, 50},  {120, 50},
                                         {120, 80}, {60, 80}, {60, 200}, {40, 200},
                                         {40, 80},  {0, 80},  {0, 50},   {40, 50}};
    cairn_curve outline = {corners, 12, 1};
    cairn_shape_model_builder_params params = cairn_shape_model_builder_default();
    cairn_shape_model_file file;

    assert_ok(cairn_shape_model_file_build(&file, &outline, 1, &params, "cross", &error));
    return file;
}

static void assert_same(const cairn_shape_model *a, const cairn_shape_model *b)
{
    assert_int_equal(a->sample_count, b->sample_count);
    assert_int_equal(a->path_count, b->path_count);
    assert_int_equal(a->outline_count, b->outline_count);
    assert_int_equal(a->gap_count, b->gap_count);
    assert_memory_equal(a->gaps, b->gaps, sizeof a->gaps);
    assert_true(a->size == b->size && a->origin.x == b->origin.x && a->origin.y == b->origin.y);
    assert_memory_equal(a->samples, b->samples, (size_t)a->sample_count * sizeof *a->samples);
    assert_memory_equal(a->paths, b->paths, (size_t)a->path_count * sizeof *a->paths);
    assert_memory_equal(a->outline, b->outline, (size_t)a->outline_count * sizeof *a->outline);
}

static void test_written_and_read(void **state)
{
    cairn_shape_model_file made = make(), read;

    (void)state;
    assert_true(made.model.path_count >= 2);
    assert_int_equal(cairn_shape_model_file_is(files_path("cross.shape")), 0);
    assert_ok(cairn_shape_model_file_write(&made.model, files_path("cross.shape"), &error));
    assert_int_equal(cairn_shape_model_file_is(files_path("cross.shape")), 1);
    assert_ok(cairn_shape_model_file_read(&read, files_path("cross.shape"), &error));
    assert_same(&made.model, &read.model);
    cairn_shape_model_file_free(&made);
    cairn_shape_model_file_free(&read);
    assert_null(read.samples);
}

/* ---- Bad files ---- */

#define HEAD    "cairn-shape 1\nsize 10\norigin 1 2\n"
#define OUTLINE "outline 2\n-0.5 0 1 0\n0.5 0 -1 0\n"
#define SAMPLE  "0 0 0.1 0  0 0.1 1 0 0.5  0 -0.1 1 0 0.5\n"

static void assert_refused(const char *text, cairn_status status, int64_t line, const char *piece)
{
    cairn_shape_model_file file;

    memset(&error, 0, sizeof error);
    assert_status(cairn_shape_model_file_read(&file, files_write_text("bad.shape", text), &error),
                  status);
    assert_null(file.samples);
    if (error.line != line || strstr(error.text, piece) == NULL ||
        strstr(error.text, "expected") == NULL)
        fail_msg("\"%s\" does not say \"%s\" of line %d", error.text, piece, (int)line);
}

static void test_smallest_and_comments(void **state)
{
    cairn_shape_model_file file;

    (void)state;
    assert_ok(cairn_shape_model_file_read(
        &file,
        files_write_text("small.shape", "# a model\n\n" HEAD OUTLINE
                                        "  # a path\r\npath -1 -1 1 1 # of one\n" SAMPLE
                                        "path 0 0 0.5 1\n" SAMPLE),
        &error));
    assert_int_equal(file.model.path_count, 2);
    assert_int_equal(file.model.sample_count, 2);
    assert_int_equal(file.model.outline_count, 2);
    assert_near(file.model.size, 10, 0);
    assert_near(file.model.origin.y, 2, 0);
    assert_int_equal(file.model.paths[1].first, 1);
    assert_int_equal(file.model.paths[1].parent, 0);
    assert_near(file.model.samples[1].contact[1].position.y, -0.1, 1e-6);
    assert_near(file.model.samples[1].outline_share[1], 0.5, 0);
    cairn_shape_model_file_free(&file);
}

static void test_every_line_is_checked(void **state)
{
    (void)state;
    assert_refused("", CAIRN_TRUNCATED, 0, "header of a shape model");
    assert_refused("P5\n3 3\n", CAIRN_BAD_FORMAT, 1, "header of a shape model");
    assert_refused("cairn-shape\n", CAIRN_BAD_FORMAT, 1, "header of a shape model");
    assert_refused("cairn-shape 2\n", CAIRN_UNSUPPORTED, 1, "version 2");
    assert_refused("cairn-shape 1\nsize\n", CAIRN_BAD_FORMAT, 2, "\"size\"");
    assert_refused("cairn-shape 1\nsize x\n", CAIRN_BAD_FORMAT, 2, "\"x\"");
    assert_refused("cairn-shape 1\nsize 1\norigin 1\n", CAIRN_BAD_FORMAT, 3, "\"origin\"");
    assert_refused(HEAD "outline 0\n", CAIRN_FULL, 4, "0 samples");
    assert_refused(HEAD "outline 4097\n", CAIRN_FULL, 4, "4097 samples");
    assert_refused(HEAD "outline 1.5\n", CAIRN_FULL, 4, "1.5 samples");
    assert_refused(HEAD "outline nan\n", CAIRN_FULL, 4, "nan samples");
    assert_refused(HEAD "outline 2\n1 2 3 4\n", CAIRN_TRUNCATED, 5, "sample of the outline");
    assert_refused(HEAD "outline 2\n1 2 3\n", CAIRN_BAD_FORMAT, 5, "3 numbers");
    assert_refused(HEAD OUTLINE, CAIRN_TRUNCATED, 6, "a path");
    assert_refused(HEAD OUTLINE "way -1 -1 1 1\n", CAIRN_BAD_FORMAT, 7, "malformed path");
    assert_refused(HEAD OUTLINE "path -1 -1 1\n", CAIRN_BAD_FORMAT, 7, "malformed path");
    assert_refused(HEAD OUTLINE "path 0.5 -1 1 1\n", CAIRN_BAD_FORMAT, 7, "malformed path");
    assert_refused(HEAD OUTLINE "path -1 -2 1 1\n", CAIRN_BAD_FORMAT, 7, "malformed path");
    assert_refused(HEAD OUTLINE "path -1 -1 1 0\n", CAIRN_FULL, 7, "0 samples");
    assert_refused(HEAD OUTLINE "path -1 -1 1 1025\n", CAIRN_FULL, 7, "1025 samples");
    assert_refused(HEAD OUTLINE "path -1 -1 1 2\n" SAMPLE, CAIRN_TRUNCATED, 8, "14 numbers");
    assert_refused(HEAD OUTLINE "path -1 -1 1 1\n1 2 3\n", CAIRN_BAD_FORMAT, 8, "3 numbers");
    assert_refused(HEAD OUTLINE "path -1 -1 1 1\n1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17\n",
                   CAIRN_BAD_FORMAT, 8, "more than 16");
}

/* A refusal of the library is reported with its line. */
static void test_faults_of_the_model(void **state)
{
    char paths[2048] = HEAD OUTLINE;

    (void)state;
    assert_refused("cairn-shape 1\nsize 0\norigin 1 2\n" OUTLINE "path -1 -1 1 1\n" SAMPLE,
                   CAIRN_BAD_ARGUMENT, 0, "size");
    assert_refused(HEAD "outline 2\n-0.5 0 1 0\n0.5 0 3 0\npath -1 -1 1 1\n" SAMPLE,
                   CAIRN_BAD_ARGUMENT, 6, "outline");
    assert_refused(HEAD OUTLINE "path -1 -1 1 1\n" SAMPLE "path 1 0 1 1\n" SAMPLE,
                   CAIRN_BAD_ARGUMENT, 9, "path");
    assert_refused(HEAD OUTLINE "path -1 -1 1 2\n" SAMPLE
                                "0 0 -1 0  0 0.1 1 0 0.5  0 -0.1 1 0 0.5\n",
                   CAIRN_BAD_ARGUMENT, 9, "radius");
    assert_refused(HEAD OUTLINE "path -1 -1 1 1\n0 0 inf 0  0 0.1 1 0 0.5  0 -0.1 1 0 0.5\n",
                   CAIRN_NOT_FINITE, 8, "finite");
    for (int i = 0; i < 9; i++)
        strcat(paths, "path -1 -1 0 1\n" SAMPLE);
    assert_refused(paths, CAIRN_FULL, 23, "too many paths");
}

static void test_what_cannot_be_read_or_written(void **state)
{
    cairn_shape_model_file made = make(), file;
    cairn_shape_model bad = made.model;
    int before;

    (void)state;
    assert_status(cairn_shape_model_file_read(&file, files_path("missing"), &error), CAIRN_IO);
    before = files_count();
    assert_status(cairn_shape_model_file_write(&made.model, files_path("none/a.shape"), &error),
                  CAIRN_IO);
    assert_status(cairn_shape_model_file_draw(&made.model, "a", files_path("none/a.svg"), &error),
                  CAIRN_IO);
    bad.size = (cairn_real)NAN;
    assert_status(cairn_shape_model_file_write(&bad, files_path("a.shape"), &error),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_file_draw(&bad, "a", files_path("a.svg"), &error),
                  CAIRN_BAD_ARGUMENT);
    bad = made.model;
    bad.outline_count = CAIRN_SHAPE_MODEL_FILE_MAX_OUTLINE + 1;
    bad.outline = calloc((size_t)bad.outline_count, sizeof *bad.outline);
    for (int32_t i = 0; i < bad.outline_count; i++)
        ((cairn_oriented_point *)bad.outline)[i].direction.x = 1;
    assert_status(cairn_shape_model_file_write(&bad, files_path("a.shape"), &error),
                  CAIRN_BAD_ARGUMENT);
    assert_non_null(strstr(error.text, "4097"));
    free((void *)bad.outline);
    assert_int_equal(files_count(), before);
    cairn_shape_model_file_free(&made);
}

static void test_outlines_that_make_no_model(void **state)
{
    static const cairn_vec2 line[] = {{0, 0}, {10, 0}, {20, 0}};
    cairn_curve flat = {line, 3, 1};
    cairn_shape_model_builder_params params = cairn_shape_model_builder_default();
    cairn_shape_model_file file;

    (void)state;
    assert_status(cairn_shape_model_file_build(&file, &flat, 1, &params, "name", &error),
                  CAIRN_EMPTY);
    assert_non_null(strstr(error.text, "name: no model"));
    assert_null(file.samples);
    assert_status(cairn_shape_model_file_build(&file, &flat, 0, &params, "name", &error),
                  CAIRN_BAD_ARGUMENT);
    params.outline_samples = 1;
    assert_status(cairn_shape_model_file_build(&file, &flat, 1, &params, "name", &error),
                  CAIRN_BAD_ARGUMENT);
}

/* ---- From pictures ---- */

/* A bar, black on white. */
static const char *write_picture(void)
{
    uint8_t grey[100 * 60];

    memset(grey, 255, sizeof grey);
    for (int32_t y = 20; y < 40; y++)
        memset(&grey[y * 100 + 10], 0, 70);
    assert_ok(cairn_image_write_png(files_path("bar.png"), grey, 100, 60, &error));
    return files_path("bar.png");
}

/* A box drawn with an off-centre gap in its upper side. */
static const char *write_drawing(void)
{
    uint8_t grey[120 * 100];

    memset(grey, 255, sizeof grey);
    for (int32_t i = 10; i <= 109; i++)
        grey[20 * 120 + i] = grey[69 * 120 + i] = 0;
    for (int32_t i = 20; i <= 69; i++)
        grey[i * 120 + 10] = grey[i * 120 + 109] = 0;
    memset(&grey[20 * 120 + 80], 255, 7);
    assert_ok(cairn_image_write_png(files_path("box.png"), grey, 120, 100, &error));
    return files_path("box.png");
}

/* The middle of the gap in the model's frame, in its file, and in its mirror image. */
static void test_gaps(void **state)
{
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_shape_model_file file, again;

    (void)state;
    assert_ok(cairn_shape_model_file_load(&file, write_drawing(), &image, &builder, NULL, &error));
    assert_int_equal(file.model.gap_count, 1);
    assert_near(file.model.gaps[0].x * file.model.size + file.model.origin.x, 83, 0.6);
    assert_near(file.model.gaps[0].y * file.model.size + file.model.origin.y, 20, 1e-3);
    assert_ok(cairn_shape_model_file_write(&file.model, files_path("box.shape"), &error));
    assert_ok(cairn_shape_model_file_read(&again, files_path("box.shape"), &error));
    assert_same(&file.model, &again.model);
    cairn_shape_model_file_mirror(&again);
    assert_near(again.model.gaps[0].x, -file.model.gaps[0].x, 0);
    assert_near(again.model.gaps[0].y, file.model.gaps[0].y, 0);
    again.model.gap_count = CAIRN_SHAPE_MODEL_MAX_GAPS + 1;
    assert_status(cairn_shape_model_check(&again.model, NULL), CAIRN_BAD_ARGUMENT);
    cairn_shape_model_file_free(&again);
    cairn_shape_model_file_free(&file);
    assert_refused(HEAD OUTLINE "gap 1\npath -1 -1 1 1\n" SAMPLE, CAIRN_BAD_FORMAT, 7,
                   "malformed gap");
    assert_refused(HEAD OUTLINE "path -1 -1 1 1\n" SAMPLE "gap 1 2\n", CAIRN_BAD_FORMAT, 9,
                   "malformed gap");
    assert_refused(
        HEAD OUTLINE
        "gap 0 0\ngap 0 0\ngap 0 0\ngap 0 0\ngap 0 0\ngap 0 0\ngap 0 0\ngap 0 0\ngap 0 0\n",
        CAIRN_FULL, 15, "too many gaps");
}

static void test_load(void **state)
{
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_shape_model_file file, again;
    cairn_shape_image traced;

    (void)state;
    assert_ok(
        cairn_shape_model_file_load(&file, write_picture(), &image, &builder, &traced, &error));
    assert_int_equal(traced.count, 1);
    assert_int_equal(traced.is_drawing, 0);
    assert_null(traced.points);
    assert_null(traced.outlines[0].points);
    assert_near(file.model.size, sqrt(70 * 70 + 20 * 20), 0.5);
    assert_near(file.model.origin.x, 44.5, 1e-4);
    assert_ok(cairn_shape_model_file_write(&file.model, files_path("bar.shape"), &error));
    assert_ok(cairn_shape_model_file_load(&again, files_path("bar.shape"), &image, &builder,
                                          &traced, &error));
    assert_int_equal(traced.count, 0);
    assert_same(&file.model, &again.model);
    cairn_shape_model_file_free(&again);
    cairn_shape_model_file_free(&file);
    assert_status(
        cairn_shape_model_file_load(&file, files_path("missing"), &image, &builder, NULL, &error),
        CAIRN_IO);
    assert_status(cairn_shape_model_file_load(&file, files_write_text("x.pgm", "P2\n1 1\n255\n0\n"),
                                              &image, &builder, NULL, &error),
                  CAIRN_EMPTY);
}

static void test_mirror(void **state)
{
    cairn_shape_model_file made = make(), twice = make();
    const cairn_shape_model *m = &made.model;

    (void)state;
    cairn_shape_model_file_mirror(&twice);
    assert_ok(cairn_shape_model_check(&twice.model, NULL));
    for (int32_t i = 0; i < m->sample_count; i++) {
        const cairn_shape_model_sample *a = &m->samples[i], *b = &twice.samples[i];

        assert_near(a->centre.x, -b->centre.x, 0);
        assert_near(a->centre.y, b->centre.y, 0);
        assert_near(a->contact[0].position.x, -b->contact[1].position.x, 0);
        assert_near(a->contact[1].position.y, b->contact[0].position.y, 0);
        assert_near(a->outline_share[0], b->outline_share[1], 0);
        /* Left is to the left of the path in image coordinates, as before. */
        if (i + 1 < m->paths[0].count) {
            cairn_vec2 along = cairn_vec2_sub(twice.samples[i + 1].centre, b->centre);
            cairn_vec2 was = cairn_vec2_sub(m->samples[i + 1].centre, a->centre);
            cairn_real side =
                cairn_vec2_cross(along, cairn_vec2_sub(b->contact[0].position, b->centre));

            assert_near(
                side, cairn_vec2_cross(was, cairn_vec2_sub(a->contact[1].position, a->centre)) * -1,
                1e-6);
        }
    }
    for (int32_t i = 0; i < m->outline_count; i++) {
        const cairn_oriented_point *a = &m->outline[i],
                                   *b = &twice.outline[m->outline_count - 1 - i];

        assert_near(a->position.x, -b->position.x, 0);
        assert_near(a->direction.x, b->direction.x, 0);
        assert_near(a->direction.y, -b->direction.y, 0);
    }
    cairn_shape_model_file_mirror(&twice);
    assert_same(m, &twice.model);
    cairn_shape_model_file_free(&made);
    cairn_shape_model_file_free(&twice);
}

static int32_t count_of_pieces(const char *text, const char *piece)
{
    int32_t count = 0;

    while ((text = strstr(text, piece)) != NULL) {
        text += strlen(piece);
        count++;
    }
    return count;
}

/* Of the first outline alone, whose samples are a sixteenth of it apart. */
static void test_parts_drawn(void **state)
{
    cairn_shape_model_file made = make();
    cairn_shape_model bad = made.model;
    cairn_oriented_point two[34];
    cairn_part_bundle_cut by_hand[3] = {{0, 8, 0}, {8, 16, 0}, {16, 24, 1}};
    char *text;

    (void)state;
    assert_ok(cairn_shape_model_file_draw_parts(&made.model, NULL, 0, "a <cross>",
                                                files_path("parts.svg"), &error));
    text = files_read(files_path("parts.svg"), NULL);
    assert_non_null(text);
    assert_well_formed(text);
    assert_non_null(strstr(text, "24 fragments in 4 bundles"));
    assert_int_equal(count_of_pieces(text, "class=\"fragment\""), 24);
    assert_int_equal(count_of_pieces(text, "class=\"outline\""), 24);
    assert_golden(picture_hash(text), UINT64_C(0xb951c8e4852b18c6), UINT64_C(0x19752312938a1631));
    free(text);
    /* A square, and a distant second outline. */
    for (int32_t i = 0; i < 34; i++) {
        int32_t side = i % 32 / 8, step = i % 8;

        two[i].direction.x = 1;
        two[i].direction.y = 0;
        two[i].position.x = (cairn_real)(side == 0   ? step
                                         : side == 1 ? 8
                                         : side == 2 ? 8 - step
                                                     : 0) /
                            10;
        two[i].position.y = (cairn_real)(side == 0   ? 0
                                         : side == 1 ? step
                                         : side == 2 ? 8
                                                     : 8 - step) /
                            10;
        two[i].position.x += i < 32 ? 0 : 10;
    }
    bad.outline = two;
    bad.outline_count = 34;
    assert_ok(
        cairn_shape_model_file_draw_parts(&bad, NULL, 0, "two", files_path("parts.svg"), &error));
    text = files_read(files_path("parts.svg"), NULL);
    assert_non_null(text);
    assert_int_equal(count_of_pieces(text, "class=\"fragment\""), 24);
    free(text);
    /* By hand: two sides in one bundle, a third in another; a sample that does not exist. */
    assert_ok(cairn_shape_model_file_draw_parts(&bad, by_hand, 3, "three", files_path("parts.svg"),
                                                &error));
    text = files_read(files_path("parts.svg"), NULL);
    assert_non_null(text);
    assert_non_null(strstr(text, "3 fragments in 2 bundles"));
    assert_int_equal(count_of_pieces(text, "class=\"fragment\""), 3);
    assert_golden(picture_hash(text), UINT64_C(0x4ab4bc608e7869ba), UINT64_C(0x4ab4bc608e7869ba));
    free(text);
    by_hand[1].to = 32;
    assert_status(
        cairn_shape_model_file_draw_parts(&bad, by_hand, 3, "three", files_path("a.svg"), &error),
        CAIRN_BAD_ARGUMENT);
    assert_non_null(strstr(error.text, "expected manual fragments within a first outline"));
    bad.outline_count = 2;
    assert_status(
        cairn_shape_model_file_draw_parts(&bad, NULL, 0, "a", files_path("a.svg"), &error),
        CAIRN_EMPTY);
    for (int32_t i = 0; i < 5; i++)
        two[i].position = two[0].position;
    bad.outline_count = 5;
    assert_status(
        cairn_shape_model_file_draw_parts(&bad, NULL, 0, "a", files_path("a.svg"), &error),
        CAIRN_EMPTY);
    bad.size = 0;
    assert_status(
        cairn_shape_model_file_draw_parts(&bad, NULL, 0, "a", files_path("a.svg"), &error),
        CAIRN_BAD_ARGUMENT);
    assert_status(cairn_shape_model_file_draw_parts(&made.model, NULL, 0, "a",
                                                    files_path("none/a.svg"), &error),
                  CAIRN_IO);
    cairn_shape_model_file_free(&made);
}

static void test_drawn(void **state)
{
    cairn_shape_model_file made = make();
    char *text;

    (void)state;
    assert_ok(
        cairn_shape_model_file_draw(&made.model, "a <cross>", files_path("cross.svg"), &error));
    text = files_read(files_path("cross.svg"), NULL);
    assert_non_null(text);
    assert_well_formed(text);
    assert_non_null(strstr(text, "a &lt;cross&gt;"));
    assert_int_equal(count_of(text, "class=\"axis\""), made.model.path_count);
    assert_int_equal(count_of(text, "class=\"at-left\""), made.model.sample_count);
    assert_int_equal(count_of(text, "class=\"at-right\""), made.model.sample_count);
    assert_int_equal(count_of(text, "class=\"outline\""), 1);
    assert_int_equal(count_of(text, "nan"), 0);
    assert_golden(picture_hash(text), UINT64_C(0x804212fb1f74fb96), UINT64_C(0x804212fb1f74fb96));
    free(text);
    cairn_shape_model_file_free(&made);
}

static void test_nothing_is_lost(void **state)
{
    cairn_shape_image_params image = cairn_shape_image_default();
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_shape_model_file file;
    size_t before = 0;

    (void)state;
    (void)write_picture();
    for (int round = 0; round < FILES_HEAP_ROUNDS; round++) {
        assert_ok(cairn_shape_model_file_load(&file, files_path("bar.png"), &image, &builder, NULL,
                                              &error));
        cairn_shape_model_file_free(&file);
        assert_refused(HEAD OUTLINE, CAIRN_TRUNCATED, 6, "a path");
        if (round == 4)
            before = files_heap();
    }
    assert_true(files_heap() <= before + FILES_HEAP_NOISE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_written_and_read),
        cmocka_unit_test(test_smallest_and_comments),
        cmocka_unit_test(test_every_line_is_checked),
        cmocka_unit_test(test_faults_of_the_model),
        cmocka_unit_test(test_what_cannot_be_read_or_written),
        cmocka_unit_test(test_outlines_that_make_no_model),
        cmocka_unit_test(test_gaps),
        cmocka_unit_test(test_load),
        cmocka_unit_test(test_mirror),
        cmocka_unit_test(test_drawn),
        cmocka_unit_test(test_parts_drawn),
        cmocka_unit_test(test_nothing_is_lost),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
