/* Models of appearance as text. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "src/host/appearance_work.h"
#include "src/host/carmen_log_reader.h"

#define HEAD "cairn-appearance"

enum { VERSION = 1 };
/* Of the numbers of a machine. */
#define NUMBER_MOST 1e9
#define LEAST_GAMMA 1e-9

typedef struct appearance_reader {
    cairn_line_reader *lines;
    const char *path;
    cairn_file_error *error;
    const char *at, *end; /* of the line */
} appearance_reader;

static cairn_status no_memory(const appearance_reader *r)
{
    return cairn_file_error_system(r->error, r->path, "read", ENOMEM);
}

static int64_t line_of(const appearance_reader *r)
{
    return cairn_line_reader_number(r->lines);
}

/* The next line with anything on it but a comment; `what` is what should come. */
static cairn_status next_line(appearance_reader *r, const char *what)
{
    const char *line, *comment, *at, *token;
    size_t length;

    do {
        cairn_status status = cairn_line_reader_next(r->lines, &line, &length, r->error);

        if (status == CAIRN_EMPTY)
            return cairn_file_error_set(r->error, CAIRN_TRUNCATED, r->path, line_of(r),
                                        "the file ends here, expected %s", what);
        if (status == CAIRN_FULL)
            return cairn_file_error_set(r->error, CAIRN_FULL, r->path, line_of(r),
                                        "a giant line, expected %s", what);
        if (status != CAIRN_OK)
            return status;
        comment = memchr(line, '#', length);
        at = r->at = line;
        r->end = comment != NULL ? comment : line + length;
    } while (cairn_token_next(&at, r->end, &token) == 0);
    return CAIRN_OK;
}

/* The next word of the line must be this one. */
static cairn_status take_word(appearance_reader *r, const char *word)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length = cairn_token_next(&r->at, r->end, &token);

    if (length == strlen(word) && memcmp(token, word, length) == 0)
        return CAIRN_OK;
    return cairn_file_error_set(
        r->error, CAIRN_BAD_FORMAT, r->path, line_of(r), "%s, expected '%s'",
        length > 0 ? cairn_token_text(shown, token, length) : "nothing", word);
}

static cairn_status take_number(appearance_reader *r, double least, double most, double *value)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length = cairn_token_next(&r->at, r->end, &token);

    if (length > 0 && cairn_number_read(token, length, value) && *value >= least && *value <= most)
        return CAIRN_OK;
    return cairn_file_error_set(
        r->error, CAIRN_BAD_FORMAT, r->path, line_of(r), "%s, expected a number of %g ... %g",
        length > 0 ? cairn_token_text(shown, token, length) : "nothing", least, most);
}

static cairn_status take_whole(appearance_reader *r, int32_t least, int32_t most, int32_t *value)
{
    double number = 0;
    cairn_status status = take_number(r, least, most, &number);

    if (status != CAIRN_OK)
        return status;
    *value = (int32_t)number;
    if (*value != number)
        return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
                                    "%g, expected a whole number", number);
    return status;
}

static cairn_status end_line(appearance_reader *r)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length = cairn_token_next(&r->at, r->end, &token);

    if (length == 0)
        return CAIRN_OK;
    return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
                                "%s, expected the line to end",
                                cairn_token_text(shown, token, length));
}

static cairn_status read_head(appearance_reader *r)
{
    double version = 0;
    cairn_status status = next_line(r, "'" HEAD " 1'");

    if (status == CAIRN_OK)
        status = take_word(r, HEAD);
    if (status == CAIRN_OK)
        status = take_number(r, 0, 1e9, &version);
    if (status == CAIRN_OK && version != VERSION)
        return cairn_file_error_set(r->error, CAIRN_UNSUPPORTED, r->path, line_of(r),
                                    "a model of version %g, expected %d (cairn train makes it)",
                                    version, VERSION);
    return status == CAIRN_OK ? end_line(r) : status;
}

static cairn_status read_words(appearance_reader *r, cairn_appearance_model *m)
{
    cairn_status status = next_line(r, "'words'");

    if (status == CAIRN_OK)
        status = take_word(r, "words");
    if (status == CAIRN_OK)
        status = take_whole(r, 2, CAIRN_APPEARANCE_WORDS_MOST, &m->word_count);
    if (status == CAIRN_OK)
        status = end_line(r);
    if (status != CAIRN_OK)
        return status;
    m->words = malloc((size_t)m->word_count * APPEARANCE_NUMBERS);
    if (m->words == NULL)
        return no_memory(r);
    for (int32_t i = 0; i < m->word_count && status == CAIRN_OK; i++) {
        status = next_line(r, "a word");
        for (int32_t k = 0; k < APPEARANCE_NUMBERS && status == CAIRN_OK; k++) {
            int32_t value = 0;

            status = take_whole(r, 0, 255, &value);
            m->words[(size_t)i * APPEARANCE_NUMBERS + (size_t)k] = (uint8_t)value;
        }
        if (status == CAIRN_OK)
            status = end_line(r);
    }
    return status;
}

static cairn_status read_support(appearance_reader *r, cairn_appearance_model *m, int32_t index)
{
    float *histogram = &m->histograms[(size_t)index * (size_t)m->word_count];
    cairn_status status = next_line(r, "a support vector");

    if (status == CAIRN_OK)
        status = take_number(r, -NUMBER_MOST, NUMBER_MOST, &m->weights[index]);
    for (int32_t k = 0; k < m->word_count && status == CAIRN_OK; k++) {
        double value = 0;

        status = take_number(r, 0, 1, &value);
        histogram[k] = (float)value;
    }
    return status == CAIRN_OK ? end_line(r) : status;
}

static cairn_status read_machine(appearance_reader *r, cairn_appearance_model *m)
{
    double *const numbers[] = {&m->gamma, &m->rho, &m->slope, &m->offset};
    cairn_status status = next_line(r, "'machine'");

    if (status == CAIRN_OK)
        status = take_word(r, "machine");
    for (int i = 0; i < (int)(sizeof numbers / sizeof *numbers) && status == CAIRN_OK; i++)
        status = take_number(r, i == 0 ? LEAST_GAMMA : -NUMBER_MOST, NUMBER_MOST, numbers[i]);
    if (status == CAIRN_OK)
        status = take_whole(r, 1, CAIRN_APPEARANCE_SUPPORT_MOST, &m->support_count);
    if (status == CAIRN_OK)
        status = end_line(r);
    if (status != CAIRN_OK)
        return status;
    m->histograms =
        malloc((size_t)m->support_count * (size_t)m->word_count * sizeof *m->histograms);
    m->weights = malloc((size_t)m->support_count * sizeof *m->weights);
    if (m->histograms == NULL || m->weights == NULL)
        return no_memory(r);
    for (int32_t i = 0; i < m->support_count && status == CAIRN_OK; i++)
        status = read_support(r, m, i);
    return status;
}

cairn_status cairn_appearance_read(cairn_appearance_model *model, const char *path,
                                   cairn_file_error *error)
{
    appearance_reader r = {.path = path, .error = error};
    cairn_status status;

    memset(model, 0, sizeof *model);
    status = cairn_line_reader_open(&r.lines, path, error);
    if (status != CAIRN_OK)
        return status;
    status = read_head(&r);
    if (status == CAIRN_OK)
        status = read_words(&r, model);
    if (status == CAIRN_OK)
        status = read_machine(&r, model);
    if (status == CAIRN_OK)
        status = next_line(&r, "'end'");
    if (status == CAIRN_OK)
        status = take_word(&r, "end");
    if (status == CAIRN_OK)
        status = end_line(&r);
    cairn_line_reader_close(r.lines);
    if (status != CAIRN_OK)
        cairn_appearance_free(model);
    return status;
}

static int is_within(double value, double least, double most)
{
    return value >= least && value <= most;
}

/* 1 when what is written can be read again. */
static int is_writable(const cairn_appearance_model *m)
{
    int ok = m->word_count >= 2 && m->word_count <= CAIRN_APPEARANCE_WORDS_MOST &&
             m->support_count >= 1 && m->support_count <= CAIRN_APPEARANCE_SUPPORT_MOST &&
             is_within(m->gamma, LEAST_GAMMA, NUMBER_MOST) &&
             is_within(m->rho, -NUMBER_MOST, NUMBER_MOST) &&
             is_within(m->slope, -NUMBER_MOST, NUMBER_MOST) &&
             is_within(m->offset, -NUMBER_MOST, NUMBER_MOST);

    for (int32_t i = 0; ok && i < m->support_count; i++)
        ok = is_within(m->weights[i], -NUMBER_MOST, NUMBER_MOST);
    for (int64_t i = 0; ok && i < (int64_t)m->support_count * m->word_count; i++)
        ok = is_within((double)m->histograms[i], 0, 1);
    return ok;
}

cairn_status cairn_appearance_write(const cairn_appearance_model *m, const char *path,
                                    cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status;

    if (!is_writable(m))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "a model beyond what is read again, expected one that was trained");
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, HEAD " %d\nwords %d\n", VERSION, (int)m->word_count);
    for (int32_t i = 0; i < m->word_count * APPEARANCE_NUMBERS; i++)
        cairn_output_print(output, "%d%c", (int)m->words[i],
                           (i + 1) % APPEARANCE_NUMBERS == 0 ? '\n' : ' ');
    cairn_output_print(output, "machine %.17g %.17g %.17g %.17g %d\n", m->gamma, m->rho, m->slope,
                       m->offset, (int)m->support_count);
    for (int32_t i = 0; i < m->support_count; i++) {
        cairn_output_print(output, "%.17g", m->weights[i]);
        for (int32_t k = 0; k < m->word_count; k++)
            cairn_output_print(
                output, " %.9g",
                (double)m->histograms[(size_t)i * (size_t)m->word_count + (size_t)k]);
        cairn_output_print(output, "\n");
    }
    cairn_output_print(output, "end\n");
    return cairn_output_commit(output, error);
}
