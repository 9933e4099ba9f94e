/* Shape models as text files: a line-oriented parser and a writer. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/shape_model_file.h"
#include "src/host/base/interruption.h"
#include "src/host/logs/carmen_log_reader.h"

/* First word of a model file. */
#define FILE_SIGNATURE "cairn-shape"

/* Numbers of a line of the outline, of a path, and of any line. */
enum { FORMAT_VERSION = 1, OUTLINE_NUMBERS = 4, SAMPLE_NUMBERS = 14, MAX_NUMBERS = 16 };

void cairn_shape_model_file_free(cairn_shape_model_file *file)
{
    free(file->samples);
    free(file->paths);
    free(file->outline);
    memset(file, 0, sizeof *file);
}

/* Allocates the arrays of a model; 0: out of memory. */
static int allocate(cairn_shape_model_file *file, size_t samples, size_t outline)
{
    file->samples = calloc(samples, sizeof *file->samples);
    file->paths = calloc(CAIRN_SHAPE_MODEL_MAX_PATHS, sizeof *file->paths);
    file->outline = calloc(outline, sizeof *file->outline);
    file->model.samples = file->samples;
    file->model.paths = file->paths;
    file->model.outline = file->outline;
    return file->samples != NULL && file->paths != NULL && file->outline != NULL;
}

static cairn_status no_memory(const char *path, const char *what, cairn_file_error *error)
{
    return cairn_file_error_system(error, path, what, ENOMEM);
}

/* ---- From outlines ---- */

cairn_status cairn_shape_model_file_copy(cairn_shape_model_file *file,
                                         const cairn_shape_model *model)
{
    memset(file, 0, sizeof *file);
    if (!allocate(file, (size_t)model->sample_count, (size_t)model->outline_count)) {
        cairn_shape_model_file_free(file);
        return CAIRN_NO_MEMORY;
    }
    memcpy(file->samples, model->samples, (size_t)model->sample_count * sizeof *file->samples);
    memcpy(file->paths, model->paths, (size_t)model->path_count * sizeof *file->paths);
    memcpy(file->outline, model->outline, (size_t)model->outline_count * sizeof *file->outline);
    file->model = *model;
    file->model.samples = file->samples;
    file->model.paths = file->paths;
    file->model.outline = file->outline;
    return CAIRN_OK;
}

/* Runs the builder to its end. */
static cairn_status build(cairn_shape_model_builder *builder, const cairn_curve *outlines,
                          int32_t count)
{
    cairn_status status = cairn_shape_model_builder_begin(builder, outlines, count);
    cairn_budget budget;

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_shape_model_builder_step(builder, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    return status;
}

cairn_status cairn_shape_model_file_build(cairn_shape_model_file *file, const cairn_curve *outlines,
                                          int32_t count,
                                          const cairn_shape_model_builder_params *params,
                                          const char *path, cairn_file_error *error)
{
    size_t bytes = cairn_shape_model_builder_memory(params) + CAIRN_ALIGN;
    cairn_shape_model_builder *builder;
    cairn_shape_model model;
    cairn_status status;
    cairn_pool pool;
    void *memory = malloc(bytes);

    memset(file, 0, sizeof *file);
    if (memory == NULL)
        return no_memory(path, "make a model of", error);
    status = cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_shape_model_builder_create(&builder, &pool, params);
    if (status == CAIRN_OK)
        status = build(builder, outlines, count);
    if (status != CAIRN_OK) {
        (void)cairn_file_error_set(error, status, path, 0, "no model can be made (%s), expected %s",
                                   cairn_status_text(status),
                                   status == CAIRN_EMPTY ? "an object with symmetric parts"
                                                         : "outlines of one object");
    } else {
        model = cairn_shape_model_builder_read(builder);
        status = cairn_shape_model_file_copy(file, &model);
        if (status != CAIRN_OK)
            (void)no_memory(path, "make a model of", error);
    }
    free(memory);
    return status;
}

/* ---- Reading ---- */

/* State of the parser. */
typedef struct shape_reader {
    cairn_line_reader *lines;
    const char *path;
    cairn_file_error *error;
    const char *word; /* the first word of the current line */
    size_t length;
    double number[MAX_NUMBERS]; /* the numbers behind it, or all numbers of the line */
    int32_t count;
    int64_t *outline_line, *sample_line; /* lines of the samples and paths */
    int64_t path_line[CAIRN_SHAPE_MODEL_MAX_PATHS];
} shape_reader;

static int64_t line_of(const shape_reader *reader)
{
    return cairn_line_reader_number(reader->lines);
}

/* Parses the numbers of a line from `at` on. */
static cairn_status read_numbers(shape_reader *reader, const char *at, const char *end)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length;

    for (reader->count = 0; (length = cairn_token_next(&at, end, &token)) > 0; reader->count++) {
        if (reader->count == MAX_NUMBERS)
            return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path,
                                        line_of(reader),
                                        "more than %d numbers, expected one sample", MAX_NUMBERS);
        if (!cairn_number_read(token, length, &reader->number[reader->count]))
            return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path,
                                        line_of(reader), "%s, expected a number",
                                        cairn_token_text(shown, token, length));
    }
    return CAIRN_OK;
}

/* Reads the next line that is neither blank nor a comment. named: 1: it begins with a word.
 * CAIRN_EMPTY: the end of the file. */
static cairn_status next_line(shape_reader *reader, int named)
{
    const char *line, *at, *end, *comment;
    cairn_status status;
    size_t length;

    do {
        status = cairn_line_reader_next(reader->lines, &line, &length, reader->error);
        if (status == CAIRN_FULL)
            return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path,
                                        line_of(reader),
                                        "a line of %zu bytes, expected a shape model", length);
        if (status != CAIRN_OK)
            return status;
        comment = memchr(line, '#', length);
        end = comment != NULL ? comment : line + length;
        at = line;
        reader->length = cairn_token_next(&at, end, &reader->word);
    } while (reader->length == 0);
    return read_numbers(reader, named ? at : line, end);
}

/* Turns the end of the file into CAIRN_TRUNCATED. */
static cairn_status report_end(const shape_reader *reader, cairn_status status,
                               const char *expected)
{
    return status != CAIRN_EMPTY
               ? status
               : cairn_file_error_set(reader->error, CAIRN_TRUNCATED, reader->path, line_of(reader),
                                      "the file ends, expected %s", expected);
}

static int is_word(const shape_reader *reader, const char *word)
{
    return reader->length == strlen(word) && memcmp(reader->word, word, reader->length) == 0;
}

/* Reads the next line, which must have a given first word and `count` numbers. */
static cairn_status next_named(shape_reader *reader, const char *word, int32_t count,
                               const char *expected)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    cairn_status status = next_line(reader, 1);

    if (status != CAIRN_OK)
        return report_end(reader, status, expected);
    if (!is_word(reader, word) || reader->count != count)
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                                    "%s and %d numbers, expected %s",
                                    cairn_token_text(shown, reader->word, reader->length),
                                    (int)reader->count, expected);
    return CAIRN_OK;
}

/* Reads the next line, which must have `count` numbers. */
static cairn_status next_sample(shape_reader *reader, int32_t count, const char *expected)
{
    cairn_status status = next_line(reader, 0);

    if (status != CAIRN_OK)
        return report_end(reader, status, expected);
    if (reader->count != count)
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                                    "%d numbers, expected %s", (int)reader->count, expected);
    return CAIRN_OK;
}

/* Returns 1 when a number is an integer from `minimum` to `maximum`. */
static int is_integer_within(double number, double minimum, double maximum)
{
    return number >= minimum && number <= maximum && number == (double)(int64_t)number;
}

static cairn_oriented_point point_of(const double *number)
{
    cairn_oriented_point point = {{(cairn_real)number[0], (cairn_real)number[1]},
                                  {(cairn_real)number[2], (cairn_real)number[3]}};

    return point;
}

/* Reads the version, the size and the origin. */
static cairn_status read_header(shape_reader *reader, cairn_shape_model *model)
{
    cairn_status status = next_named(reader, FILE_SIGNATURE, 1,
                                     "\"" FILE_SIGNATURE " 1\", the header of a shape model");

    if (status == CAIRN_OK && !(reader->number[0] == FORMAT_VERSION))
        return cairn_file_error_set(reader->error, CAIRN_UNSUPPORTED, reader->path, line_of(reader),
                                    "version %g, expected %d", reader->number[0], FORMAT_VERSION);
    if (status == CAIRN_OK)
        status = next_named(reader, "size", 1, "\"size\" and a number");
    model->size = (cairn_real)reader->number[0];
    if (status == CAIRN_OK)
        status = next_named(reader, "origin", 2, "\"origin\" and two numbers");
    model->origin.x = (cairn_real)reader->number[0];
    model->origin.y = (cairn_real)reader->number[1];
    return status;
}

/* Reads the samples of the outline. */
static cairn_status read_outline(shape_reader *reader, cairn_shape_model_file *file)
{
    cairn_status status =
        next_named(reader, "outline", 1, "\"outline\" and the number of its samples");

    if (status != CAIRN_OK)
        return status;
    if (!is_integer_within(reader->number[0], 1, CAIRN_SHAPE_MODEL_FILE_MAX_OUTLINE))
        return cairn_file_error_set(reader->error, CAIRN_FULL, reader->path, line_of(reader),
                                    "%g samples, expected 1 ... %d", reader->number[0],
                                    CAIRN_SHAPE_MODEL_FILE_MAX_OUTLINE);
    file->model.outline_count = (int32_t)reader->number[0];
    for (int32_t i = 0; i < file->model.outline_count && status == CAIRN_OK; i++) {
        status = next_sample(reader, OUTLINE_NUMBERS,
                             "x y and direction x y of a sample of the outline");
        file->outline[i] = point_of(reader->number);
        reader->outline_line[i] = line_of(reader);
    }
    return status;
}

static void set_sample(const double *number, cairn_shape_model_sample *sample)
{
    sample->centre.x = (cairn_real)number[0];
    sample->centre.y = (cairn_real)number[1];
    sample->radius = (cairn_real)number[2];
    sample->deviation = (cairn_real)number[3];
    for (int32_t side = 0; side < 2; side++) {
        sample->contact[side] = point_of(&number[4 + 5 * side]);
        sample->outline_share[side] = (cairn_real)number[8 + 5 * side];
    }
}

/* Reads a path after its first line. */
static cairn_status read_path(shape_reader *reader, cairn_shape_model_file *file)
{
    cairn_shape_model *model = &file->model;
    cairn_shape_model_path *parsed = &file->paths[model->path_count];
    cairn_status status = CAIRN_OK;

    if (model->path_count == CAIRN_SHAPE_MODEL_MAX_PATHS)
        return cairn_file_error_set(reader->error, CAIRN_FULL, reader->path, line_of(reader),
                                    "too many paths, expected at most %d",
                                    CAIRN_SHAPE_MODEL_MAX_PATHS);
    if (!is_word(reader, "path") || reader->count != 4 ||
        !is_integer_within(reader->number[0], -1, CAIRN_SHAPE_MODEL_MAX_PATHS) ||
        !is_integer_within(reader->number[1], -1, CAIRN_SHAPE_MODEL_FILE_MAX_SAMPLES))
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                                    "malformed path, expected \"path\", its parent, the sample "
                                    "there (-1 -1: none), its share "
                                    "and the number of its samples");
    if (!is_integer_within(reader->number[3], 1,
                           CAIRN_SHAPE_MODEL_FILE_MAX_SAMPLES - model->sample_count))
        return cairn_file_error_set(
            reader->error, CAIRN_FULL, reader->path, line_of(reader),
            "%g samples, expected at least one, and at most %d of all paths", reader->number[3],
            CAIRN_SHAPE_MODEL_FILE_MAX_SAMPLES);
    parsed->parent = (int32_t)reader->number[0];
    parsed->branch = (int32_t)reader->number[1];
    parsed->outline_share = (cairn_real)reader->number[2];
    parsed->first = model->sample_count;
    parsed->count = (int32_t)reader->number[3];
    reader->path_line[model->path_count++] = line_of(reader);
    for (int32_t i = 0; i < parsed->count && status == CAIRN_OK; i++) {
        status = next_sample(reader, SAMPLE_NUMBERS, "the 14 numbers of a sample of a path");
        reader->sample_line[model->sample_count] = line_of(reader);
        set_sample(reader->number, &file->samples[model->sample_count++]);
    }
    return status;
}

/* Validates the model and finds the line of the fault. */
static cairn_status check(const shape_reader *reader, const cairn_shape_model *model)
{
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);
    int64_t line = 0;

    if (status == CAIRN_OK)
        return CAIRN_OK;
    if (fault.index >= 0)
        line = strstr(fault.message, "outline") != NULL ? reader->outline_line[fault.index]
               : strstr(fault.message, "path") != NULL  ? reader->path_line[fault.index]
                                                        : reader->sample_line[fault.index];
    return cairn_file_error_set(reader->error, status, reader->path, line, "%s", fault.message);
}

/* Reads a gap from the current line. */
static cairn_status read_gap(const shape_reader *reader, cairn_shape_model *model)
{
    cairn_vec2 gap = {(cairn_real)reader->number[0], (cairn_real)reader->number[1]};

    if (model->path_count > 0 || reader->count != 2)
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                                    "malformed gap, expected \"gap\" and x y, before the paths");
    if (model->gap_count == CAIRN_SHAPE_MODEL_MAX_GAPS)
        return cairn_file_error_set(reader->error, CAIRN_FULL, reader->path, line_of(reader),
                                    "too many gaps, expected at most %d",
                                    CAIRN_SHAPE_MODEL_MAX_GAPS);
    model->gaps[model->gap_count++] = gap;
    return CAIRN_OK;
}

/* Reads and validates a whole model. */
static cairn_status read_all(shape_reader *reader, cairn_shape_model_file *file)
{
    cairn_status status = read_header(reader, &file->model);

    if (status == CAIRN_OK)
        status = read_outline(reader, file);
    while (status == CAIRN_OK) {
        status = next_line(reader, 1);
        if (status == CAIRN_OK)
            status =
                is_word(reader, "gap") ? read_gap(reader, &file->model) : read_path(reader, file);
    }
    if (status != CAIRN_EMPTY)
        return status;
    if (file->model.path_count == 0)
        return report_end(reader, status, "a path");
    return check(reader, &file->model);
}

cairn_status cairn_shape_model_file_read(cairn_shape_model_file *file, const char *path,
                                         cairn_file_error *error)
{
    shape_reader reader;
    cairn_status status;

    memset(file, 0, sizeof *file);
    memset(&reader, 0, sizeof reader);
    reader.path = path;
    reader.error = error;
    status = cairn_line_reader_open(&reader.lines, path, error);
    if (status != CAIRN_OK)
        return status;
    reader.outline_line = calloc(CAIRN_SHAPE_MODEL_FILE_MAX_OUTLINE, sizeof *reader.outline_line);
    reader.sample_line = calloc(CAIRN_SHAPE_MODEL_FILE_MAX_SAMPLES, sizeof *reader.sample_line);
    if (reader.outline_line != NULL && reader.sample_line != NULL &&
        allocate(file, CAIRN_SHAPE_MODEL_FILE_MAX_SAMPLES, CAIRN_SHAPE_MODEL_FILE_MAX_OUTLINE))
        status = read_all(&reader, file);
    else
        status = no_memory(path, "read", error);
    cairn_line_reader_close(reader.lines);
    free(reader.outline_line);
    free(reader.sample_line);
    if (status != CAIRN_OK)
        cairn_shape_model_file_free(file);
    return status;
}

int32_t cairn_shape_model_file_is(const char *path)
{
    shape_reader reader;
    int32_t is_model = 0;

    memset(&reader, 0, sizeof reader);
    reader.path = path;
    if (cairn_line_reader_open(&reader.lines, path, NULL) != CAIRN_OK)
        return 0;
    if (next_line(&reader, 1) == CAIRN_OK)
        is_model = is_word(&reader, FILE_SIGNATURE);
    cairn_line_reader_close(reader.lines);
    return is_model;
}

/* ---- Writing ---- */

/* Prints a number that reads back bit-exactly, and a suffix. */
static void print_number(cairn_output *output, cairn_real value, const char *suffix)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];

    cairn_output_print(output, "%s%s", cairn_number_write(text, value), suffix);
}

static void print_point(cairn_output *output, const cairn_oriented_point *point, const char *suffix)
{
    print_number(output, point->position.x, " ");
    print_number(output, point->position.y, " ");
    print_number(output, point->direction.x, " ");
    print_number(output, point->direction.y, suffix);
}

static void print_sample(cairn_output *output, const cairn_shape_model_sample *sample)
{
    print_number(output, sample->centre.x, " ");
    print_number(output, sample->centre.y, " ");
    print_number(output, sample->radius, " ");
    print_number(output, sample->deviation, "  ");
    print_point(output, &sample->contact[0], " ");
    print_number(output, sample->outline_share[0], "  ");
    print_point(output, &sample->contact[1], " ");
    print_number(output, sample->outline_share[1], "\n");
}

static void print_model(cairn_output *output, const cairn_shape_model *model)
{
    cairn_output_print(output, FILE_SIGNATURE " %d\nsize ", FORMAT_VERSION);
    print_number(output, model->size, "\norigin ");
    print_number(output, model->origin.x, " ");
    print_number(output, model->origin.y, "\n");
    cairn_output_print(output, "outline %d\n", (int)model->outline_count);
    for (int32_t i = 0; i < model->outline_count; i++)
        print_point(output, &model->outline[i], "\n");
    for (int32_t i = 0; i < model->gap_count; i++) {
        cairn_output_print(output, "gap ");
        print_number(output, model->gaps[i].x, " ");
        print_number(output, model->gaps[i].y, "\n");
    }
    for (int32_t i = 0; i < model->path_count; i++) {
        const cairn_shape_model_path *path = &model->paths[i];

        cairn_output_print(output, "path %d %d ", (int)path->parent, (int)path->branch);
        print_number(output, path->outline_share, "");
        cairn_output_print(output, " %d\n", (int)path->count);
        for (int32_t k = 0; k < path->count; k++)
            print_sample(output, &model->samples[path->first + k]);
    }
}

cairn_status cairn_shape_model_file_write(const cairn_shape_model *model, const char *path,
                                          cairn_file_error *error)
{
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);
    cairn_output *output;

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.message);
    if (model->outline_count > CAIRN_SHAPE_MODEL_FILE_MAX_OUTLINE ||
        model->sample_count > CAIRN_SHAPE_MODEL_FILE_MAX_SAMPLES)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "a model of %d and %d samples, expected at most %d of the outline and %d of paths",
            (int)model->outline_count, (int)model->sample_count, CAIRN_SHAPE_MODEL_FILE_MAX_OUTLINE,
            CAIRN_SHAPE_MODEL_FILE_MAX_SAMPLES);
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    print_model(output, model);
    return cairn_output_commit(output, error);
}
