/* cairn train: what a class looks like, from images and boxes about its objects. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/appearance.h"
#include "cairn/box_table.h"
#include "cairn/output.h"
#include "tools/cairn_picture.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn train"

enum { IMAGES_MOST = CAIRN_APPEARANCE_IMAGES_MOST };

typedef struct settings {
    const char *images[IMAGES_MOST];
    size_t count;
    const char *boxes, *output;
    int64_t words, negatives;
    double cost;
    uint64_t seed;
    int32_t quiet;
} settings;

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("--boxes", &s->boxes, "FILE",
                    "the class's objects (CSV: image,left,top,right,bottom; px), images by their names without folder"),
        OPTION_TEXT("-o", &s->output, "FILE", "what was learnt, a text file for cairn detect --appearance"),
        OPTION_INTEGER("--words", &s->words, 2, CAIRN_APPEARANCE_WORDS_MOST, "N", "of the dictionary"),
        OPTION_INTEGER("--negatives", &s->negatives, 1, 100, "N", "windows beside the objects, for each box"),
        OPTION_NUMBER("--cost", &s->cost, 1e-6, 1e6, "C", "of a window on the wrong side"),
        OPTION_SEED("--seed", &s->seed, "of the dictionary and of the windows"),
        OPTION_FLAG("--quiet", &s->quiet, "no progress, no summary"),
    };
    const option_set set = {PROGRAM, "IMAGE... --boxes FILE -o MODEL [options]",
                            "Learns what a class of objects looks like: a dictionary of patches and a support vector\n"
                            "machine. An image without a box shows what the class is not.",
                            table, sizeof table / sizeof *table};
    option_result result;

    s->count = IMAGES_MOST;
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

/* Every box must be of an image, or it would be missed in silence. */
static int check_rows(const settings *s, const cairn_box_row *row, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        size_t k = 0;

        while (k < s->count && strcmp(cairn_path_name(s->images[k]), row[i].image) != 0)
            k++;
        if (k == s->count) {
            fprintf(stderr, "%s:%lld: a box in '%s', expected one of the images given\n", s->boxes,
                    (long long)row[i].line, row[i].image);
            return TOOL_BAD;
        }
    }
    return TOOL_OK;
}

static cairn_status add_image(cairn_appearance_trainer *trainer, const char *path, const cairn_box_row *row,
                              int32_t count, cairn_file_error *error)
{
    double *boxes = malloc(((size_t)count + 1) * 4 * sizeof *boxes);
    cairn_vision_image grey;
    int32_t own = 0;
    cairn_status status;

    if (boxes == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory");
    status = cairn_vision_read_grey(&grey, path, error);
    if (status == CAIRN_OK) {
        for (int32_t i = 0; i < count; i++)
            if (strcmp(cairn_path_name(path), row[i].image) == 0)
                memcpy(&boxes[4 * own++], row[i].box, 4 * sizeof *boxes);
        status = cairn_appearance_trainer_add(trainer, grey.samples, grey.width, grey.height, boxes, own, path, error);
        cairn_vision_free(&grey);
    }
    free(boxes);
    return status;
}

static int run(const settings *s, const cairn_box_row *row, int32_t count)
{
    cairn_appearance_params params = cairn_appearance_default();
    cairn_appearance_trainer *trainer = cairn_appearance_trainer_new();
    tool_progress progress = tool_progress_begin("images", (int64_t)s->count, s->quiet);
    cairn_appearance_model model = {0};
    cairn_file_error error;
    cairn_status status =
        trainer != NULL ? CAIRN_OK : cairn_file_error_set(&error, CAIRN_NO_MEMORY, s->output, 0, "no memory");

    params.words = (int32_t)s->words;
    params.negatives = (int32_t)s->negatives;
    params.cost = s->cost;
    params.seed = s->seed;
    for (size_t i = 0; i < s->count && status == CAIRN_OK; i++) {
        status = add_image(trainer, s->images[i], row, count, &error);
        tool_progress_at(&progress, (int64_t)i + 1);
    }
    tool_progress_end(&progress);
    if (status == CAIRN_OK)
        status = cairn_appearance_train(&model, trainer, &params, s->boxes, &error);
    cairn_appearance_trainer_free(trainer);
    if (status == CAIRN_OK)
        status = cairn_appearance_write(&model, s->output, &error);
    if (status == CAIRN_OK && !s->quiet)
        printf("%zu image%s, %d box%s: %d words, %d support vectors\n", s->count, s->count == 1 ? "" : "s", (int)count,
               count == 1 ? "" : "es", (int)model.word_count, (int)model.support_count);
    cairn_appearance_free(&model);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

int tool_train(int argc, char **argv)
{
    static settings s;
    cairn_appearance_params params = cairn_appearance_default();
    cairn_file_error error;
    cairn_box_row *row;
    option_result result;
    int32_t count;
    int code;

    memset(&s, 0, sizeof s);
    s.words = params.words;
    s.negatives = params.negatives;
    s.cost = params.cost;
    s.seed = params.seed;
    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return (int)result;
    code = picture_check_names(PROGRAM, s.images, s.count);
    if (code != TOOL_OK)
        return code;
    if (cairn_box_table_read(s.boxes, &row, &count, &error) != CAIRN_OK)
        return tool_report(&error);
    code = check_rows(&s, row, count);
    if (code == TOOL_OK && cairn_appearance_load(&error) != CAIRN_OK)
        code = tool_report(&error);
    if (code == TOOL_OK)
        code = run(&s, row, count);
    free(row);
    return code;
}
