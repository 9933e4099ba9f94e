/* Objects in images as COCO annotations, masks and label images. */
#include "tests/test.h"

#include <unistd.h>

#include "cairn/json_text.h"
#include "src/host/files/map_file_image.h"
#include "tests/files.h"
#include "tools/cairn_objects.h"

enum { WIDTH = 12, HEIGHT = 10, MOST_VERTICES = 8 };

static cairn_contour_search_place vertex(double x, double y, int32_t outline)
{
    cairn_contour_search_place place;

    memset(&place, 0, sizeof place);
    place.point.position.x = (cairn_real)x;
    place.point.position.y = (cairn_real)y;
    place.outline_index = outline;
    return place;
}

/* The corners of a rectangle, clockwise or not as the image is seen. */
static void rectangle(cairn_contour_search_place *to, double left, double top, double right,
                      double bottom, int32_t outline, int reversed)
{
    to[0] = vertex(left, top, outline);
    to[reversed ? 3 : 1] = vertex(right, top, outline);
    to[2] = vertex(right, bottom, outline);
    to[reversed ? 1 : 3] = vertex(left, bottom, outline);
}

/* Object 1: a frame of 6 x 6 pixels with a hole of 2 x 2. Object 2: two rectangles, the first of
 * them partly behind object 1. */
static void make_objects(objects_image *image)
{
    cairn_contour_search_place outline[MOST_VERTICES];
    objects_shape *shape;

    *image = (objects_image){"folder/a \"b\".png", 3, WIDTH, HEIGHT, NULL, 0};
    rectangle(outline, 0.6, 1.6, 6.4, 7.4, 0, 0);
    rectangle(outline + 4, 2.6, 3.6, 4.4, 5.4, 1, 1);
    shape = objects_append_outline(image, outline, 8, 1);
    assert_non_null(shape);
    shape->score = 0.75;
    rectangle(outline, 4.6, 6.6, 8.4, 8.4, 0, 0);
    rectangle(outline + 4, 9.6, -3.4, 20, 2.4, 1, 0);
    shape = objects_append_outline(image, outline, 8, 1);
    assert_non_null(shape);
    shape->score = -0.5;
}

static void assert_png(const char *name, const char *const *rows)
{
    cairn_file_error error;
    cairn_image image;

    assert_ok(cairn_image_read(&image, files_path(name), &error));
    assert_int_equal(image.width, WIDTH);
    assert_int_equal(image.height, HEIGHT);
    for (int32_t y = 0; y < HEIGHT; y++)
        for (int32_t x = 0; x < WIDTH; x++) {
            char c = rows[y][x];
            int expected = c == '.' ? 0 : c == '#' ? 255 : c - '0';

            if (image.pixel[y * WIDTH + x] != expected)
                fail_msg("%s: pixel %d, %d is %d, expected %d", name, (int)x, (int)y,
                         image.pixel[y * WIDTH + x], expected);
        }
    cairn_image_free(&image);
}

static void masks_have_holes_and_labels_the_better_object(void **state)
{
    static const char *const first[HEIGHT] = {
        "............", "............", ".######.....", ".######.....", ".##..##.....",
        ".##..##.....", ".######.....", ".######.....", "............", "............"};
    static const char *const second[HEIGHT] = {
        "..........##", "..........##", "..........##", "............", "............",
        "............", "............", ".....####...", ".....####...", "............"};
    static const char *const labels[HEIGHT] = {
        "..........22", "..........22", ".111111...22", ".111111.....", ".11..11.....",
        ".11..11.....", ".111111.....", ".11111122...", ".....2222...", "............"};
    cairn_file_error error;
    objects_image image;

    (void)state;
    make_objects(&image);
    assert_ok(objects_write_masks(&image, files_path("masks"), "a", &error));
    assert_png("masks/a-mask-1.png", first);
    assert_png("masks/a-mask-2.png", second);
    assert_png("masks/a-labels.png", labels);
    /* Of an earlier run with more objects no mask stays. */
    (void)files_write_text("masks/a-mask-3.png", "old");
    (void)files_write_text("masks/a-mask-4.png", "old");
    (void)files_write_text("masks/b-mask-3.png", "kept");
    assert_ok(objects_write_masks(&image, files_path("masks"), "a", &error));
    assert_int_not_equal(access(files_path("masks/a-mask-3.png"), F_OK), 0);
    assert_int_not_equal(access(files_path("masks/a-mask-4.png"), F_OK), 0);
    assert_int_equal(access(files_path("masks/b-mask-3.png"), F_OK), 0);
    objects_free(&image);
}

static void coco_has_polygons_and_runs(void **state)
{
    cairn_file_error error;
    objects_image image;
    objects_coco coco;
    cairn_json json;
    cairn_json_token token;
    char *text;

    (void)state;
    make_objects(&image);
    assert_ok(objects_coco_open(&coco, files_path("new/coco.json"), &error));
    objects_print_image(&image, coco.images.stream);
    assert_ok(objects_print_annotations(&image, coco.annotations.stream));
    assert_ok(objects_coco_commit(&coco, "cairn test", "models/mug.shape", &error));
    text = files_read(files_path("new/coco.json"), NULL);
    assert_non_null(text);
    json = cairn_json_begin("json", text, strlen(text));
    do
        assert_ok(cairn_json_next(&json, &token, &error));
    while (token.kind != CAIRN_JSON_END);
    assert_string_equal(
        text,
        "{\"info\": {\"description\": \"cairn test\"},\n"
        " \"images\": [\n"
        "  {\"id\": 3, \"file_name\": \"a \\u0022b\\u0022.png\", \"width\": 12, \"height\": 10}],\n"
        " \"annotations\": [\n"
        "  {\"id\": 300000, \"image_id\": 3, \"category_id\": 1, \"iscrowd\": 0, \"score\": 0.75, "
        "\"area\": 32, \"bbox\": [1.10, 2.10, 5.80, 5.80], \"segmentation\": {\"size\": [10, 12], "
        "\"counts\": [12, 6, 4, 6, 4, 2, 2, 2, 4, 2, 2, 2, 4, 6, 4, 6, 52]}},\n"
        "  {\"id\": 300001, \"image_id\": 3, \"category_id\": 1, \"iscrowd\": 0, \"score\": -0.5, "
        "\"area\": 14, \"bbox\": [5.10, 0.50, 6.90, 8.40], \"segmentation\": [[5.10, 7.10, 8.90, "
        "7.10, 8.90, 8.90, 5.10, 8.90], [10.10, -2.90, 20.50, -2.90, 20.50, 2.90, 10.10, "
        "2.90]]}],\n"
        " \"categories\": [{\"id\": 1, \"name\": \"mug\"}]}\n");
    free(text);
    objects_free(&image);
}

/* Without any object the arrays are empty, and there is a label image. */
static void no_object(void **state)
{
    cairn_file_error error;
    objects_image image = {"none.png", 1, WIDTH, HEIGHT, NULL, 0};
    objects_coco coco;
    char *text;

    (void)state;
    assert_ok(objects_coco_open(&coco, files_path("none.json"), &error));
    objects_print_image(&image, coco.images.stream);
    assert_ok(objects_print_annotations(&image, coco.annotations.stream));
    assert_ok(objects_coco_commit(&coco, "cairn test", "mug", &error));
    text = files_read(files_path("none.json"), NULL);
    assert_non_null(strstr(text, "\"annotations\": [],"));
    free(text);
    assert_ok(objects_write_masks(&image, files_path("masks"), "none", &error));
    assert_int_equal(access(files_path("masks/none-labels.png"), F_OK), 0);
    assert_int_not_equal(access(files_path("masks/none-mask-1.png"), F_OK), 0);
    /* A file that is discarded is not written. */
    assert_ok(objects_coco_open(&coco, files_path("discarded.json"), &error));
    objects_coco_discard(&coco);
    assert_int_not_equal(access(files_path("discarded.json"), F_OK), 0);
    assert_int_equal(objects_coco_open(&coco, files_path("none.json/coco.json"), &error), CAIRN_IO);
}

/* Points of a halved image lie at twice the place, half a pixel shifted. */
static void points_of_a_halved_image(void **state)
{
    cairn_contour_search_place outline = vertex(1, 2, 0);
    cairn_segment line = {{1, 2}, {3, 4}};
    int32_t index = 0;
    objects_image image = {"a.png", 1, WIDTH, HEIGHT, NULL, 0};
    const objects_shape *shape = objects_append_outline(&image, &outline, 1, 2);

    (void)state;
    assert_near(shape->point[0].x, 2.5, 0);
    assert_near(shape->point[0].y, 4.5, 0);
    shape = objects_append_segments(&image, &line, &index, 1, 2);
    assert_int_equal(shape->count, 2);
    assert_near(shape->point[1].x, 6.5, 0);
    assert_near(shape->box[3], 8.5, 0);
    objects_free(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(masks_have_holes_and_labels_the_better_object),
        cmocka_unit_test(coco_has_polygons_and_runs),
        cmocka_unit_test(no_object),
        cmocka_unit_test(points_of_a_halved_image),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
