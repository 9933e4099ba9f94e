/* Reader and writer of appearance models as text. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/appearance_file.h"
#include "cairn/number_text.h"
#include "cairn/output.h"
#include "src/host/logs/carmen_log_reader.h"

#define FILE_MAGIC "cairn-appearance"

enum { FORMAT_VERSION = 1, APPEARANCE_DESCRIPTOR_SIZE = CAIRN_APPEARANCE_DESCRIPTOR_SIZE };
/* Limits of the parameters of a support vector machine. */
#define MAX_NUMBER 1e9
#define MIN_GAMMA  1e-9

typedef struct appearance_reader {
    cairn_line_reader *lines;
    const char *path;
    cairn_file_error *error;
    const char *position, *end; /* unread part of the current line */
} appearance_reader;

static cairn_status no_memory(const appearance_reader *reader)
{
    return cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
}

static int64_t line_of(const appearance_reader *reader)
{
    return cairn_line_reader_number(reader->lines);
}

/* Reads the next line that is not empty or a comment; `what` describes the expected content. */
static cairn_status next_line(appearance_reader *reader, const char *what)
{
    const char *line, *comment, *position, *token;
    size_t length;

    do {
        cairn_status status = cairn_line_reader_next(reader->lines, &line, &length, reader->error);

        if (status == CAIRN_EMPTY)
            return cairn_file_error_set(reader->error, CAIRN_TRUNCATED, reader->path,
                                        line_of(reader), "the file ends here, expected %s", what);
        if (status == CAIRN_FULL)
            return cairn_file_error_set(reader->error, CAIRN_FULL, reader->path, line_of(reader),
                                        "a giant line, expected %s", what);
        if (status != CAIRN_OK)
            return status;
        comment = memchr(line, '#', length);
        position = reader->position = line;
        reader->end = comment != NULL ? comment : line + length;
    } while (cairn_token_next(&position, reader->end, &token) == 0);
    return CAIRN_OK;
}

/* Reads a token that must equal `word`. */
static cairn_status expect_token(appearance_reader *reader, const char *word)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length = cairn_token_next(&reader->position, reader->end, &token);

    if (length == strlen(word) && memcmp(token, word, length) == 0)
        return CAIRN_OK;
    return cairn_file_error_set(
        reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader), "%s, expected '%s'",
        length > 0 ? cairn_token_text(shown, token, length) : "nothing", word);
}

static cairn_status read_number(appearance_reader *reader, double min_value, double max_value,
                                double *value)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length = cairn_token_next(&reader->position, reader->end, &token);

    if (length > 0 && cairn_number_read(token, length, value) && *value >= min_value &&
        *value <= max_value)
        return CAIRN_OK;
    return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                                "%s, expected a number of %g ... %g",
                                length > 0 ? cairn_token_text(shown, token, length) : "nothing",
                                min_value, max_value);
}

/* Reads a number of the machine. */
static cairn_status read_real(appearance_reader *reader, double min_value, double max_value,
                              cairn_real *value)
{
    double number = 0;
    cairn_status status = read_number(reader, min_value, max_value, &number);

    *value = (cairn_real)number;
    return status;
}

static cairn_status read_integer(appearance_reader *reader, int32_t min_value, int32_t max_value,
                                 int32_t *value)
{
    double number = 0;
    cairn_status status = read_number(reader, min_value, max_value, &number);

    if (status != CAIRN_OK)
        return status;
    *value = (int32_t)number;
    if (*value != number)
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                                    "%g, expected a whole number", number);
    return status;
}

static cairn_status expect_line_end(appearance_reader *reader)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length = cairn_token_next(&reader->position, reader->end, &token);

    if (length == 0)
        return CAIRN_OK;
    return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line_of(reader),
                                "%s, expected the line to end",
                                cairn_token_text(shown, token, length));
}

static cairn_status read_head(appearance_reader *reader)
{
    double version = 0;
    cairn_status status = next_line(reader, "'" FILE_MAGIC " 1'");

    if (status == CAIRN_OK)
        status = expect_token(reader, FILE_MAGIC);
    if (status == CAIRN_OK)
        status = read_number(reader, 0, 1e9, &version);
    if (status == CAIRN_OK && version != FORMAT_VERSION)
        return cairn_file_error_set(reader->error, CAIRN_UNSUPPORTED, reader->path, line_of(reader),
                                    "a model of version %g, expected %d (cairn train makes it)",
                                    version, FORMAT_VERSION);
    return status == CAIRN_OK ? expect_line_end(reader) : status;
}

static cairn_status read_words(appearance_reader *reader, cairn_appearance_model *model)
{
    cairn_status status = next_line(reader, "'words'");

    if (status == CAIRN_OK)
        status = expect_token(reader, "words");
    if (status == CAIRN_OK)
        status = read_integer(reader, 2, CAIRN_APPEARANCE_MAX_WORDS, &model->word_count);
    if (status == CAIRN_OK)
        status = expect_line_end(reader);
    if (status != CAIRN_OK)
        return status;
    model->words = malloc((size_t)model->word_count * APPEARANCE_DESCRIPTOR_SIZE);
    if (model->words == NULL)
        return no_memory(reader);
    for (int32_t i = 0; i < model->word_count && status == CAIRN_OK; i++) {
        status = next_line(reader, "a word");
        for (int32_t k = 0; k < APPEARANCE_DESCRIPTOR_SIZE && status == CAIRN_OK; k++) {
            int32_t value = 0;

            status = read_integer(reader, 0, 255, &value);
            model->words[(size_t)i * APPEARANCE_DESCRIPTOR_SIZE + (size_t)k] = (uint8_t)value;
        }
        if (status == CAIRN_OK)
            status = expect_line_end(reader);
    }
    return status;
}

static cairn_status read_support(appearance_reader *reader, cairn_appearance_model *model,
                                 int32_t index)
{
    float *histogram = &model->histograms[(size_t)index * (size_t)model->word_count];
    cairn_status status = next_line(reader, "a support vector");

    if (status == CAIRN_OK)
        status = read_real(reader, -MAX_NUMBER, MAX_NUMBER, &model->weights[index]);
    for (int32_t k = 0; k < model->word_count && status == CAIRN_OK; k++) {
        double value = 0;

        status = read_number(reader, 0, 1, &value);
        histogram[k] = (float)value;
    }
    return status == CAIRN_OK ? expect_line_end(reader) : status;
}

static cairn_status read_machine(appearance_reader *reader, cairn_appearance_model *model)
{
    cairn_real *const numbers[] = {&model->gamma, &model->rho, &model->platt_slope,
                                   &model->platt_offset};
    cairn_status status = next_line(reader, "'machine'");

    if (status == CAIRN_OK)
        status = expect_token(reader, "machine");
    for (int i = 0; i < (int)(sizeof numbers / sizeof *numbers) && status == CAIRN_OK; i++)
        status = read_real(reader, i == 0 ? MIN_GAMMA : -MAX_NUMBER, MAX_NUMBER, numbers[i]);
    if (status == CAIRN_OK)
        status =
            read_integer(reader, 1, CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS, &model->support_count);
    if (status == CAIRN_OK)
        status = expect_line_end(reader);
    if (status != CAIRN_OK)
        return status;
    model->histograms = malloc((size_t)model->support_count * (size_t)model->word_count *
                               sizeof *model->histograms);
    model->weights = malloc((size_t)model->support_count * sizeof *model->weights);
    if (model->histograms == NULL || model->weights == NULL)
        return no_memory(reader);
    for (int32_t i = 0; i < model->support_count && status == CAIRN_OK; i++)
        status = read_support(reader, model, i);
    return status;
}

cairn_status cairn_appearance_file_read(cairn_appearance_model *model, const char *path,
                                        cairn_file_error *error)
{
    appearance_reader reader = {.path = path, .error = error};
    cairn_status status;

    memset(model, 0, sizeof *model);
    status = cairn_line_reader_open(&reader.lines, path, error);
    if (status != CAIRN_OK)
        return status;
    status = read_head(&reader);
    if (status == CAIRN_OK)
        status = read_words(&reader, model);
    if (status == CAIRN_OK)
        status = read_machine(&reader, model);
    if (status == CAIRN_OK)
        status = next_line(&reader, "'end'");
    if (status == CAIRN_OK)
        status = expect_token(&reader, "end");
    if (status == CAIRN_OK)
        status = expect_line_end(&reader);
    cairn_line_reader_close(reader.lines);
    if (status != CAIRN_OK)
        cairn_appearance_file_free(model);
    return status;
}

static int is_within(cairn_real value, double min_value, double max_value)
{
    return (double)value >= min_value && (double)value <= max_value;
}

/* Returns 1 when the written file can be read again. */
static int is_writable(const cairn_appearance_model *model)
{
    int ok = model->word_count >= 2 && model->word_count <= CAIRN_APPEARANCE_MAX_WORDS &&
             model->support_count >= 1 &&
             model->support_count <= CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS &&
             is_within(model->gamma, MIN_GAMMA, MAX_NUMBER) &&
             is_within(model->rho, -MAX_NUMBER, MAX_NUMBER) &&
             is_within(model->platt_slope, -MAX_NUMBER, MAX_NUMBER) &&
             is_within(model->platt_offset, -MAX_NUMBER, MAX_NUMBER);

    for (int32_t i = 0; ok && i < model->support_count; i++)
        ok = is_within(model->weights[i], -MAX_NUMBER, MAX_NUMBER);
    for (int64_t i = 0; ok && i < (int64_t)model->support_count * model->word_count; i++)
        ok = is_within((cairn_real)model->histograms[i], 0, 1);
    return ok;
}

cairn_status cairn_appearance_file_write(const cairn_appearance_model *model, const char *path,
                                         cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status;

    if (!is_writable(model))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "a model beyond what is read again, expected one that was trained");
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, FILE_MAGIC " %d\nwords %d\n", FORMAT_VERSION,
                       (int)model->word_count);
    for (int32_t i = 0; i < model->word_count * APPEARANCE_DESCRIPTOR_SIZE; i++)
        cairn_output_print(output, "%d%c", (int)model->words[i],
                           (i + 1) % APPEARANCE_DESCRIPTOR_SIZE == 0 ? '\n' : ' ');
    cairn_output_print(output, "machine %.17g %.17g %.17g %.17g %d\n", (double)model->gamma,
                       (double)model->rho, (double)model->platt_slope, (double)model->platt_offset,
                       (int)model->support_count);
    for (int32_t i = 0; i < model->support_count; i++) {
        cairn_output_print(output, "%.17g", (double)model->weights[i]);
        for (int32_t k = 0; k < model->word_count; k++)
            cairn_output_print(
                output, " %.9g",
                (double)model->histograms[(size_t)i * (size_t)model->word_count + (size_t)k]);
        cairn_output_print(output, "\n");
    }
    cairn_output_print(output, "end\n");
    return cairn_output_commit(output, error);
}

void cairn_appearance_file_free(cairn_appearance_model *model)
{
    free(model->words);
    free(model->histograms);
    free(model->weights);
    memset(model, 0, sizeof *model);
}
