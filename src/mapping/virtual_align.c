/* The aligner, then a force field of what it left over, with a virtual scan.
 *
 * Method: when the aligner has ended, the poses of all scans go to the field, those that it has placed fixed; so are those that
 * may slide, and those that hypotheses could not help, since all that they show lies in one direction along which anything
 * may slide. Then the hypotheses are made, from the scans that stay: those that move would make what holds them where
 * they are. Where all move they are made from all, anew every few iterations. They go to the field as points from outside. Where
 * the field leaves them the aligner looks for what it had not placed; when it had placed next to nothing it starts anew. When
 * it then places more scans than before, these enter the result, by the motion that brings the scans placed before to where
 * they were, and those stay there; else its former result stands, and only what shares no surface with its largest part stays
 * where the field has left it. Last, loose parts of the largest part slide.
 *
 * Layout: the aligner, the field, the hypotheses and the slide in one pool; a scan has the same index in the aligner and in the field.
 * The best result of the aligner is kept beside it.
 *
 * Limits: what the field has moved has no covariance but that of its initial pose, and what slid that which it had before.
 *
 * Source: Adluru 2008, chapter 8. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "cairn/virtual_align.h"

typedef int32_t align_phase;
enum {
    IDLE,
    ALIGN,
    KEEP,
    PLACE,
    BEGIN_SLIDE,
    SLIDE,
    TAKE_SLID,
    GATHER,
    DETECT,
    ITERATE,
    HAND_BACK,
    ALIGN_AGAIN,
    JUDGE
};

/* How a scan comes in, where the aligner has placed it, and whether the field moves it. */
struct place {
    cairn_pose start;
    cairn_aligner_pose aligned;
    int32_t moves;
};

/* Scans in the aligner's largest part from which on others are looked for in it. */
enum { LEAST_PART = 3 };

/* m of wall across the main direction: with less, hypotheses cannot hold a scan. */
static const cairn_real LEAST_ACROSS = CAIRN_REAL(0.1);

struct cairn_virtual_align {
    cairn_virtual_align_params params;
    cairn_aligner *aligner;
    cairn_force_field *field;
    cairn_virtual_scan *hypotheses;
    cairn_wall_slide *slide;
    struct place *places; /* [max_scans] */
    cairn_pose *poses;    /* [max_scans] that the aligner starts again from, or has come to, ... */
    cairn_pose *kept;     /* [max_scans] ... and those that they stand for */
    align_phase phase;
    int32_t cursor; /* scan */
    int32_t since;  /* iterations of the field since the last virtual scan */
    int32_t scan_count;
    int32_t is_under_way; /* an iteration of the field */
    int32_t is_done;      /* the last round has not made the result better */
    cairn_real spread;    /* m, of the poses that scans come in with */
    cairn_virtual_align_result result;
    int32_t paid;
};

cairn_virtual_align_params cairn_virtual_align_default(void)
{
    cairn_virtual_align_params params = {
        .aligner = cairn_aligner_default(),
        .field = cairn_force_field_springs(CAIRN_REAL(0.9), 15),
        .hypotheses = cairn_virtual_scan_default(),
        .slide = cairn_wall_slide_default(),
        .every = 8,
        .max_rounds = 2,
        .align = 1,
    };

    params.field.sides_below = params.field.sigma_start;
    params.field.potential = 0;
    params.hypotheses.spacing = CAIRN_REAL(0.30);
    params.hypotheses.weight = 3;
    return params;
}

/* Of each with 32 others, the virtual one among them. */
static int32_t bonds_of(int32_t scans)
{
    return scans < 64 ? scans * (scans + 1) / 2 : 32 * scans;
}

/* Capacities are the aligner's; points of the map are thinned by the stride, a segment rounding up. */
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

static cairn_wall_slide_params slide_of(const cairn_virtual_align_params *params)
{
    cairn_wall_slide_params slide = params->slide;

    slide.max_scans = params->aligner.max_scans;
    return slide;
}

static void must_be_ok(cairn_status status)
{
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

static cairn_virtual_align *carve(cairn_pool *pool, const cairn_virtual_align_params *params)
{
    cairn_force_field_params field = field_of(params);
    cairn_virtual_scan_params hypotheses = hypotheses_of(params);
    cairn_wall_slide_params slide = slide_of(params);
    cairn_virtual_align *align = cairn_pool_take_one(pool, sizeof *align);
    struct place *places = cairn_pool_take(pool, (size_t)params->aligner.max_scans, sizeof *places);
    cairn_pose *poses = cairn_pool_take(pool, (size_t)params->aligner.max_scans, sizeof *poses);
    cairn_pose *kept = cairn_pool_take(pool, (size_t)params->aligner.max_scans, sizeof *kept);

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_aligner_memory(&params->aligner));
        cairn_pool_count(pool, cairn_force_field_memory(&field));
        cairn_pool_count(pool, cairn_virtual_scan_memory(&hypotheses));
        cairn_pool_count(pool, cairn_wall_slide_memory(&slide));
        return NULL;
    }
    memset(align, 0, sizeof *align);
    align->places = places;
    align->poses = poses;
    align->kept = kept;
    must_be_ok(cairn_aligner_create(&align->aligner, pool, &params->aligner));
    must_be_ok(cairn_force_field_create(&align->field, pool, &field));
    must_be_ok(cairn_virtual_scan_create(&align->hypotheses, pool, &hypotheses));
    must_be_ok(cairn_wall_slide_create(&align->slide, pool, &slide));
    return align;
}

size_t cairn_virtual_align_memory(const cairn_virtual_align_params *params)
{
    cairn_pool counting;

    if (params == NULL || params->every < 1 || params->max_rounds < 1 || cairn_aligner_memory(&params->aligner) == 0)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_virtual_align_create(cairn_virtual_align **align, cairn_pool *pool,
                                        const cairn_virtual_align_params *params)
{
    size_t need = cairn_virtual_align_memory(params);
    cairn_virtual_align *made;

    if (align == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    *align = made;
    return CAIRN_OK;
}

cairn_status cairn_virtual_align_add_scan(cairn_virtual_align *align, const cairn_scan_view *view, cairn_pose map_scan,
                                          cairn_fault *fault)
{
    struct place *place;
    cairn_status status;

    if (align == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_aligner_add_scan(align->aligner, view, map_scan, fault);
    if (status != CAIRN_OK)
        return status;
    align->phase = IDLE;
    must_be_ok(cairn_force_field_add_scan(align->field, view, NULL, map_scan, fault));
    place = &align->places[align->scan_count];
    place->start = map_scan;
    place->aligned = cairn_aligner_pose_of(align->aligner, align->scan_count++);
    place->moves = 0;
    return CAIRN_OK;
}

cairn_status cairn_virtual_align_add_detector(cairn_virtual_align *align, const cairn_hypothesis_detector *detector)
{
    return align == NULL ? CAIRN_BAD_ARGUMENT : cairn_virtual_scan_add_detector(align->hypotheses, detector);
}

void cairn_virtual_align_clear(cairn_virtual_align *align)
{
    cairn_aligner_clear(align->aligner);
    cairn_force_field_clear(align->field);
    align->phase = IDLE;
    align->scan_count = 0;
    align->is_under_way = 0;
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
        must_be_ok(cairn_aligner_start_at(align->aligner, i, align->places[i].start));
        align->places[i].moves = 0;
    }
    must_be_ok(cairn_aligner_begin(align->aligner));
    align->phase = align->params.align ? ALIGN : KEEP;
    align->is_done = 0;
    align->cursor = 0;
    align->paid = 0;
    return CAIRN_OK;
}

/* ---- The steps ---- */

/* Whether the aligner has found any two scans that belong together. */
static int has_ground(const cairn_virtual_align *align)
{
    return align->params.align && align->result.aligner.placed >= 2;
}

/* The first alignment: it alone tells how far off the scans came in. */
static cairn_status step_align(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status = cairn_aligner_step(align->aligner, budget);

    if (status == CAIRN_OK)
        align->spread = cairn_min(cairn_aligner_read(align->aligner).spread, CAIRN_REAL(1e6));
    return status;
}

/* Keeps what the aligner has found. */
static cairn_status step_keep(cairn_virtual_align *align, cairn_budget *budget)
{
    for (; align->cursor < align->scan_count; align->cursor++) {
        if (!cairn_budget_pay(budget, &align->paid, 2))
            return CAIRN_MORE;
        align->places[align->cursor].aligned = cairn_aligner_pose_of(align->aligner, align->cursor);
    }
    align->result.aligner = cairn_aligner_read(align->aligner);
    return CAIRN_OK;
}

/* 1 when the aligner has gone on from what it had found, 0 when it has started anew. */
static int goes_on(const cairn_virtual_align *align)
{
    return has_ground(align) && align->result.aligner.largest >= LEAST_PART;
}

/* The motion from the map of the aligner's new result to that of the former one, by the scans that were placed before. */
static cairn_pose former_map(cairn_virtual_align *align)
{
    int32_t count = 0;

    for (int32_t i = 0; i < align->scan_count; i++) {
        const cairn_aligner_pose *old = &align->places[i].aligned;

        if (!old->placed)
            continue;
        align->poses[count] = cairn_aligner_pose_of(align->aligner, i).map_scan;
        align->kept[count++] = old->map_scan;
    }
    return cairn_pose_fit(align->poses, align->kept, NULL, count, 1);
}

/* What the aligner has placed beside what it had placed before, which stays where it is. */
static cairn_status step_take_in(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_pose former;

    if (!cairn_budget_pay(budget, &align->paid, 1 + align->scan_count))
        return CAIRN_MORE;
    former = former_map(align);
    for (int32_t i = 0; i < align->scan_count; i++) {
        cairn_aligner_pose found = cairn_aligner_pose_of(align->aligner, i);

        if (align->places[i].aligned.placed)
            continue;
        found.map_scan = cairn_pose_compose(former, found.map_scan);
        align->places[i].aligned = found;
    }
    align->result.aligner = cairn_aligner_read(align->aligner);
    return CAIRN_OK;
}

/* The result of the alignment from where the field has left the scans, if it is better. */
static cairn_status step_judge(cairn_virtual_align *align, cairn_budget *budget)
{
    if (cairn_aligner_read(align->aligner).placed > align->result.aligner.placed)
        return goes_on(align) ? step_take_in(align, budget) : step_keep(align, budget);
    if (!cairn_budget_pay(budget, &align->paid, 1 + align->scan_count / 2))
        return CAIRN_MORE;
    align->is_done = 1;
    for (int32_t i = 0; i < align->scan_count; i++) {
        struct place *place = &align->places[i];

        place->moves = place->moves && (!has_ground(align) || place->aligned.part != 0);
        if (place->moves)
            place->aligned.map_scan = cairn_force_field_pose(align->field, i);
    }
    return CAIRN_OK;
}

static int32_t segments_of(const cairn_virtual_align *align, int32_t scan)
{
    const cairn_scan_set_scan *of = &cairn_force_field_scans(align->field)->scans[scan];

    return of->end_segment - of->first_segment;
}

/* m of wall that a scan shows across the direction of most of what it shows. */
static cairn_real across_of(const cairn_virtual_align *align, int32_t scan)
{
    const cairn_scan_set *set = cairn_force_field_scans(align->field);
    cairn_sym2 walls = {0, 0, 0};
    cairn_real values[2];
    cairn_vec2 minor, major;

    for (int32_t i = set->scans[scan].first_segment; i < set->scans[scan].end_segment; i++) {
        cairn_segment s = set->segments[i].segment;
        cairn_vec2 d = set->segments[i].direction;
        cairn_real length = cairn_vec2_norm(cairn_vec2_sub(s.b, s.a));

        walls.xx += length * d.x * d.x;
        walls.xy += length * d.x * d.y;
        walls.yy += length * d.y * d.y;
    }
    cairn_sym2_eigen(walls, values, &minor, &major);
    return values[0];
}

/* All scans to where the aligner has put them. An iteration that an earlier alignment left is ended first. */
static cairn_status step_place(cairn_virtual_align *align, cairn_budget *budget)
{
    struct place *place;

    if (align->is_under_way) {
        if (cairn_force_field_iterate(align->field, budget) == CAIRN_MORE)
            return CAIRN_MORE;
        align->is_under_way = 0;
    }
    if (align->cursor == 0)
        align->result.moved = 0;
    for (; align->cursor < align->scan_count; align->cursor++) {
        if (!cairn_budget_pay(budget, &align->paid, 2 + segments_of(align, align->cursor) / 4))
            return CAIRN_MORE;
        place = &align->places[align->cursor];
        place->moves = !has_ground(align) ||
                       (!place->aligned.placed && !cairn_wall_slide_is_loose(align->slide, &place->aligned) &&
                        across_of(align, align->cursor) >= LEAST_ACROSS);
        align->result.moved += place->moves;
        must_be_ok(cairn_force_field_place(align->field, align->cursor, place->aligned.map_scan));
        must_be_ok(cairn_force_field_fix(align->field, align->cursor, !place->moves));
    }
    cairn_force_field_restart(align->field);
    align->since = 0;
    align->result.rounds += align->result.moved > 0;
    return CAIRN_OK;
}

static cairn_status step_gather(cairn_virtual_align *align, cairn_budget *budget)
{
    const cairn_scan_set *set = cairn_force_field_scans(align->field);
    cairn_real sigma = cairn_force_field_read(align->field).sigma;

    if (align->cursor == 0)
        must_be_ok(
            cairn_virtual_scan_begin(align->hypotheses, align->since > 0 ? sigma : align->params.field.sigma_start));
    for (; align->cursor < align->scan_count; align->cursor++) {
        const cairn_scan_set_scan *scan = &set->scans[align->cursor];

        if (!cairn_budget_pay(budget, &align->paid, 1 + (scan->end_point - scan->first_point) / 4))
            return CAIRN_MORE;
        if (!has_ground(align) || !align->places[align->cursor].moves)
            must_be_ok(cairn_virtual_scan_add_scan(align->hypotheses, set, align->cursor,
                                                   cairn_force_field_pose(align->field, align->cursor)));
    }
    return CAIRN_OK;
}

static cairn_status step_detect(cairn_virtual_align *align, cairn_budget *budget)
{
    const cairn_oriented_point *points;
    const cairn_real *weights;
    int32_t count;

    if (cairn_virtual_scan_step(align->hypotheses, budget) == CAIRN_MORE)
        return CAIRN_MORE;
    points = cairn_virtual_scan_points(align->hypotheses, &weights, &count);
    if (!cairn_budget_pay(budget, &align->paid, 1 + count / 8))
        return CAIRN_MORE;
    must_be_ok(cairn_force_field_set_extra(align->field, points, weights, count));
    (void)cairn_virtual_scan_hypotheses(align->hypotheses, &align->result.hypotheses);
    return CAIRN_OK;
}

static cairn_status step_iteration(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status = cairn_force_field_iterate(align->field, budget);

    align->is_under_way = status == CAIRN_MORE;
    if (status != CAIRN_OK)
        return status;
    align->since++;
    align->result.iterations++;
    align->result.active += align->result.hypotheses > 0 && align->params.hypotheses.weight > 0;
    return CAIRN_OK;
}

/* The aligner's initial poses are those that the field has found. */
static cairn_status step_hand_back(cairn_virtual_align *align, cairn_budget *budget)
{
    cairn_status status;

    if (!cairn_budget_pay(budget, &align->paid, 1 + align->scan_count))
        return CAIRN_MORE;
    for (int32_t i = 0; i < align->scan_count; i++)
        align->poses[i] = cairn_force_field_pose(align->field, i);
    if (goes_on(align)) {
        status = cairn_aligner_begin_again(align->aligner, align->poses);
    } else {
        for (int32_t i = 0; i < align->scan_count; i++)
            must_be_ok(cairn_aligner_start_at(align->aligner, i, align->poses[i]));
        status = cairn_aligner_begin(align->aligner);
    }
    CAIRN_ASSERT(status == CAIRN_OK);
    return status;
}

/* ---- Parts that slide ---- */

static cairn_status step_begin_slide(cairn_virtual_align *align, cairn_budget *budget)
{
    if (align->cursor == 0)
        must_be_ok(
            cairn_wall_slide_begin(align->slide, align->aligner, cairn_force_field_scans(align->field), align->spread));
    for (; align->cursor < align->scan_count; align->cursor++) {
        const struct place *place = &align->places[align->cursor];

        if (!cairn_budget_pay(budget, &align->paid, 2))
            return CAIRN_MORE;
        must_be_ok(cairn_wall_slide_add(align->slide, place->start, &place->aligned));
    }
    return CAIRN_OK;
}

static cairn_status step_take_slid(cairn_virtual_align *align, cairn_budget *budget)
{
    if (!cairn_budget_pay(budget, &align->paid, 1 + align->scan_count / 8))
        return CAIRN_MORE;
    align->result.slide = cairn_wall_slide_read(align->slide);
    for (int32_t i = 0; i < align->scan_count; i++) {
        struct place *place = &align->places[i];
        cairn_vec2 shift = cairn_wall_slide_shift_of(align->slide, i);

        if (shift.x == 0 && shift.y == 0)
            continue;
        place->aligned.map_scan.x += shift.x;
        place->aligned.map_scan.y += shift.y;
        place->moves = 1;
    }
    return CAIRN_OK;
}

static cairn_status step_phase(cairn_virtual_align *align, cairn_budget *budget)
{
    switch (align->phase) {
    case HAND_BACK:
        return step_hand_back(align, budget);
    case ALIGN:
        return step_align(align, budget);
    case ALIGN_AGAIN:
        return cairn_aligner_step(align->aligner, budget);
    case KEEP:
        return step_keep(align, budget);
    case JUDGE:
        return step_judge(align, budget);
    case PLACE:
        return step_place(align, budget);
    case BEGIN_SLIDE:
        return step_begin_slide(align, budget);
    case SLIDE:
        return cairn_wall_slide_step(align->slide, budget);
    case TAKE_SLID:
        return step_take_slid(align, budget);
    case GATHER:
        return step_gather(align, budget);
    case DETECT:
        return step_detect(align, budget);
    default:
        return step_iteration(align, budget);
    }
}

/* What the field could not place, the slide may. */
static align_phase last_phase(const cairn_virtual_align *align)
{
    return has_ground(align) ? BEGIN_SLIDE : IDLE;
}

static align_phase next_phase(const cairn_virtual_align *align)
{
    switch (align->phase) {
    case ALIGN:
        return KEEP;
    case KEEP:
        return PLACE;
    case PLACE:
        return align->result.moved > 0 ? GATHER : last_phase(align);
    case BEGIN_SLIDE:
        return SLIDE;
    case SLIDE:
        return TAKE_SLID;
    case TAKE_SLID:
        return IDLE;
    case GATHER:
        return DETECT;
    case DETECT:
        return ITERATE;
    case HAND_BACK:
        return ALIGN_AGAIN;
    case ALIGN_AGAIN:
        return JUDGE;
    case JUDGE:
        return !align->is_done && align->result.rounds < align->params.max_rounds ? PLACE : last_phase(align);
    default:
        if (cairn_force_field_read(align->field).verdict != CAIRN_FORCE_FIELD_RUNNING)
            return align->params.align ? HAND_BACK : IDLE;
        return !has_ground(align) && align->since % align->params.every == 0 ? GATHER : ITERATE;
    }
}

static int64_t *units_of(cairn_virtual_align *align)
{
    if (align->phase == ALIGN || align->phase == ALIGN_AGAIN)
        return &align->result.align_units;
    if (align->phase == GATHER || align->phase == DETECT || align->phase == BEGIN_SLIDE || align->phase == SLIDE ||
        align->phase == TAKE_SLID)
        return &align->result.hypothesis_units;
    return &align->result.field_units;
}

/* To the end of a phase. */
static cairn_status step_on(cairn_virtual_align *align, cairn_budget *budget)
{
    int32_t left = budget->left;
    int64_t *units = units_of(align);
    cairn_status status = step_phase(align, budget);

    *units += left - budget->left;
    if (status != CAIRN_OK)
        return status;
    align->phase = next_phase(align);
    align->cursor = 0;
    align->paid = 0;
    return CAIRN_OK;
}

cairn_status cairn_virtual_align_step(cairn_virtual_align *align, cairn_budget *budget)
{
    if (align == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (align->phase != IDLE) {
        cairn_status status = step_on(align, budget);

        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

cairn_status cairn_virtual_align_iterate(cairn_virtual_align *align, cairn_budget *budget)
{
    if (align == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (align->phase != IDLE) {
        align_phase done = align->phase;
        cairn_status status = step_on(align, budget);

        if (status != CAIRN_OK)
            return status;
        if ((done == KEEP && align->params.align) || done == ITERATE)
            return CAIRN_OK;
    }
    return CAIRN_OK;
}

int32_t cairn_virtual_align_running(const cairn_virtual_align *align)
{
    return align->phase != IDLE;
}

/* ---- The result ---- */

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
    pose.aligned = align->phase == ALIGN || align->phase == KEEP ? cairn_aligner_pose_of(align->aligner, scan)
                                                                 : align->places[scan].aligned;
    pose.moved = align->places[scan].moves;
    if (pose.moved && (align->phase >= GATHER || !align->params.align))
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
