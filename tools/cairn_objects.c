/* Objects found in images as COCO annotations, masks and label images.
 *
 * Method
 * 1. A mask holds the pixels whose centres lie inside the outlines by the even-odd rule, so that
 *    holes are outside.
 * 2. An outline is a hole when its signed area has another sign than that of the largest one.
 * 3. Coordinates of COCO begin at the corner of the first pixel, half a pixel before its centre. */
#include "tools/cairn_objects.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/json_text.h"
#include "cairn/number_text.h"
#include "src/host/files/map_file_image.h"
#include "src/host/pictures/report_text.h"
#include "tools/cairn_picture.h"
#include "tools/cairn_tool.h"

/* Annotations of an image have the numbers from its id times this on. */
enum { MAX_OBJECTS = 100000, MAX_LABEL = 255 };

/* Appends an object of `count` vertices, not set yet. NULL: no memory. */
static objects_shape *append(objects_image *image, int32_t count)
{
    objects_shape *grown = realloc(image->shape, ((size_t)image->count + 1) * sizeof *grown),
                  *shape;

    if (grown == NULL)
        return NULL;
    image->shape = grown;
    shape = &grown[image->count++];
    memset(shape, 0, sizeof *shape);
    shape->point = calloc((size_t)count + 1, sizeof *shape->point);
    shape->outline = calloc((size_t)count + 1, sizeof *shape->outline);
    shape->count = count;
    return shape->point != NULL && shape->outline != NULL ? shape : NULL;
}

/* Sets the box to that of the vertices, clipped to the image. */
static void set_box(const objects_image *image, objects_shape *shape)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < shape->count; i++)
        box = cairn_box_extend(box, shape->point[i]);
    shape->box[0] = fmin(fmax(0, (double)box.min.x), image->width);
    shape->box[1] = fmin(fmax(0, (double)box.min.y), image->height);
    shape->box[2] = fmax(fmin((double)box.max.x, image->width), shape->box[0]);
    shape->box[3] = fmax(fmin((double)box.max.y, image->height), shape->box[1]);
}

/* Returns a point of the searched image in pixels of the image. */
static cairn_vec2 image_point(cairn_vec2 p, int32_t shrink)
{
    cairn_real half = CAIRN_REAL(0.5), scale = (cairn_real)shrink;

    p.x = (p.x + half) * scale - half;
    p.y = (p.y + half) * scale - half;
    return p;
}

objects_shape *objects_append_outline(objects_image *image,
                                      const cairn_contour_search_place *outline, int32_t count,
                                      int32_t shrink)
{
    objects_shape *shape = append(image, count);

    if (shape == NULL)
        return NULL;
    for (int32_t i = 0; i < count; i++) {
        shape->point[i] = image_point(outline[i].point.position, shrink);
        shape->outline[i] = outline[i].outline_index;
    }
    set_box(image, shape);
    return shape;
}

objects_shape *objects_append_segments(objects_image *image, const cairn_segment *lines,
                                       const int32_t *segments, int32_t count, int32_t shrink)
{
    objects_shape *shape = append(image, 2 * count);

    if (shape == NULL)
        return NULL;
    for (int32_t i = 0; i < count; i++) {
        shape->point[2 * i] = image_point(lines[segments[i]].a, shrink);
        shape->point[2 * i + 1] = image_point(lines[segments[i]].b, shrink);
    }
    shape->crosses = 1;
    set_box(image, shape);
    return shape;
}

void objects_free(objects_image *image)
{
    for (int32_t i = 0; i < image->count; i++) {
        free(image->shape[i].point);
        free(image->shape[i].outline);
    }
    free(image->shape);
    image->shape = NULL;
    image->count = 0;
}

/* Returns the end of the outline that begins at vertex `first`. */
static int32_t outline_end(const objects_shape *shape, int32_t first)
{
    int32_t end = first + 1;

    while (end < shape->count && shape->outline[end] == shape->outline[first])
        end++;
    return end;
}

/* ---- Masks ---- */

static int compare_columns(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Sets columns[] to where the outlines cross the row, in order; returns their number, which is
 * even. columns: [count of vertices]. */
static int32_t cross_row(const objects_shape *shape, int32_t row, double *columns)
{
    int32_t crossings = 0;

    for (int32_t first = 0, end; first < shape->count; first = end) {
        end = outline_end(shape, first);
        for (int32_t i = first; i < end; i++) {
            cairn_vec2 a = shape->point[i], b = shape->point[i + 1 < end ? i + 1 : first];

            if (((double)a.y <= row) != ((double)b.y <= row))
                columns[crossings++] = (double)a.x + (row - (double)a.y) /
                                                         ((double)b.y - (double)a.y) *
                                                         ((double)b.x - (double)a.x);
        }
    }
    qsort(columns, (size_t)crossings, sizeof *columns, compare_columns);
    return crossings;
}

/* Sets the pixels inside the object to a value. CAIRN_NO_MEMORY. */
static cairn_status fill(const objects_image *image, const objects_shape *shape, uint8_t value,
                         uint8_t *mask)
{
    double *columns = malloc(((size_t)shape->count + 1) * sizeof *columns);

    if (columns == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t row = 0; row < image->height; row++) {
        int32_t crossings = cross_row(shape, row, columns);

        for (int32_t k = 0; k + 1 < crossings; k += 2) {
            double from = fmax(0, ceil(columns[k])),
                   to = fmin(image->width - 1, floor(columns[k + 1]));

            if (from <= to)
                memset(mask + (size_t)row * (size_t)image->width + (size_t)from, value,
                       (size_t)(to - from) + 1);
        }
    }
    free(columns);
    return CAIRN_OK;
}

/* Writes a mask to FOLDER/STEM-WHAT.png. */
static cairn_status write_mask(const objects_image *image, const uint8_t *mask, const char *folder,
                               const char *name, cairn_file_error *error)
{
    char *path = cairn_output_path_join(folder, name);
    cairn_status status;

    if (path == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, name, 0, "no memory");
    status = cairn_image_write_png(path, mask, image->width, image->height, error);
    free(path);
    return status;
}

/* Removes the masks from number `first` on. */
static void remove_masks(const char *folder, const char *stem, int32_t first)
{
    int is_removed = 1;

    for (int32_t k = first; is_removed; k++) {
        char name[PICTURE_NAME_BYTES + 32], *path;

        (void)snprintf(name, sizeof name, "%s-mask-%" PRId32 ".png", stem, k);
        path = cairn_output_path_join(folder, name);
        is_removed = path != NULL && unlink(path) == 0;
        free(path);
    }
}

cairn_status objects_write_masks(const objects_image *image, const char *folder, const char *stem,
                                 cairn_file_error *error)
{
    size_t pixels = (size_t)image->width * (size_t)image->height;
    uint8_t *mask = malloc(pixels), *labels = calloc(pixels, 1);
    char name[PICTURE_NAME_BYTES + 32];
    cairn_status status;

    if (mask == NULL || labels == NULL) {
        free(mask);
        free(labels);
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, image->path, 0,
                                    "no memory for the masks");
    }
    status = cairn_output_folder(folder, error);
    /* The better one is drawn over the worse one. */
    for (int32_t k = image->count; k >= 1 && status == CAIRN_OK; k--) {
        const objects_shape *shape = &image->shape[k - 1];

        memset(mask, 0, pixels);
        status = fill(image, shape, 255, mask);
        if (status == CAIRN_OK && k <= MAX_LABEL)
            status = fill(image, shape, (uint8_t)k, labels);
        if (status != CAIRN_OK) {
            (void)cairn_file_error_set(error, status, image->path, 0, "no memory for the masks");
            break;
        }
        (void)snprintf(name, sizeof name, "%s-mask-%" PRId32 ".png", stem, k);
        status = write_mask(image, mask, folder, name, error);
    }
    if (status == CAIRN_OK) {
        (void)snprintf(name, sizeof name, "%s-labels.png", stem);
        status = write_mask(image, labels, folder, name, error);
    }
    if (status == CAIRN_OK)
        remove_masks(folder, stem, image->count + 1);
    free(mask);
    free(labels);
    return status;
}

/* ---- COCO ---- */

/* Prints text as a JSON string. */
static void print_text(const char *text, FILE *file)
{
    fputc('"', file);
    while (*text != '\0') {
        char escaped[CAIRN_JSON_CHARACTER_BYTES];
        size_t bytes = cairn_json_character(&text, escaped);

        (void)fwrite(escaped, 1, bytes, file);
    }
    fputc('"', file);
}

/* Prints a number with two digits after the point, without the locale. */
static void print_number(double value, FILE *file)
{
    int64_t hundredths = llround(value * 100);
    int64_t size = hundredths < 0 ? -hundredths : hundredths;

    fprintf(file, "%s%" PRId64 ".%02d", hundredths < 0 ? "-" : "", size / 100, (int)(size % 100));
}

void objects_print_image(const objects_image *image, FILE *file)
{
    fprintf(file, ",\n  {\"id\": %" PRId32 ", \"file_name\": ", image->id);
    print_text(cairn_output_path_name(image->path), file);
    fprintf(file, ", \"width\": %" PRId32 ", \"height\": %" PRId32 "}", image->width,
            image->height);
}

/* Twice the signed area of an outline. */
static double area_of(const objects_shape *shape, int32_t first, int32_t end)
{
    double sum = 0;

    for (int32_t i = first; i < end; i++) {
        cairn_vec2 a = shape->point[i], b = shape->point[i + 1 < end ? i + 1 : first];

        sum += (double)a.x * (double)b.y - (double)b.x * (double)a.y;
    }
    return sum;
}

static int has_holes(const objects_shape *shape)
{
    double largest = 0;
    int found = 0;

    for (int32_t first = 0, end; first < shape->count; first = end) {
        double area;

        end = outline_end(shape, first);
        area = area_of(shape, first, end);
        largest = fabs(area) > fabs(largest) ? area : largest;
    }
    for (int32_t first = 0, end; first < shape->count; first = end) {
        end = outline_end(shape, first);
        found |= area_of(shape, first, end) * largest < 0;
    }
    return found;
}

static void print_polygons(const objects_shape *shape, FILE *file)
{
    const char *comma = "";

    fputc('[', file);
    for (int32_t first = 0, end; first < shape->count; first = end) {
        end = outline_end(shape, first);
        if (end - first < 3)
            continue;
        fprintf(file, "%s[", comma);
        comma = ", ";
        for (int32_t i = first; i < end; i++) {
            if (i > first)
                fputs(", ", file);
            print_number((double)shape->point[i].x + 0.5, file);
            fputs(", ", file);
            print_number((double)shape->point[i].y + 0.5, file);
        }
        fputc(']', file);
    }
    fputc(']', file);
}

/* Prints the runs of pixels outside and inside in turn, column by column. */
static void print_runs(const objects_image *image, const uint8_t *mask, FILE *file)
{
    size_t pixels = (size_t)image->width * (size_t)image->height, run = 0;
    int32_t inside = 0;
    const char *comma = "";

    fprintf(file, "{\"size\": [%" PRId32 ", %" PRId32 "], \"counts\": [", image->height,
            image->width);
    for (size_t i = 0; i <= pixels; i++) {
        size_t x = i / (size_t)image->height, y = i % (size_t)image->height;

        if (i < pixels && (mask[y * (size_t)image->width + x] != 0) == inside) {
            run++;
            continue;
        }
        fprintf(file, "%s%zu", comma, run);
        comma = ", ";
        inside = !inside;
        run = 1;
    }
    fputs("]}", file);
}

static void print_annotation(const objects_image *image, int32_t index, const uint8_t *mask,
                             FILE *file)
{
    const objects_shape *shape = &image->shape[index];
    const double *box = shape->box;
    const double place[4] = {fmin(box[0] + 0.5, image->width), fmin(box[1] + 0.5, image->height),
                             fmin(box[2] + 0.5, image->width), fmin(box[3] + 0.5, image->height)};
    size_t pixels = (size_t)image->width * (size_t)image->height, area = 0;
    char score[CAIRN_NUMBER_TEXT_BYTES];

    for (size_t i = 0; i < pixels; i++)
        area += mask[i] != 0;
    fprintf(file,
            ",\n  {\"id\": %" PRId64 ", \"image_id\": %" PRId32
            ", \"category_id\": 1, \"iscrowd\": 0, \"score\": %s, \"area\": %zu, \"bbox\": [",
            (int64_t)image->id * MAX_OBJECTS + index, image->id,
            cairn_number_write(score, (cairn_real)shape->score), area);
    print_number(place[0], file);
    fputs(", ", file);
    print_number(place[1], file);
    fputs(", ", file);
    print_number(place[2] - place[0], file);
    fputs(", ", file);
    print_number(place[3] - place[1], file);
    fputs("], \"segmentation\": ", file);
    if (shape->crosses || has_holes(shape))
        print_runs(image, mask, file);
    else
        print_polygons(shape, file);
    fputc('}', file);
}

cairn_status objects_print_annotations(const objects_image *image, FILE *file)
{
    size_t pixels = (size_t)image->width * (size_t)image->height;
    uint8_t *mask = malloc(pixels);
    cairn_status status = mask != NULL ? CAIRN_OK : CAIRN_NO_MEMORY;

    for (int32_t i = 0; i < image->count && i < MAX_OBJECTS && status == CAIRN_OK; i++) {
        memset(mask, 0, pixels);
        status = fill(image, &image->shape[i], 1, mask);
        if (status == CAIRN_OK)
            print_annotation(image, i, mask, file);
    }
    free(mask);
    return status;
}

cairn_status objects_coco_open(objects_coco *coco, const char *path, cairn_file_error *error)
{
    cairn_status status;

    memset(coco, 0, sizeof *coco);
    status = tool_output_open(&coco->output, path, error);
    if (status != CAIRN_OK)
        return status;
    if (cairn_text_stream_open(&coco->images) && cairn_text_stream_open(&coco->annotations))
        return CAIRN_OK;
    objects_coco_discard(coco);
    return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory");
}

/* Prints the items of an array without the comma before the first one. */
static void print_items(cairn_output *output, const char *name, const char *items)
{
    cairn_output_print(output, "\"%s\": [", name);
    if (*items == ',')
        cairn_output_bytes(output, items + 1, strlen(items + 1));
    cairn_output_print(output, "],\n ");
}

cairn_status objects_coco_commit(objects_coco *coco, const char *program, const char *model,
                                 cairn_file_error *error)
{
    char *images = cairn_text_stream_close(&coco->images),
         *annotations = cairn_text_stream_close(&coco->annotations);
    char category[PICTURE_NAME_BYTES] = "";
    cairn_status status = CAIRN_NO_MEMORY;

    (void)picture_stem(model, category);
    if (images != NULL && annotations != NULL) {
        cairn_output_print(coco->output, "{\"info\": {\"description\": \"%s\"},\n ", program);
        print_items(coco->output, "images", images);
        print_items(coco->output, "annotations", annotations);
        cairn_output_print(coco->output, "\"categories\": [{\"id\": 1, \"name\": ");
        cairn_report_print_json(coco->output, category);
        cairn_output_print(coco->output, "}]}\n");
        status = cairn_output_commit(coco->output, error);
    } else {
        cairn_output_discard(coco->output);
        (void)cairn_file_error_set(error, status, program, 0, "no memory for the COCO file");
    }
    free(images);
    free(annotations);
    return status;
}

void objects_coco_discard(objects_coco *coco)
{
    cairn_output_discard(coco->output);
    if (coco->images.stream != NULL)
        free(cairn_text_stream_close(&coco->images));
    if (coco->annotations.stream != NULL)
        free(cairn_text_stream_close(&coco->annotations));
}
