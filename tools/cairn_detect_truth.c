/* Comparison of detections with ground truth: hits, curves. */
#include "tools/cairn_detect_truth.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/detection_curve_file.h"
#include "cairn/output.h"

/* Minimum intersection over union of a detection and its object; as written it must exceed 0.2
 * (Adluru 2008, section 5.4.1). */
#define MIN_IOU         CAIRN_REAL(0.5)
#define WRITTEN_MIN_IOU CAIRN_REAL(0.2)

static int is_hit(const detect_truth *truth, cairn_real share)
{
    return truth->as_written ? share > WRITTEN_MIN_IOU : share >= MIN_IOU;
}

static void to_reals(const double corners[4], cairn_real box[4])
{
    for (int32_t k = 0; k < 4; k++)
        box[k] = (cairn_real)corners[k];
}

/* Assigns detections to objects greedily by score; each object is assigned once. */
static void print_hits(const detect_truth *truth, const cairn_detection_file_picture *picture,
                       const cairn_real (*objects)[4], int32_t count, int32_t *taken, FILE *record)
{
    const cairn_object_detections *found = picture->detections;

    for (int32_t i = 0; i < found->count; i++) {
        double corners[4];
        cairn_real box[4], share;
        int32_t object, hit;

        cairn_detection_file_box(picture, &found->found[i], corners);
        to_reals(corners, box);
        object = cairn_detection_curve_object(objects, taken, count, box, &share);
        hit = object >= 0 && is_hit(truth, share);
        if (hit)
            taken[object] = 1;
        fprintf(record, "%.17g %" PRId32 "\n", (double)found->found[i].score, hit);
    }
}

cairn_status detect_truth_print(const detect_truth *truth, const char *path,
                                const cairn_detection_file_picture *picture, FILE *record,
                                cairn_file_error *error)
{
    int32_t count, first = cairn_box_table_find(truth->rows, truth->count,
                                                cairn_output_path_name(path), &count);
    cairn_real(*objects)[4] = malloc(((size_t)count + 1) * sizeof *objects);
    int32_t *taken = calloc((size_t)count + 1, sizeof *taken);
    cairn_status status = CAIRN_OK;

    if (objects != NULL && taken != NULL) {
        for (int32_t i = 0; i < count; i++)
            to_reals(truth->rows[first + i].box, objects[i]);
        print_hits(truth, picture, (const cairn_real(*)[4])objects, count, taken, record);
    } else {
        status = cairn_file_error_system(error, path, "detect", ENOMEM);
    }
    free(objects);
    free(taken);
    return status;
}

cairn_status detect_truth_read(detect_truth *truth, const char *path, cairn_file_error *error)
{
    cairn_status status = cairn_box_table_read(path, &truth->rows, &truth->count, error);

    if (status == CAIRN_OK)
        cairn_box_table_sort(truth->rows, truth->count);
    return status;
}

int detect_truth_parse(detect_truth *truth, const char *line)
{
    cairn_detection_curve_event *e;
    char *end;

    if (truth->event_count == truth->event_capacity) {
        int32_t capacity = 2 * truth->event_capacity + 64;

        e = realloc(truth->events, (size_t)capacity * sizeof *e);
        if (e == NULL)
            return 0;
        truth->events = e;
        truth->event_capacity = capacity;
    }
    e = &truth->events[truth->event_count++];
    e->score = (cairn_real)strtod(line, &end);
    e->hit = (int32_t)strtol(end, NULL, 10);
    return 1;
}

static int32_t count_objects(const detect_truth *truth, const char *const *images, size_t count)
{
    int32_t objects = 0;

    for (size_t k = 0; k < count; k++) {
        int32_t own;

        (void)cairn_box_table_find(truth->rows, truth->count, cairn_output_path_name(images[k]),
                                   &own);
        objects += own;
    }
    return objects;
}

cairn_status detect_truth_write(detect_truth *truth, const char *const *images, size_t count,
                                const char *stem, const char *title, cairn_file_error *error)
{
    cairn_detection_curve_point *points = malloc(((size_t)truth->event_count + 1) * sizeof *points);
    cairn_fault fault = {-1, NULL};
    cairn_status status;

    if (points == NULL)
        return cairn_file_error_system(error, stem, "curves", ENOMEM);
    status = cairn_detection_curve(truth->events, truth->event_count, (int32_t)count,
                                   count_objects(truth, images, count), points, &fault);
    status = status == CAIRN_OK
                 ? cairn_detection_curve_file_write(stem, title, points, truth->event_count, error)
                 : cairn_file_error_set(error, status, stem, 0, "%s", fault.message);
    free(points);
    return status;
}

void detect_truth_free(detect_truth *truth)
{
    free(truth->rows);
    free(truth->events);
    memset(truth, 0, sizeof *truth);
}
