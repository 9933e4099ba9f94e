/* Alignment with virtual scans: parameters, memory and result.
 *
 * Method.
 *
 * 1. When the aligner has ended, the poses of all scans go to the force field. Fixed there are the
 *    scans that it has anchored, those with an unobservable translation, and those whose walls have
 *    one direction only, which hypotheses cannot constrain.
 * 2. Hypotheses are derived from the fixed scans alone, since moving scans would generate
 *    hypotheses that hold them in place. Where all scans move, they are derived from all, anew
 *    every few iterations. They enter the field as external points.
 * 3. From the field's poses the aligner searches for the scans that it had not anchored; without
 *    any match before it starts anew.
 * 4. When it then anchors more scans than before, these enter the result, transformed by the motion
 *    that maps the previously anchored scans to their former poses; those stay there, with their new
 *    covariances. Otherwise the former result stands, and only scans that share no surface with the
 *    largest component keep the field's poses.
 * 5. Last, weakly observable submaps of the largest component are translated along their walls
 *    (weak_direction).
 *
 * Layout: the aligner, the field, the hypotheses and the search along weak directions in one pool.
 * A scan has the same index in the aligner and in the field. The best result of the aligner is
 * stored beside it.
 *
 * Limits: a scan moved by the field keeps the covariance of its initial pose, and one translated
 * along walls that of its previous pose.
 *
 * Source: Adluru 2008, chapter 8. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/virtual_align_work.h"

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_virtual_align_params, field, is, from, to)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(rebuild_interval, 8, 1, INT32_MAX),
    INTEGER(max_rounds, 2, 1, INT32_MAX),
    INTEGER(use_aligner, 1, 0, 1),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
};
const cairn_parameters cairn_virtual_align_parameters =
    CAIRN_PARAMETERS("virtual_align", cairn_virtual_align_params, rows);

cairn_virtual_align_params cairn_virtual_align_default(void)
{
    cairn_virtual_align_params params;

    cairn_parameters_preset(&cairn_virtual_align_parameters, &params);
    params.aligner = cairn_aligner_default();
    params.field = cairn_force_field_springs(CAIRN_REAL(0.9), 15);
    params.field.oriented_below = params.field.sigma_start;
    params.field.potential = 0;
    params.hypotheses = cairn_virtual_scan_default();
    params.hypotheses.spacing = CAIRN_REAL(0.30);
    params.hypotheses.weight = 3;
    params.weak_direction = cairn_weak_direction_default();
    return params;
}

/* maximum iterations of algorithm 2, those of fig. 8.12 */
enum { MAX_ITERATIONS_AS_WRITTEN = 100 };

/* Returns the params with the values that the mode prescribes. */
static cairn_virtual_align_params in_mode(const cairn_virtual_align_params *params)
{
    cairn_virtual_align_params p = *params;

    if (p.mode == CAIRN_MODE_AS_WRITTEN) {
        p.field.mode = CAIRN_FORCE_FIELD_GRADIENT;
        p.field.roi = CAIRN_FORCE_FIELD_ROI_NONE;
        p.field.oriented_below = 0;
        p.hypotheses.mode = CAIRN_MODE_AS_WRITTEN;
        p.weak_direction = cairn_weak_direction_default();
        p.rebuild_interval = 1;
        p.max_rounds = 1;
        p.use_aligner = 0;
    }
    return p;
}

cairn_virtual_align_params cairn_virtual_align_as_written(void)
{
    cairn_virtual_align_params params = cairn_virtual_align_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.field = cairn_force_field_as_written();
    params.field.max_steps = MAX_ITERATIONS_AS_WRITTEN;
    params.hypotheses = cairn_virtual_scan_as_written();
    return in_mode(&params);
}

/* Returns the number of bonds: each scan with 32 others, including the virtual one. */
static int32_t bonds_of(int32_t scans)
{
    return scans < 64 ? scans * (scans + 1) / 2 : 32 * scans;
}

/* Returns the field's params: the aligner's capacities; the points of the map are thinned by the
 * stride, rounded up per segment. */
static cairn_force_field_params field_of(const cairn_virtual_align_params *params)
{
    cairn_force_field_params field = params->field;

    field.max_scans = params->aligner.max_scans;
    field.max_segments = params->aligner.max_segments;
    field.max_points = params->aligner.max_points;
    field.max_extra = params->hypotheses.max_virtual;
    field.max_bonds = bonds_of(field.max_scans);
    return field;
}

static cairn_virtual_scan_params hypotheses_of(const cairn_virtual_align_params *params)
{
    cairn_virtual_scan_params hypotheses = params->hypotheses;

    hypotheses.max_scans = params->aligner.max_scans;
    hypotheses.max_segments = params->aligner.max_segments;
    hypotheses.max_points = params->aligner.max_points;
    return hypotheses;
}

static cairn_weak_direction_params weak_params_of(const cairn_virtual_align_params *params)
{
    cairn_weak_direction_params weak = params->weak_direction;

    weak.max_scans = params->aligner.max_scans;
    return weak;
}

cairn_status cairn_virtual_align_check(const cairn_virtual_align_params *params,
                                       cairn_object_fault *fault)
{
    cairn_virtual_align_params used;
    cairn_force_field_params field;
    cairn_virtual_scan_params hypotheses;
    cairn_weak_direction_params weak;
    cairn_status status;

    if (params == NULL)
        return cairn_parameters_check(&cairn_virtual_align_parameters, NULL, fault);
    used = in_mode(params);
    status = cairn_parameters_check(&cairn_virtual_align_parameters, &used, fault);
    if (status == CAIRN_OK)
        status = cairn_aligner_check(&used.aligner, fault);
    if (status != CAIRN_OK)
        return status;
    field = field_of(&used);
    hypotheses = hypotheses_of(&used);
    weak = weak_params_of(&used);
    status = cairn_force_field_check(&field, fault);
    if (status == CAIRN_OK)
        status = cairn_virtual_scan_check(&hypotheses, fault);
    if (status == CAIRN_OK)
        status = cairn_weak_direction_check(&weak, fault);
    return status;
}

/* Drops an alignment that is under way. */
static void stop(cairn_virtual_align *align)
{
    align->resume = align->phase_resume = 0;
    align->is_complete = align->is_stored = 1;
    align->is_field_ahead = align->has_stopped = 0;
    align->units_charged = 0;
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_virtual_align *build(cairn_pool *pool, const cairn_virtual_align_params *params)
{
    cairn_virtual_align_params used = in_mode(params);
    cairn_force_field_params field = field_of(&used);
    cairn_virtual_scan_params hypotheses = hypotheses_of(&used);
    cairn_weak_direction_params weak = weak_params_of(&used);
    cairn_virtual_align *align = cairn_object_take(pool, sizeof *align);

    CAIRN_TAKE(align, pool, places, used.aligner.max_scans);
    CAIRN_TAKE(align, pool, poses, used.aligner.max_scans);
    CAIRN_TAKE(align, pool, stored_poses, used.aligner.max_scans);
    CAIRN_TAKE_OBJECT(align, pool, aligner, aligner, &used.aligner);
    CAIRN_TAKE_OBJECT(align, pool, field, force_field, &field);
    CAIRN_TAKE_OBJECT(align, pool, hypotheses, virtual_scan, &hypotheses);
    CAIRN_TAKE_OBJECT(align, pool, weak_direction, weak_direction, &weak);
    if (align != NULL) {
        align->params = used;
        stop(align);
    }
    return align;
}

CAIRN_OBJECT(virtual_align, virtual_align, build);

cairn_status cairn_virtual_align_add_scan(cairn_virtual_align *align, const cairn_scan_view *view,
                                          cairn_pose map_scan, cairn_fault *fault)
{
    struct virtual_align_place *place;
    cairn_status status;

    if (align == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_aligner_add_scan(align->aligner, view, map_scan, fault);
    if (status != CAIRN_OK)
        return status;
    stop(align);
    cairn_virtual_align_must(cairn_force_field_add_scan(align->field, view, NULL, map_scan, fault));
    place = &align->places[align->scan_count];
    place->start = map_scan;
    place->aligned = cairn_aligner_pose_of(align->aligner, align->scan_count++);
    place->moves = 0;
    return CAIRN_OK;
}

cairn_status
cairn_virtual_align_add_detector(cairn_virtual_align *align,
                                 const cairn_virtual_scan_hypothesis_detector *detector)
{
    return align == NULL ? CAIRN_BAD_ARGUMENT
                         : cairn_virtual_scan_add_detector(align->hypotheses, detector);
}

void cairn_virtual_align_clear(cairn_virtual_align *align)
{
    cairn_aligner_clear(align->aligner);
    cairn_force_field_clear(align->field);
    stop(align);
    align->scan_count = 0;
    align->is_iterating = 0;
    memset(&align->result, 0, sizeof align->result);
}

cairn_status cairn_virtual_align_begin(cairn_virtual_align *align)
{
    if (align == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (align->scan_count == 0)
        return CAIRN_EMPTY;
    memset(&align->result, 0, sizeof align->result);
    for (int32_t i = 0; i < align->scan_count; i++) {
        cairn_virtual_align_must(
            cairn_aligner_set_initial_pose(align->aligner, i, align->places[i].start));
        align->places[i].moves = 0;
    }
    cairn_virtual_align_must(cairn_aligner_begin(align->aligner));
    stop(align);
    align->is_complete = align->is_stored = 0;
    return CAIRN_OK;
}

/* Continues the alignment; stops: until its next result. */
static cairn_status run(cairn_virtual_align *align, cairn_budget *budget, int32_t stops)
{
    if (align == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    align->stops_at_result = stops;
    align->status = CAIRN_OK;
    align->has_stopped = 0;
    if (!align->is_complete)
        align->is_complete = cairn_virtual_align_run(align, budget);
    if (align->is_complete || align->has_stopped)
        return CAIRN_OK;
    return align->status < 0 ? align->status : CAIRN_MORE;
}

cairn_status cairn_virtual_align_step(cairn_virtual_align *align, cairn_budget *budget)
{
    return run(align, budget, 0);
}

cairn_status cairn_virtual_align_iterate(cairn_virtual_align *align, cairn_budget *budget)
{
    return run(align, budget, 1);
}

int32_t cairn_virtual_align_running(const cairn_virtual_align *align)
{
    return !align->is_complete;
}

/* ---- Result ---- */

cairn_virtual_align_result cairn_virtual_align_read(const cairn_virtual_align *align)
{
    return align->result;
}

cairn_virtual_align_pose cairn_virtual_align_pose_of(const cairn_virtual_align *align, int32_t scan)
{
    cairn_virtual_align_pose pose;

    memset(&pose, 0, sizeof pose);
    if (scan < 0 || scan >= align->scan_count)
        return pose;
    pose.aligned = align->is_stored ? align->places[scan].aligned
                                    : cairn_aligner_pose_of(align->aligner, scan);
    pose.moved = align->places[scan].moves;
    if (pose.moved && (align->is_field_ahead || !align->params.use_aligner))
        pose.aligned.map_scan = cairn_force_field_pose(align->field, scan);
    return pose;
}

const cairn_aligner *cairn_virtual_align_aligner(const cairn_virtual_align *align)
{
    return align->aligner;
}

const cairn_force_field *cairn_virtual_align_field(const cairn_virtual_align *align)
{
    return align->field;
}

const cairn_virtual_scan *cairn_virtual_align_hypotheses(const cairn_virtual_align *align)
{
    return align->hypotheses;
}
