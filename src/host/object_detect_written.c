/* Detection by parts as written: hypotheses are groups of whole edge fragments, boxes are those about them.
 *
 * Choices, where the text is silent: the shape of a hypothesis is that of its whole edge fragments, as linked (section 5.3.1: configurations are
 * groups of edge fragments), sampled at 64 even steps, as many as the outline, and so the same for
 * all configurations of the same edge fragments: the one of the greatest sum of similarities is looked at; it is not warped onto the model before it is
 * measured, for nothing is said of that and a straight edge warps onto anything; the distance is the sum of both directions' mean costs of the best
 * matches; with appearance lambda times the distance to the nearest words that were learnt is added (eq. 5.1, section 5.4.2: "each configuration finds its
 * nearest neighbor"), half of chi2, or what is missing to a probability of 1 (section 5.3.2: the confidence of a machine). Of hypotheses whose boxes share more than
 * `overlap` of their union the one of the least distance stays: the best of an image's place, for images hold several objects or none.
 *
 * Source: Adluru 2008, section 5.3. */
#include "src/core/build.h"

#include <stdlib.h>
#include <string.h>

#include "src/host/object_detect_work.h"

/* Of the hash of a set of chains (FNV-1a by words). */
#define HASH_PRIME UINT32_C(16777619)
enum { HASH_FOLD = 15 };

cairn_object_detect_params cairn_object_detect_as_written(int32_t width, int32_t height)
{
    cairn_object_detect_params params = cairn_object_detect_default(width, height);

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.method = CAIRN_DETECT_PARTS;
    params.verify = 0;
    params.appearance_nearest = 1;
    return params;
}

/* ---- The shape of a hypothesis ---- */

/* Adds what of even steps falls on a chain; *at: px from its first point to the next step. */
static int32_t lay_chain(const cairn_curve *chain, cairn_real step, cairn_real *at, cairn_vec2 *points, int32_t room)
{
    int32_t sides = chain->closed ? chain->count : chain->count - 1, count = 0;

    for (int32_t i = 0; i < sides; i++) {
        cairn_segment side = {chain->points[i], chain->points[(i + 1) % chain->count]};
        cairn_real length = cairn_segment_length(side);

        while (*at < length && count < room) {
            points[count++] = cairn_vec2_add(side.a, cairn_vec2_scale(cairn_vec2_sub(side.b, side.a), *at / length));
            *at += step;
        }
        *at -= length;
    }
    return count;
}

int cairn_detect_written_lay(const cairn_detect_field *field, detect_hypothesis *h, const cairn_detected_part *parts,
                             cairn_vec2 *points, int32_t count)
{
    cairn_real all = 0, step, at;
    cairn_box box = cairn_box_empty();
    int32_t laid = 0;

    for (int32_t i = 0; i < h->part_count; i++) {
        const cairn_curve *chain = &field->chains.curves[parts[i].chain];

        all += cairn_curve_length(chain);
        for (int32_t k = 0; k < chain->count; k++)
            box = cairn_box_extend(box, chain->points[k]);
    }
    if (!(all > 0))
        return 0;
    h->left = box.min.x;
    h->top = box.min.y;
    h->right = box.max.x;
    h->bottom = box.max.y;
    step = all / (cairn_real)count;
    at = step / 2;
    for (int32_t i = 0; i < h->part_count; i++)
        laid += lay_chain(&field->chains.curves[parts[i].chain], step, &at, points + laid, count - laid);
    for (; laid < count && laid > 0; laid++)
        points[laid] = points[laid - 1];
    return laid == count;
}

/* ---- Sets of chains ---- */

int cairn_detect_chain_sets_begin(detect_chain_sets *sets, int32_t room)
{
    size_t slots = 2;

    while (slots < 2 * (size_t)room)
        slots *= 2;
    sets->chain = malloc(((size_t)room + 1) * sizeof *sets->chain);
    sets->slot = malloc(slots * sizeof *sets->slot);
    sets->mask = (uint32_t)slots - 1;
    sets->count = 0;
    if (sets->chain == NULL || sets->slot == NULL)
        return 0;
    memset(sets->slot, -1, slots * sizeof *sets->slot);
    return 1;
}

void cairn_detect_chain_sets_free(detect_chain_sets *sets)
{
    free(sets->chain);
    free(sets->slot);
    memset(sets, 0, sizeof *sets);
}

int cairn_detect_chain_sets_add(detect_chain_sets *sets, const cairn_detected_part *parts, int32_t count)
{
    int32_t *own = sets->chain[sets->count];
    uint32_t hash = 0, at;

    for (int32_t i = 0; i < CAIRN_PART_BUNDLES; i++) {
        int32_t chain = i < count ? parts[i].chain : -1, k = i;

        for (; i < count && k > 0 && own[k - 1] > chain; k--)
            own[k] = own[k - 1];
        own[k] = chain;
    }
    for (int32_t i = 0; i < CAIRN_PART_BUNDLES; i++)
        hash = (hash ^ (uint32_t)own[i]) * HASH_PRIME;
    for (at = (hash ^ hash >> HASH_FOLD) & sets->mask; sets->slot[at] >= 0; at = (at + 1) & sets->mask)
        if (memcmp(sets->chain[sets->slot[at]], own, sizeof *sets->chain) == 0)
            return 0;
    sets->slot[at] = sets->count++;
    return 1;
}

/* ---- Detections ---- */

cairn_status cairn_detect_written_take(cairn_detections *found, const detect_hypotheses *made,
                                       const cairn_detect_field *field)
{
    const cairn_object_detect_params *p = &field->params;

    found->found = malloc(((size_t)made->count + 1) * sizeof *found->found);
    if (found->found == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t i = 0; i < made->count; i++) {
        const detect_hypothesis *h = &made->list[i];
        const double box[4] = {(double)h->left, (double)h->top, (double)h->right, (double)h->bottom};
        cairn_detection *o = &found->found[found->count];

        memset(o, 0, sizeof *o);
        o->left = h->left;
        o->top = h->top;
        o->right = h->right;
        o->bottom = h->bottom;
        o->origin = h->origin;
        o->size = h->size;
        o->mirrored = h->mirrored;
        o->score = h->score;
        o->distance = h->distance;
        o->agreement = h->agreement;
        o->first_part = h->first_part;
        o->part_count = h->part_count;
        found->count += o->score >= p->min_score;
        if (p->appearance != NULL) {
            o->appearance = (cairn_real)(p->appearance_nearest ? 1 - cairn_appearance_distance(p->appearance, box)
                                                               : cairn_appearance_probability(p->appearance, box));
            o->score -= p->appearance_weight * (1 - o->appearance);
        }
    }
    return CAIRN_OK;
}

/* All lines of the chains that the fragments are. */
static void take_lines(cairn_detections *found, cairn_detection *o, const cairn_contour_tokens *tokens)
{
    o->first_segment = found->segment_count;
    for (int32_t i = 0; i < tokens->count; i++)
        for (int32_t k = 0; k < o->part_count; k++)
            if (found->parts[o->first_part + k].chain == tokens->chain[i]) {
                found->segments[found->segment_count++] = i;
                break;
            }
    o->segment_count = found->segment_count - o->first_segment;
}

/* The drawn outline in the voted place; none of its samples is said to be seen. Part 1: all outlines behind the first. */
static void take_outline(cairn_detections *found, cairn_detection *o, const cairn_shape_model *model)
{
    o->first_outline = found->outline_count;
    o->outline_count = model->outline_count;
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_contour_place *place = &found->outline[found->outline_count++];
        cairn_oriented_point at = model->outline[i];

        at.position.x *= o->mirrored ? -1 : 1;
        at.direction.x *= o->mirrored ? -1 : 1;
        place->at.position = cairn_vec2_add(o->origin, cairn_vec2_scale(at.position, o->size));
        place->at.direction = at.direction;
        place->part = i >= cairn_shape_first_outline(model);
        place->segment = -1;
    }
}

cairn_status cairn_detect_written_draw(cairn_detections *found, const cairn_detect_field *field,
                                       const cairn_shape_model *model)
{
    size_t kept = (size_t)found->count + 1;

    found->segments = malloc((kept * (size_t)field->tokens->count + 1) * sizeof *found->segments);
    found->outline = malloc(kept * (size_t)model->outline_count * sizeof *found->outline);
    if (found->segments == NULL || found->outline == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t i = 0; i < found->count; i++) {
        cairn_detection *o = &found->found[i];

        take_lines(found, o, field->tokens);
        take_outline(found, o, model);
    }
    return CAIRN_OK;
}
