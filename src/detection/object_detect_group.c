/* Verification of detections by contour grouping (chapter 2), and detection of partly occluded
 * objects.
 *
 * Method: the grouping searches the model and its mirror image in successive bands of sizes. Its
 * evidence comes from the visible parts along chains of edges, whatever is occluded, and objects
 * may be rotated. Both complement the evidence of a deformed outline.
 *
 * Source: Adluru 2008, chapter 2 (contour_grouping). */
#include "src/base/build.h"

#include "cairn/detection_curve.h"
#include "src/base/step.h"
#include "src/detection/object_detect_object.h"

/* Least evidence of a kept object, nats. Deliberately low: spurious groupings near a detection
 * usually exceed it, so that it only bounds the list. */
static const cairn_real MIN_EVIDENCE = 2;
/* rad: greatest rotation either way. */
static const cairn_real MAX_ROTATION = 15 * (CAIRN_PI / 180);
/* Least intersection over union of boxes of one object. */
static const cairn_real MIN_OVERLAP = CAIRN_REAL(0.5);
/* Mean length of segments where the tokens have none, px. */
static const cairn_real DEFAULT_LENGTH_PX = 5;
enum { SAMPLES_PER_UNIT = 4 };

static cairn_contour_grouping_params grouping_params(const cairn_object_detect_params *params)
{
    cairn_contour_grouping_params grouping = cairn_contour_grouping_default();

    grouping.max_width = params->max_width;
    grouping.max_height = params->max_height;
    grouping.max_tokens = params->max_tokens;
    grouping.max_samples = params->max_samples;
    grouping.max_outline = params->max_outline;
    grouping.max_objects = OBJECT_DETECT_MAX_OBJECTS_PER_SEARCH;
    grouping.min_evidence = MIN_EVIDENCE;
    grouping.min_score = 0;
    return grouping;
}

void cairn_object_detect_group_take(object_detect_group_search *group, cairn_pool *pool,
                                    const cairn_object_detect_params *params)
{
    cairn_contour_grouping_params grouping = grouping_params(params);

    CAIRN_TAKE(group, pool, list, OBJECT_DETECT_MAX_GROUPINGS);
    CAIRN_TAKE(group, pool, samples, params->mirror ? params->max_samples : 0);
    CAIRN_TAKE(group, pool, outline, params->mirror ? params->max_outline : 0);
    CAIRN_TAKE_OBJECT(group, pool, grouping, contour_grouping, &grouping);
}

/* Computes the bounding box of the model at the grouped pose. */
static void set_box(const cairn_shape_model *model, object_detect_grouping *grouped)
{
    cairn_similarity pose =
        cairn_similarity_of(grouped->found.origin, grouped->found.size, grouped->found.turn);
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < model->outline_count; i++)
        box = cairn_box_extend(box, cairn_similarity_point(pose, model->outline[i].position));
    grouped->box[0] = box.min.x;
    grouped->box[1] = box.min.y;
    grouped->box[2] = box.max.x;
    grouped->box[3] = box.max.y;
}

static const cairn_shape_model *current_model(const cairn_object_detector *detector)
{
    return detector->group.mirrored ? &detector->group.mirrored_model : detector->model;
}

static void append_objects(cairn_object_detector *detector)
{
    object_detect_group_search *group = &detector->group;
    cairn_contour_grouping_result result = cairn_contour_grouping_read(group->grouping);

    for (int32_t i = 0; i < result.object_count && group->count < OBJECT_DETECT_MAX_GROUPINGS;
         i++) {
        object_detect_grouping *grouped = &group->list[group->count++];

        grouped->found = result.objects[i];
        grouped->mirrored = group->mirrored;
        set_box(current_model(detector), grouped);
    }
}

void cairn_object_detect_group_begin(cairn_object_detector *detector)
{
    object_detect_group_search *group = &detector->group;

    group->count = group->resume = group->units_charged = 0;
    group->bands =
        cairn_contour_search_band_count(detector->params.min_size, detector->params.max_size);
}

/* Starts the grouping in the current band of sizes. */
static cairn_status begin_band(cairn_object_detector *detector)
{
    const cairn_object_detect_params *params = &detector->params;
    const cairn_contour_search_tokens *tokens = &detector->field->tokens;
    object_detect_group_search *group = &detector->group;
    cairn_contour_grouping_input input = {
        .segments = tokens->lines,
        .count = tokens->count,
        .width = tokens->width,
        .height = tokens->height,
        .model = current_model(detector),
        .min_size = cairn_contour_search_band_bound(params->min_size, params->max_size,
                                                    group->bands, group->band),
        .max_size = cairn_contour_search_band_bound(params->min_size, params->max_size,
                                                    group->bands, group->band + 1),
        .min_turn = -MAX_ROTATION,
        .max_turn = MAX_ROTATION,
        .mean_length = tokens->mean_length > 0 ? tokens->mean_length : DEFAULT_LENGTH_PX};

    input.max_size = cairn_max(input.min_size, input.max_size);
    return cairn_contour_grouping_begin(group->grouping, &input);
}

static int32_t compare_groupings(const void *first, const void *second)
{
    const object_detect_grouping *a = first, *b = second;

    if (a->found.evidence != b->found.evidence)
        return a->found.evidence < b->found.evidence ? 1 : -1;
    if (a->mirrored != b->mirrored)
        return a->mirrored - b->mirrored;
    if (a->found.origin.y != b->found.origin.y)
        return a->found.origin.y < b->found.origin.y ? -1 : 1;
    return a->found.origin.x < b->found.origin.x ? -1 : a->found.origin.x > b->found.origin.x;
}

/* Units of the boxes of a band's objects. */
static int32_t units_of_boxes(const cairn_object_detector *detector)
{
    return 1 + cairn_contour_grouping_read(detector->group.grouping).object_count *
                   detector->model->outline_count / SAMPLES_PER_UNIT;
}

int cairn_object_detect_group_step(cairn_object_detector *detector, cairn_budget *budget)
{
    object_detect_group_search *group = &detector->group;

    CAIRN_STEP_BEGIN(group->resume);
    for (group->mirrored = 0; group->mirrored <= detector->params.mirror; group->mirrored++) {
        for (group->band = 0; group->band < group->bands; group->band++) {
            CAIRN_STEP_CHARGE(group, resume, budget, contour_search_band_units(detector->model));
            if (group->mirrored && group->band == 0)
                cairn_shape_model_mirror(detector->model, group->samples, group->outline,
                                         &group->mirrored_model);
            detector->status = begin_band(detector);
            CAIRN_STEP_UNTIL(group->resume, detector->status == CAIRN_OK);
            CAIRN_STEP_UNTIL(group->resume, (detector->status = cairn_contour_grouping_step(
                                                 group->grouping, budget)) == CAIRN_OK);
            CAIRN_STEP_CHARGE(group, resume, budget, units_of_boxes(detector));
            append_objects(detector);
        }
    }
    cairn_detection_sort_begin(&group->sort, group->list, group->count, sizeof *group->list,
                               compare_groupings);
    CAIRN_STEP_UNTIL(group->resume, cairn_detection_sort_step(&group->sort, budget));
    CAIRN_STEP_END(group->resume);
}

cairn_real cairn_object_detect_grouped_evidence(const object_detect_group_search *group,
                                                const cairn_object_detection *detection)
{
    const cairn_real own[4] = {detection->left, detection->top, detection->right,
                               detection->bottom};

    for (int32_t i = 0; i < group->count; i++)
        if (cairn_detection_curve_overlap(group->list[i].box, own) >= MIN_OVERLAP)
            return group->list[i].found.evidence;
    return 0;
}
