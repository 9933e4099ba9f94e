/* cairn-scene: an image of a known object in clutter, by name and seed, with its truth, as files.
 *
 * Method:
 * 1. The outline of the object is drawn by hand (sim/outlines.c).
 * 2. The image: 1/f noise as background, clutter, the object at a random place, size and turn, a
 *    disc that hides a share of its boundary, noise (bench/bench_scene.c).
 * 3. The same outline alone, as a silhouette and as a drawing, from which a model is made. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench/bench_scene.h"
#include "cairn/output.h"
#include "cairn/output_set.h"
#include "sim/outlines.h"
#include "src/host/base/json_writer.h"
#include "tools/options.h"

#define PROGRAM "cairn-scene"

static const double radians_per_degree = 3.14159265358979323846 / 180;

/* px: side of the silhouette and the drawing, and of the object's square in them */
enum { MODEL_SIDE = 300, MODEL_SQUARE = 260 };

enum { SCENE_IMAGE, SCENE_TRUTH, SILHOUETTE, DRAWING, FILE_COUNT };
static const char *const file_names[FILE_COUNT] = {"scene.pgm", "truth.json", "silhouette.pgm",
                                                   "drawing.pgm"};

typedef struct command {
    const char *folder;
    uint64_t seed;
    int32_t clutter, json;
    double noise, hidden, max_turn;
} command;

static void write_pgm(cairn_output *output, const uint8_t *pixel, int32_t width, int32_t height)
{
    cairn_output_print(output, "P5\n%d %d\n255\n", (int)width, (int)height);
    cairn_output_bytes(output, pixel, (size_t)width * (size_t)height);
}

static void write_scene(cairn_output *output, const scene *s)
{
    static uint8_t pixel[SCENE_PIXELS];

    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        pixel[i] = (uint8_t)lrint(fmin(255, fmax(0, (double)s->grey[i])));
    write_pgm(output, pixel, SCENE_WIDTH, SCENE_HEIGHT);
}

/* The object in the frame of the image: its curves as polygons, px. */
static void write_truth(cairn_output *output, const scene *s, const outline_object *object,
                        const char *name, const command *c)
{
    double cosine = cos(s->turn) * s->size, sine = sin(s->turn) * s->size;

    cairn_output_print(output,
                       "{\"object\": \"%s\", \"seed\": %llu, \"width\": %d, \"height\": %d, "
                       "\"centre\": [%.3f, %.3f], \"size\": %.3f, \"turn_deg\": %.4f, "
                       "\"box\": [%.0f, %.0f, %.0f, %.0f], \"hidden\": %.9g,\n\"outlines\": [",
                       name, (unsigned long long)c->seed, SCENE_WIDTH, SCENE_HEIGHT, s->at[0],
                       s->at[1], s->size, s->turn / radians_per_degree, s->box[0], s->box[1],
                       s->box[2], s->box[3], c->hidden);
    for (int32_t k = 0; k < object->count; k++) {
        cairn_output_print(output, "%s[", k > 0 ? ",\n" : "");
        for (int32_t i = 0; i < object->curve[k].count; i++) {
            const double *p = object->curve[k].point[i];

            cairn_output_print(output, "%s[%.2f, %.2f]", i > 0 ? ", " : "",
                               s->at[0] + cosine * p[0] - sine * p[1],
                               s->at[1] + sine * p[0] + cosine * p[1]);
        }
        cairn_output_print(output, "]");
    }
    cairn_output_print(output, "]}\n");
}

static int is_inside(const outline_object *object, int32_t x, int32_t y)
{
    return outline_contains(object, (x - 0.5 * MODEL_SIDE) / MODEL_SQUARE,
                            (y - 0.5 * MODEL_SIDE) / MODEL_SQUARE);
}

/* Black on white: the object filled, or the pixels of it that touch the background. */
static void write_model(cairn_output *output, const outline_object *object, int32_t filled)
{
    static uint8_t pixel[MODEL_SIDE * MODEL_SIDE];

    for (int32_t y = 0; y < MODEL_SIDE; y++)
        for (int32_t x = 0; x < MODEL_SIDE; x++) {
            int inside = is_inside(object, x, y);

            if (inside && !filled)
                inside = !is_inside(object, x - 1, y) || !is_inside(object, x + 1, y) ||
                         !is_inside(object, x, y - 1) || !is_inside(object, x, y + 1);
            pixel[y * MODEL_SIDE + x] = inside ? 0 : 255;
        }
    write_pgm(output, pixel, MODEL_SIDE, MODEL_SIDE);
}

static cairn_status write_file(int32_t which, const char *path, const scene *s,
                               const outline_object *object, const char *name, const command *c,
                               cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    if (which == SCENE_IMAGE)
        write_scene(output, s);
    else if (which == SCENE_TRUTH)
        write_truth(output, s, object, name, c);
    else
        write_model(output, object, which == SILHOUETTE);
    return cairn_output_commit(output, error);
}

static void print_json(const command *c, const char *name, const scene *s)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_text(&json, "object", name);
    cairn_json_write_integer(&json, "width_px", SCENE_WIDTH);
    cairn_json_write_integer(&json, "height_px", SCENE_HEIGHT);
    cairn_json_write_array(&json, "box_px");
    for (int32_t k = 0; k < 4; k++)
        cairn_json_write_number(&json, NULL, s->box[k]);
    cairn_json_write_array_end(&json);
    cairn_json_write_number(&json, "size_px", s->size);
    cairn_json_write_number(&json, "turn_deg", s->turn / radians_per_degree);
    cairn_json_write_text(&json, "folder", c->folder);
    cairn_json_write_array(&json, "files");
    for (int32_t i = 0; i < FILE_COUNT; i++)
        cairn_json_write_text(&json, NULL, file_names[i]);
    cairn_json_write_array_end(&json);
    cairn_json_write_end(&json);
}

static int run(const command *c, const char *name)
{
    static outline_object object;
    static scene s;
    scene_figure figure = {outline_contains, &object, c->max_turn};
    scene_options options = {.clutter = c->clutter, .noise = c->noise, .hidden = c->hidden};
    int32_t index = outline_find(name);
    cairn_random random = cairn_random_seed(c->seed, 0);
    cairn_output_set *set;
    cairn_file_error error;
    cairn_status status;

    if (index < 0)
        return options_refuse(
            PROGRAM, "there is no object '%s', expected one of those that --help lists", name);
    if (c->folder == NULL)
        return options_refuse(PROGRAM, "no output folder, expected -o DIR");
    outline_draw(&object, index);
    scene_draw_figure(&s, &figure, &options, &random);
    status = cairn_output_set_open(&set, c->folder, file_names, FILE_COUNT, &error);
    if (status != CAIRN_OK)
        return options_refuse(PROGRAM, "%s", error.text);
    for (int32_t i = 0; i < FILE_COUNT && status == CAIRN_OK; i++)
        status = write_file(i, cairn_output_set_path(set, i), &s, &object, name, c, &error);
    if (status == CAIRN_OK)
        status = cairn_output_set_commit(set, &error);
    else
        cairn_output_set_discard(set);
    if (status == CAIRN_OK && c->json)
        print_json(c, name, &s);
    return status == CAIRN_OK ? 0 : options_refuse(PROGRAM, "%s", error.text);
}

int main(int argc, char **argv)
{
    command c = {.seed = 1, .clutter = 8, .noise = 8, .max_turn = 10};
    const option table[] = {
        OPTION_TEXT("-o", &c.folder, "DIR", "folder to write to; it is made when it is not there"),
        OPTION_SEED("--seed", &c.seed, "same seed and options, same bytes"),
        OPTION_COUNT("--clutter", &c.clutter, 0, 1000, "N", "ellipses, boxes and wedges around"),
        OPTION_NUMBER("--noise", &c.noise, 0, 100, "S", "standard deviation, grey levels"),
        OPTION_NUMBER("--hidden", &c.hidden, 0, 0.9, "SHARE",
                      "of the boundary behind a disc, 0 to 0.9"),
        OPTION_NUMBER("--turn", &c.max_turn, 0, 180, "DEG", "largest turn of the object"),
        OPTION_JSON(&c.json),
    };
    char text[600];
    option_set set = {PROGRAM, "OBJECT -o DIR [options]", text, table,
                      sizeof table / sizeof *table};
    size_t used = (size_t)snprintf(
        text, sizeof text,
        "Draws a known object in clutter: DIR/scene.pgm (400 x 300 grey levels), DIR/truth.json "
        "(its place,\nbox and outlines in pixels), and the object alone, from which a model is "
        "made:\nDIR/silhouette.pgm, DIR/drawing.pgm.\n\nobjects:");
    const char *name;
    size_t given = 1;
    option_result result;

    for (int32_t i = 0; i < OUTLINE_OBJECTS && used < sizeof text; i++)
        used += (size_t)snprintf(text + used, sizeof text - used, " %s", outline_name(i));
    cairn_output_clean_up_on_signals();
    result = options_read(&set, argc, argv, &name, &given);
    if (result != OPTIONS_READ)
        return options_end(PROGRAM, result);
    if (given == 0)
        return options_refuse(PROGRAM, "no object, expected one of those that --help lists");
    return options_end(PROGRAM, run(&c, name));
}
