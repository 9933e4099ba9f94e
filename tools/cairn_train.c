/* cairn train: trains the appearance model of a class (bag of visual words and SVM) from images and
 * bounding boxes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/appearance_train.h"
#include "cairn/box_table.h"
#include "cairn/output.h"
#include "tools/cairn_picture.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn train"

enum { MAX_IMAGES = CAIRN_APPEARANCE_TRAIN_MAX_IMAGES };

typedef struct settings {
    const char *images[MAX_IMAGES];
    size_t count;
    const char *boxes, *output;
    int64_t words, negatives, side;
    double cost;
    uint64_t seed;
    int32_t json, quiet;
} settings;

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT(
            "--boxes", &s->boxes, "FILE",
            "bounding boxes of the objects (CSV: image,left,top,right,bottom; px), images by their "
            "names without folder"),
        OPTION_TEXT("-o", &s->output, "FILE",
                    "the trained model, a text file for cairn detect --appearance"),
        OPTION_INTEGER("--words", &s->words, 2, CAIRN_APPEARANCE_MAX_WORDS, "N",
                       "size of the dictionary of visual words"),
        OPTION_INTEGER("--negatives", &s->negatives, 1, 100, "N", "negative windows per box"),
        OPTION_INTEGER("--max-side", &s->side, 16, CAIRN_APPEARANCE_IMAGE_MAX_SIDE, "PX",
                       "maximum side of an image; larger ones are halved, as in cairn detect"),
        OPTION_NUMBER("--cost", &s->cost, 1e-6, 1e6, "C", "cost C of a misclassified window (SVM)"),
        OPTION_SEED("--seed", &s->seed, "seed of the dictionary and of the windows"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no progress, no summary"),
    };
    const option_set set = {PROGRAM, "IMAGE... --boxes FILE -o MODEL [options]",
                            "Trains the appearance model of a class: a dictionary of visual words "
                            "(patches) and a support "
                            "vector machine. An image without a box is a negative example.",
                            table, sizeof table / sizeof *table};
    option_result result;

    s->count = MAX_IMAGES;
    result = options_read(&set, argc, argv, s->images, &s->count);
    if (result != OPTIONS_READ)
        return result;
    if (s->count < 1 || s->boxes == NULL || s->output == NULL)
        return (option_result)options_refuse(PROGRAM, "%s, expected %s",
                                             s->count < 1       ? "no image"
                                             : s->boxes == NULL ? "no boxes (--boxes)"
                                                                : "no file to write to (-o)",
                                             set.synopsis);
    return OPTIONS_READ;
}

/* Checks that every box belongs to a given image; reports the first one in the file that does not.
 * Rows are sorted. */
static int check_rows(const settings *s, const cairn_box_table_row *row, int32_t count)
{
    uint8_t *is_known = calloc((size_t)count + 1, sizeof *is_known);
    const cairn_box_table_row *unknown = NULL;

    if (is_known == NULL) {
        fprintf(stderr, "%s: no memory\n", s->boxes);
        return TOOL_FAILED;
    }
    for (size_t k = 0; k < s->count; k++) {
        int32_t own,
            first = cairn_box_table_find(row, count, cairn_output_path_name(s->images[k]), &own);

        memset(&is_known[first], 1, (size_t)own);
    }
    for (int32_t i = 0; i < count; i++)
        if (!is_known[i] && (unknown == NULL || row[i].line < unknown->line))
            unknown = &row[i];
    free(is_known);
    if (unknown == NULL)
        return TOOL_OK;
    fprintf(stderr, "%s:%lld: a box in '%s', expected one of the images given\n", s->boxes,
            (long long)unknown->line, unknown->image);
    return TOOL_BAD;
}

/* Adds an image and its boxes, both downsampled by the same factor. */
static cairn_status add_image(const settings *s, cairn_appearance_trainer *trainer,
                              const char *path, const cairn_box_table_row *row, int32_t count,
                              cairn_file_error *error)
{
    int32_t own, first = cairn_box_table_find(row, count, cairn_output_path_name(path), &own);
    double *boxes = malloc(((size_t)own + 1) * 4 * sizeof *boxes);
    cairn_vision_image grey;
    cairn_status status;

    if (boxes == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory");
    status = cairn_vision_read_grey(&grey, path, error);
    if (status == CAIRN_OK) {
        int32_t shrink = picture_shrink(&grey, s->side);

        for (int32_t i = 0; i < 4 * own; i++)
            boxes[i] = row[first + i / 4].box[i % 4] / shrink;
        status = cairn_appearance_trainer_add(trainer, grey.samples, grey.width, grey.height, boxes,
                                              own, path, error);
        cairn_vision_free(&grey);
    }
    free(boxes);
    return status;
}

/* Checks before the training that the output file can be written. */
static int check_output(const settings *s)
{
    cairn_file_error error;
    cairn_output *output;

    if (cairn_output_open(&output, s->output, &error) != CAIRN_OK)
        return tool_report(&error);
    cairn_output_discard(output);
    return TOOL_OK;
}

static void print_json(const settings *s, int32_t boxes, const cairn_appearance_model *model)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_text(&json, "model", s->output);
    cairn_json_write_integer(&json, "images", (int64_t)s->count);
    cairn_json_write_integer(&json, "boxes", boxes);
    cairn_json_write_integer(&json, "words", model->word_count);
    cairn_json_write_integer(&json, "support_vectors", model->support_count);
    cairn_json_write_end(&json);
}

static int run(const settings *s, const cairn_box_table_row *row, int32_t count)
{
    cairn_appearance_train_params params = cairn_appearance_train_default();
    cairn_appearance_trainer *trainer = cairn_appearance_trainer_new();
    tool_progress progress = tool_progress_begin("images", (int64_t)s->count, s->quiet);
    cairn_appearance_model model = {0};
    cairn_file_error error;
    cairn_status status =
        trainer != NULL ? CAIRN_OK
                        : cairn_file_error_set(&error, CAIRN_NO_MEMORY, s->output, 0, "no memory");

    params.words = (int32_t)s->words;
    params.negatives = (int32_t)s->negatives;
    params.cost = s->cost;
    params.seed = s->seed;
    for (size_t i = 0; i < s->count && status == CAIRN_OK; i++) {
        status = add_image(s, trainer, s->images[i], row, count, &error);
        tool_progress_at(&progress, (int64_t)i + 1);
    }
    tool_progress_end(&progress);
    if (status == CAIRN_OK)
        status = cairn_appearance_train(&model, trainer, &params, s->boxes, &error);
    cairn_appearance_trainer_free(trainer);
    if (status == CAIRN_OK)
        status = cairn_appearance_file_write(&model, s->output, &error);
    if (status == CAIRN_OK && s->json)
        print_json(s, count, &model);
    else if (status == CAIRN_OK && !s->quiet)
        printf("%zu image%s, %d box%s: %d words, %d support vectors\n", s->count,
               s->count == 1 ? "" : "s", (int)count, count == 1 ? "" : "es", (int)model.word_count,
               (int)model.support_count);
    cairn_appearance_file_free(&model);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

int tool_train(int argc, char **argv)
{
    static settings s;
    cairn_appearance_train_params params = cairn_appearance_train_default();
    cairn_file_error error;
    cairn_box_table_row *row;
    option_result result;
    int32_t count;
    int code;

    memset(&s, 0, sizeof s);
    s.words = params.words;
    s.negatives = params.negatives;
    s.cost = params.cost;
    s.seed = params.seed;
    s.side = PICTURE_SIDE;
    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return (int)result;
    code = picture_check_names(PROGRAM, s.images, s.count);
    if (code != TOOL_OK)
        return code;
    if (cairn_box_table_read(s.boxes, &row, &count, &error) != CAIRN_OK)
        return tool_report(&error);
    cairn_box_table_sort(row, count);
    code = check_rows(&s, row, count);
    if (code == TOOL_OK)
        code = check_output(&s);
    if (code == TOOL_OK && cairn_appearance_image_load(&error) != CAIRN_OK)
        code = tool_report(&error);
    if (code == TOOL_OK)
        code = run(&s, row, count);
    free(row);
    return code;
}
