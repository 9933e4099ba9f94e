/* Models of shapes as text. */
#include "src/core/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/shape_model_file.h"
#include "src/host/carmen_log_reader.h"

#define HEAD "cairn-shape"

enum { VERSION = 1, OUTLINE_NUMBERS = 4, SAMPLE_NUMBERS = 14, NUMBERS_MOST = 16 };

void cairn_shape_model_file_free(cairn_shape_model_file *file)
{
    free(file->samples);
    free(file->paths);
    free(file->outline);
    memset(file, 0, sizeof *file);
}

/* Room for all; 0: there is no memory. */
static int allocate(cairn_shape_model_file *f, size_t samples, size_t outline)
{
    f->samples = calloc(samples, sizeof *f->samples);
    f->paths = calloc(CAIRN_SHAPE_PATHS, sizeof *f->paths);
    f->outline = calloc(outline, sizeof *f->outline);
    f->model.samples = f->samples;
    f->model.paths = f->paths;
    f->model.outline = f->outline;
    return f->samples != NULL && f->paths != NULL && f->outline != NULL;
}

static cairn_status no_memory(const char *path, const char *what, cairn_file_error *error)
{
    return cairn_file_error_system(error, path, what, ENOMEM);
}

/* ---- From outlines ---- */

cairn_status cairn_shape_model_file_copy(cairn_shape_model_file *f, const cairn_shape_model *m)
{
    memset(f, 0, sizeof *f);
    if (!allocate(f, (size_t)m->sample_count, (size_t)m->outline_count)) {
        cairn_shape_model_file_free(f);
        return CAIRN_NO_MEMORY;
    }
    memcpy(f->samples, m->samples, (size_t)m->sample_count * sizeof *f->samples);
    memcpy(f->paths, m->paths, (size_t)m->path_count * sizeof *f->paths);
    memcpy(f->outline, m->outline, (size_t)m->outline_count * sizeof *f->outline);
    f->model = *m;
    f->model.samples = f->samples;
    f->model.paths = f->paths;
    f->model.outline = f->outline;
    return CAIRN_OK;
}

static cairn_status build(cairn_shape_builder *builder, const cairn_curve *outlines, int32_t count)
{
    cairn_status status = cairn_shape_builder_begin(builder, outlines, count);
    cairn_budget budget;

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = INT32_MAX;
        status = cairn_shape_builder_step(builder, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

cairn_status cairn_shape_model_file_build(cairn_shape_model_file *file, const cairn_curve *outlines,
                                          int32_t count, const cairn_shape_builder_params *params,
                                          const char *path, cairn_file_error *error)
{
    size_t bytes = cairn_shape_builder_memory(params) + CAIRN_ALIGN;
    cairn_shape_builder *builder;
    cairn_shape_model model;
    cairn_status status;
    cairn_pool pool;
    void *memory = malloc(bytes);

    memset(file, 0, sizeof *file);
    if (memory == NULL)
        return no_memory(path, "make a model of", error);
    status = cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_shape_builder_create(&builder, &pool, params);
    if (status == CAIRN_OK)
        status = build(builder, outlines, count);
    if (status != CAIRN_OK) {
        (void)cairn_file_error_set(error, status, path, 0, "no model can be made (%s), expected %s",
                                   cairn_status_text(status),
                                   status == CAIRN_EMPTY ? "an object with symmetric parts"
                                                         : "outlines of one object");
    } else {
        model = cairn_shape_builder_read(builder);
        status = cairn_shape_model_file_copy(file, &model);
        if (status != CAIRN_OK)
            (void)no_memory(path, "make a model of", error);
    }
    free(memory);
    return status;
}

/* ---- Reading ---- */

typedef struct shape_reader {
    cairn_line_reader *lines;
    const char *path;
    cairn_file_error *error;
    const char *word; /* the first one of the line, */
    size_t length;
    double number[NUMBERS_MOST]; /* and the numbers behind it, or all of the line */
    int32_t count;
    int64_t *outline_line, *sample_line; /* where each was */
    int64_t path_line[CAIRN_SHAPE_PATHS];
} shape_reader;

static int64_t line_of(const shape_reader *r)
{
    return cairn_line_reader_number(r->lines);
}

/* The numbers of a line from `at` on. */
static cairn_status read_numbers(shape_reader *r, const char *at, const char *end)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length;

    for (r->count = 0; (length = cairn_token_next(&at, end, &token)) > 0; r->count++) {
        if (r->count == NUMBERS_MOST)
            return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
                                        "more than %d numbers, expected one sample", NUMBERS_MOST);
        if (!cairn_number_read(token, length, &r->number[r->count]))
            return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
                                        "%s, expected a number",
                                        cairn_token_text(shown, token, length));
    }
    return CAIRN_OK;
}

/* The next line that says something. CAIRN_EMPTY: there is none. named: it begins with a word. */
static cairn_status next_line(shape_reader *r, int named)
{
    const char *line, *at, *end, *comment;
    cairn_status status;
    size_t length;

    do {
        status = cairn_line_reader_next(r->lines, &line, &length, r->error);
        if (status == CAIRN_FULL)
            return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
                                        "a line of %zu bytes, expected a model of a shape", length);
        if (status != CAIRN_OK)
            return status;
        comment = memchr(line, '#', length);
        end = comment != NULL ? comment : line + length;
        at = line;
        r->length = cairn_token_next(&at, end, &r->word);
    } while (r->length == 0);
    return read_numbers(r, named ? at : line, end);
}

static cairn_status ended(const shape_reader *r, cairn_status status, const char *wanted)
{
    return status != CAIRN_EMPTY
               ? status
               : cairn_file_error_set(r->error, CAIRN_TRUNCATED, r->path, line_of(r),
                                      "the file ends, expected %s", wanted);
}

static int is_word(const shape_reader *r, const char *word)
{
    return r->length == strlen(word) && memcmp(r->word, word, r->length) == 0;
}

/* The next line, which must begin with a word and have so many numbers. */
static cairn_status next_named(shape_reader *r, const char *word, int32_t count, const char *wanted)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    cairn_status status = next_line(r, 1);

    if (status != CAIRN_OK)
        return ended(r, status, wanted);
    if (!is_word(r, word) || r->count != count)
        return cairn_file_error_set(
            r->error, CAIRN_BAD_FORMAT, r->path, line_of(r), "%s and %d numbers, expected %s",
            cairn_token_text(shown, r->word, r->length), (int)r->count, wanted);
    return CAIRN_OK;
}

/* The next line, which must have so many numbers. */
static cairn_status next_sample(shape_reader *r, int32_t count, const char *wanted)
{
    cairn_status status = next_line(r, 0);

    if (status != CAIRN_OK)
        return ended(r, status, wanted);
    if (r->count != count)
        return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
                                    "%d numbers, expected %s", (int)r->count, wanted);
    return CAIRN_OK;
}

/* A whole number from least to most; 0: it is none. */
static int is_whole(double number, double least, double most)
{
    return number >= least && number <= most && number == (double)(int64_t)number;
}

static cairn_oriented_point point_of(const double *n)
{
    cairn_oriented_point p = {{(cairn_real)n[0], (cairn_real)n[1]},
                              {(cairn_real)n[2], (cairn_real)n[3]}};

    return p;
}

static cairn_status read_head(shape_reader *r, cairn_shape_model *m)
{
    cairn_status status = next_named(r, HEAD, 1, "\"" HEAD " 1\", the head of a model of a shape");

    if (status == CAIRN_OK && !(r->number[0] == VERSION))
        return cairn_file_error_set(r->error, CAIRN_UNSUPPORTED, r->path, line_of(r),
                                    "version %g, expected %d", r->number[0], VERSION);
    if (status == CAIRN_OK)
        status = next_named(r, "size", 1, "\"size\" and a number");
    m->size = (cairn_real)r->number[0];
    if (status == CAIRN_OK)
        status = next_named(r, "origin", 2, "\"origin\" and two numbers");
    m->origin.x = (cairn_real)r->number[0];
    m->origin.y = (cairn_real)r->number[1];
    return status;
}

static cairn_status read_outline(shape_reader *r, cairn_shape_model_file *f)
{
    cairn_status status = next_named(r, "outline", 1, "\"outline\" and the number of its samples");

    if (status != CAIRN_OK)
        return status;
    if (!is_whole(r->number[0], 1, CAIRN_SHAPE_FILE_OUTLINE_MOST))
        return cairn_file_error_set(r->error, CAIRN_FULL, r->path, line_of(r),
                                    "%g samples, expected 1 ... %d", r->number[0],
                                    CAIRN_SHAPE_FILE_OUTLINE_MOST);
    f->model.outline_count = (int32_t)r->number[0];
    for (int32_t i = 0; i < f->model.outline_count && status == CAIRN_OK; i++) {
        status =
            next_sample(r, OUTLINE_NUMBERS, "x y and direction x y of a sample of the outline");
        f->outline[i] = point_of(r->number);
        r->outline_line[i] = line_of(r);
    }
    return status;
}

static void take_sample(const double *n, cairn_shape_sample *s)
{
    s->centre.x = (cairn_real)n[0];
    s->centre.y = (cairn_real)n[1];
    s->radius = (cairn_real)n[2];
    s->deviation = (cairn_real)n[3];
    for (int32_t side = 0; side < 2; side++) {
        s->side[side] = point_of(&n[4 + 5 * side]);
        s->share[side] = (cairn_real)n[8 + 5 * side];
    }
}

/* A path, whose first line has been read. */
static cairn_status read_path(shape_reader *r, cairn_shape_model_file *f)
{
    cairn_shape_model *m = &f->model;
    cairn_shape_path *p = &f->paths[m->path_count];
    cairn_status status = CAIRN_OK;

    if (m->path_count == CAIRN_SHAPE_PATHS)
        return cairn_file_error_set(r->error, CAIRN_FULL, r->path, line_of(r),
                                    "one more path, expected at most %d", CAIRN_SHAPE_PATHS);
    if (!is_word(r, "path") || r->count != 4 || !is_whole(r->number[0], -1, CAIRN_SHAPE_PATHS) ||
        !is_whole(r->number[1], -1, CAIRN_SHAPE_FILE_SAMPLES_MOST))
        return cairn_file_error_set(
            r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
            "no path, expected \"path\", its parent, the sample there (-1 -1: none), its share "
            "and the number of its samples");
    if (!is_whole(r->number[3], 1, CAIRN_SHAPE_FILE_SAMPLES_MOST - m->sample_count))
        return cairn_file_error_set(
            r->error, CAIRN_FULL, r->path, line_of(r),
            "%g samples, expected at least one, and at most %d of all paths", r->number[3],
            CAIRN_SHAPE_FILE_SAMPLES_MOST);
    p->parent = (int32_t)r->number[0];
    p->branch = (int32_t)r->number[1];
    p->share = (cairn_real)r->number[2];
    p->first = m->sample_count;
    p->count = (int32_t)r->number[3];
    r->path_line[m->path_count++] = line_of(r);
    for (int32_t i = 0; i < p->count && status == CAIRN_OK; i++) {
        status = next_sample(r, SAMPLE_NUMBERS, "the 14 numbers of a sample of a path");
        r->sample_line[m->sample_count] = line_of(r);
        take_sample(r->number, &f->samples[m->sample_count++]);
    }
    return status;
}

/* What the library thinks of it; the line of what it names. */
static cairn_status check(const shape_reader *r, const cairn_shape_model *m)
{
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(m, &fault);
    int64_t line = 0;

    if (status == CAIRN_OK)
        return CAIRN_OK;
    if (fault.index >= 0)
        line = strstr(fault.what, "outline") != NULL ? r->outline_line[fault.index]
               : strstr(fault.what, "path") != NULL  ? r->path_line[fault.index]
                                                     : r->sample_line[fault.index];
    return cairn_file_error_set(r->error, status, r->path, line, "%s", fault.what);
}

/* A gap, whose line has been read. */
static cairn_status read_gap(const shape_reader *r, cairn_shape_model *m)
{
    cairn_vec2 gap = {(cairn_real)r->number[0], (cairn_real)r->number[1]};

    if (m->path_count > 0 || r->count != 2)
        return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line_of(r),
                                    "no gap, expected \"gap\" and x y, before the paths");
    if (m->gap_count == CAIRN_SHAPE_GAPS)
        return cairn_file_error_set(r->error, CAIRN_FULL, r->path, line_of(r),
                                    "one more gap, expected at most %d", CAIRN_SHAPE_GAPS);
    m->gaps[m->gap_count++] = gap;
    return CAIRN_OK;
}

static cairn_status read_all(shape_reader *r, cairn_shape_model_file *f)
{
    cairn_status status = read_head(r, &f->model);

    if (status == CAIRN_OK)
        status = read_outline(r, f);
    while (status == CAIRN_OK) {
        status = next_line(r, 1);
        if (status == CAIRN_OK)
            status = is_word(r, "gap") ? read_gap(r, &f->model) : read_path(r, f);
    }
    if (status != CAIRN_EMPTY)
        return status;
    if (f->model.path_count == 0)
        return ended(r, status, "a path");
    return check(r, &f->model);
}

cairn_status cairn_shape_model_file_read(cairn_shape_model_file *file, const char *path,
                                         cairn_file_error *error)
{
    shape_reader r;
    cairn_status status;

    memset(file, 0, sizeof *file);
    memset(&r, 0, sizeof r);
    r.path = path;
    r.error = error;
    status = cairn_line_reader_open(&r.lines, path, error);
    if (status != CAIRN_OK)
        return status;
    r.outline_line = calloc(CAIRN_SHAPE_FILE_OUTLINE_MOST, sizeof *r.outline_line);
    r.sample_line = calloc(CAIRN_SHAPE_FILE_SAMPLES_MOST, sizeof *r.sample_line);
    if (r.outline_line != NULL && r.sample_line != NULL &&
        allocate(file, CAIRN_SHAPE_FILE_SAMPLES_MOST, CAIRN_SHAPE_FILE_OUTLINE_MOST))
        status = read_all(&r, file);
    else
        status = no_memory(path, "read", error);
    cairn_line_reader_close(r.lines);
    free(r.outline_line);
    free(r.sample_line);
    if (status != CAIRN_OK)
        cairn_shape_model_file_free(file);
    return status;
}

int32_t cairn_shape_model_file_is(const char *path)
{
    shape_reader r;
    int32_t is_one = 0;

    memset(&r, 0, sizeof r);
    r.path = path;
    if (cairn_line_reader_open(&r.lines, path, NULL) != CAIRN_OK)
        return 0;
    if (next_line(&r, 1) == CAIRN_OK)
        is_one = is_word(&r, HEAD);
    cairn_line_reader_close(r.lines);
    return is_one;
}

/* ---- Writing ---- */

static void print_number(cairn_output *output, cairn_real value, const char *behind)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];

    cairn_output_print(output, "%s%s", cairn_number_write(text, value), behind);
}

static void print_point(cairn_output *output, const cairn_oriented_point *p, const char *behind)
{
    print_number(output, p->position.x, " ");
    print_number(output, p->position.y, " ");
    print_number(output, p->direction.x, " ");
    print_number(output, p->direction.y, behind);
}

static void print_sample(cairn_output *output, const cairn_shape_sample *s)
{
    print_number(output, s->centre.x, " ");
    print_number(output, s->centre.y, " ");
    print_number(output, s->radius, " ");
    print_number(output, s->deviation, "  ");
    print_point(output, &s->side[0], " ");
    print_number(output, s->share[0], "  ");
    print_point(output, &s->side[1], " ");
    print_number(output, s->share[1], "\n");
}

static void print_model(cairn_output *output, const cairn_shape_model *m)
{
    cairn_output_print(output, HEAD " %d\nsize ", VERSION);
    print_number(output, m->size, "\norigin ");
    print_number(output, m->origin.x, " ");
    print_number(output, m->origin.y, "\n");
    cairn_output_print(output, "outline %d\n", (int)m->outline_count);
    for (int32_t i = 0; i < m->outline_count; i++)
        print_point(output, &m->outline[i], "\n");
    for (int32_t i = 0; i < m->gap_count; i++) {
        cairn_output_print(output, "gap ");
        print_number(output, m->gaps[i].x, " ");
        print_number(output, m->gaps[i].y, "\n");
    }
    for (int32_t i = 0; i < m->path_count; i++) {
        const cairn_shape_path *p = &m->paths[i];

        cairn_output_print(output, "path %d %d ", (int)p->parent, (int)p->branch);
        print_number(output, p->share, "");
        cairn_output_print(output, " %d\n", (int)p->count);
        for (int32_t k = 0; k < p->count; k++)
            print_sample(output, &m->samples[p->first + k]);
    }
}

cairn_status cairn_shape_model_file_write(const cairn_shape_model *model, const char *path,
                                          cairn_file_error *error)
{
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);
    cairn_output *output;

    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.what);
    if (model->outline_count > CAIRN_SHAPE_FILE_OUTLINE_MOST ||
        model->sample_count > CAIRN_SHAPE_FILE_SAMPLES_MOST)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "a model of %d and %d samples, expected at most %d of the outline and %d of paths",
            (int)model->outline_count, (int)model->sample_count, CAIRN_SHAPE_FILE_OUTLINE_MOST,
            CAIRN_SHAPE_FILE_SAMPLES_MOST);
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    print_model(output, model);
    return cairn_output_commit(output, error);
}
