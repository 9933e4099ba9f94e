/* Detection by parts as written: hypotheses are sets of whole edge fragments; boxes are the
 * bounding boxes of the fragments.
 *
 * Choices, where the text leaves details open:
 * - The shape of a hypothesis is that of its whole edge fragments, as linked (section 5.3.1:
 *   configurations are groups of edge fragments), sampled at 64 even steps, as many as the outline.
 *   So it is the same for all configurations of the same edge fragments, and only the one of the
 *   greatest sum of similarities is evaluated.
 * - It is not warped onto the model before the comparison: the text mentions no warp, and a
 *   straight edge warps onto anything.
 * - The distance is the sum of both directions' mean costs of the best matches.
 * - With appearance, lambda times the distance to the nearest positive support vector, one of the
 *   training histograms, is added (eq. 5.1, section 5.4.2: "each configuration finds its nearest
 *   neighbor"): half of chi-squared. Alternative: 1 - probability (section 5.3.2: the confidence of
 *   the support vector machine).
 * - Non-maximum suppression: of hypotheses whose intersection over union exceeds `overlap` the one
 *   of the least distance stays, because images hold several objects or none.
 *
 * Source: Adluru 2008, section 5.3. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/detection/object_detect_object.h"

/* Constants of the hash of a set of chains (FNV-1a by words). */
#define HASH_PRIME UINT32_C(16777619)
enum { HASH_FOLD_BITS = 15 };

/* Segments compared with the parts of a detection, outline samples placed in a unit. */
enum { PAIRS_PER_UNIT = 16, SAMPLES_PER_UNIT = 4 };

/* ---- The shape of a hypothesis ---- */

/* Samples the even steps that fall on a chain; *at: px from its first point to the next step. */
static int32_t sample_chain(const cairn_curve *chain, cairn_real step, cairn_real *next,
                            cairn_vec2 *points, int32_t capacity)
{
    int32_t count = 0;

    for (int32_t i = 0; i < cairn_curve_side_count(chain); i++) {
        cairn_segment side = cairn_curve_side(chain, i);
        cairn_real length = cairn_segment_length(side);

        while (*next < length && count < capacity) {
            points[count++] = cairn_vec2_interpolate(side.a, side.b, *next / length);
            *next += step;
        }
        *next -= length;
    }
    return count;
}

int cairn_object_detect_written_sample(const cairn_object_detect_field *field,
                                       object_detect_hypothesis *hypothesis,
                                       const cairn_object_detect_part *parts, cairn_vec2 *points,
                                       int32_t count)
{
    cairn_real length = 0, step, next;
    cairn_box box = cairn_box_empty();
    int32_t sampled = 0;

    for (int32_t i = 0; i < hypothesis->part_count; i++) {
        const cairn_curve *chain = &field->chains.curves[parts[i].chain];

        length += cairn_curve_length(chain);
        for (int32_t k = 0; k < chain->count; k++)
            box = cairn_box_extend(box, chain->points[k]);
    }
    if (!(length > 0))
        return 0;
    hypothesis->left = box.min.x;
    hypothesis->top = box.min.y;
    hypothesis->right = box.max.x;
    hypothesis->bottom = box.max.y;
    step = length / (cairn_real)count;
    next = step / 2;
    for (int32_t i = 0; i < hypothesis->part_count; i++)
        sampled += sample_chain(&field->chains.curves[parts[i].chain], step, &next,
                                points + sampled, count - sampled);
    for (; sampled < count && sampled > 0; sampled++)
        points[sampled] = points[sampled - 1];
    return sampled == count;
}

/* ---- Sets of chains ---- */

void cairn_object_detect_chain_sets_clear(object_detect_chain_sets *sets)
{
    sets->count = 0;
    memset(sets->slots, -1, ((size_t)sets->mask + 1) * sizeof *sets->slots);
}

int cairn_object_detect_chain_sets_add(object_detect_chain_sets *sets,
                                       const cairn_object_detect_part *parts, int32_t count)
{
    int32_t *chains = sets->chains[sets->count];
    uint32_t hash = 0, index;

    for (int32_t i = 0; i < CAIRN_PART_MAX_BUNDLES; i++) {
        int32_t chain = i < count ? parts[i].chain : -1, k = i;

        for (; i < count && k > 0 && chains[k - 1] > chain; k--)
            chains[k] = chains[k - 1];
        chains[k] = chain;
    }
    for (int32_t i = 0; i < CAIRN_PART_MAX_BUNDLES; i++)
        hash = (hash ^ (uint32_t)chains[i]) * HASH_PRIME;
    for (index = (hash ^ hash >> HASH_FOLD_BITS) & sets->mask; sets->slots[index] >= 0;
         index = (index + 1) & sets->mask)
        if (memcmp(sets->chains[sets->slots[index]], chains, sizeof *sets->chains) == 0)
            return 0;
    sets->slots[index] = sets->count++;
    return 1;
}

/* ---- Detections ---- */

static void set_detection(cairn_object_detection *detection,
                          const object_detect_hypothesis *hypothesis)
{
    memset(detection, 0, sizeof *detection);
    detection->left = hypothesis->left;
    detection->top = hypothesis->top;
    detection->right = hypothesis->right;
    detection->bottom = hypothesis->bottom;
    detection->origin = hypothesis->origin;
    detection->size = hypothesis->size;
    detection->mirrored = hypothesis->mirrored;
    cairn_object_detect_set_part_scores(hypothesis, detection);
}

int cairn_object_detect_written_step(cairn_object_detector *detector, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(detector->phase_resume);
    for (detector->cursor = 0; detector->cursor < detector->parts.count; detector->cursor++) {
        CAIRN_STEP_CHARGE_UNIT(detector, phase_resume, budget);
        set_detection(cairn_object_detect_current(detector),
                      &detector->parts.list[detector->cursor]);
        CAIRN_STEP_RUN(detector, phase_resume, budget, cairn_object_detect_keep_step);
    }
    CAIRN_STEP_END(detector->phase_resume);
}

/* Appends all lines of the fragments' chains. */
static void append_lines(cairn_object_detections *found, cairn_object_detection *detection,
                         const cairn_contour_search_tokens *tokens)
{
    detection->first_segment = found->segment_count;
    for (int32_t i = 0; i < tokens->count; i++)
        for (int32_t k = 0; k < detection->part_count; k++)
            if (found->parts[detection->first_part + k].chain == tokens->chain[i]) {
                found->segments[found->segment_count++] = i;
                break;
            }
    detection->segment_count = found->segment_count - detection->first_segment;
}

/* Appends the model outline at the voted pose; all samples are unmatched. Outline index 1: all
 * outlines after the first. */
static void append_outline(cairn_object_detections *found, cairn_object_detection *detection,
                           const cairn_shape_model *model)
{
    int32_t first_outline = cairn_shape_model_first_outline(model);

    detection->first_outline = found->outline_count;
    detection->outline_count = model->outline_count;
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_contour_search_place *sample = &found->outline[found->outline_count++];
        cairn_oriented_point position = model->outline[i];

        position.position.x *= detection->mirrored ? -1 : 1;
        position.direction.x *= detection->mirrored ? -1 : 1;
        sample->point.position =
            cairn_vec2_add(detection->origin, cairn_vec2_scale(position.position, detection->size));
        sample->point.direction = position.direction;
        sample->outline_index = i >= first_outline;
        sample->segment = -1;
    }
}

/* Units of the lines and the outline of a detection. */
static int32_t units_of_outline(const cairn_object_detector *detector,
                                const cairn_object_detection *detection)
{
    return 1 + detector->model->outline_count / SAMPLES_PER_UNIT +
           detector->field->tokens.count * detection->part_count / PAIRS_PER_UNIT;
}

int cairn_object_detect_written_outlines_step(cairn_object_detector *detector, cairn_budget *budget)
{
    cairn_object_detections *found = &detector->result;

    CAIRN_STEP_BEGIN(detector->phase_resume);
    if (found->count > detector->params.max_detections)
        detector->status = CAIRN_FULL;
    CAIRN_STEP_UNTIL(detector->phase_resume, detector->status == CAIRN_OK);
    for (detector->cursor = 0; detector->cursor < found->count; detector->cursor++) {
        CAIRN_STEP_CHARGE(detector, phase_resume, budget,
                          units_of_outline(detector, &found->found[detector->cursor]));
        append_lines(found, &found->found[detector->cursor], &detector->field->tokens);
        append_outline(found, &found->found[detector->cursor], detector->model);
    }
    CAIRN_STEP_END(detector->phase_resume);
}
