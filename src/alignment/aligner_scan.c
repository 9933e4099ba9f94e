/* aligner: pairwise evaluation of scans by their visibility profiles: point counts, log-likelihood
 * ratio, normal equations.
 *
 * Method: a scan's visibility profile has range and segment by bearing.
 * 1. A point of another scan is looked up by its bearing from the scan's sensor, in constant time.
 *    - Same surface: its distance from the segment's line is within a gate, and the directions
 *      agree.
 *    - Free space: the scan measured well beyond it (free-space violation).
 *    - Else it is on another surface, or occluded.
 * 2. Bearings are positions on the diamond |x| + |y| = 1: one division, no arc tangent.
 * 3. The count of one segment saturates: points of one surface are correlated, so the
 *    information of a long wall is little more than that of a short one.
 * 4. Normal equations: points on the same surface are point-to-line pairs with the weights of
 *    registration, whose scale is the gate's. Each pair of scans has sums of its own, which the
 *    relaxation propagates (aligner_cluster.c). */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

static const cairn_real SAME_SURFACE_NATS = CAIRN_REAL(0.5), OTHER_SURFACE_NATS = CAIRN_REAL(0.15);
/* points that may still change the decision */
static const cairn_real LOOKAHEAD_POINTS = 8;
static const cairn_real SATURATION_POINTS = 6, SATURATED_WEIGHT = CAIRN_REAL(0.1);
/* of the directions of one surface */
static const cairn_real MIN_COSINE = CAIRN_REAL(0.85);
/* m */
static const cairn_real END_MARGIN_M = CAIRN_REAL(0.1);
/* m, and share of the range: least free distance behind a point in free space */
static const cairn_real MIN_CLEARANCE_M = CAIRN_REAL(0.12);
/* share of the range */
static const cairn_real MIN_CLEARANCE_RATIO = CAIRN_REAL(0.02);
/* m */
static const cairn_real SURFACE_DEPTH_M = CAIRN_REAL(0.15);
/* sine of the narrowest sector's width, ... */
static const cairn_real SINE_OF_SECTOR = CAIRN_REAL(0.14);
/* ... and of two */
static const cairn_real SINE_OF_TWO = CAIRN_REAL(0.27);
/* gates: scale of the residuals; their weight is a half at half the gate */
static const cairn_real SIGMA_GATES = CAIRN_REAL(0.2096);
/* m: beyond this behind the greatest range no point is on a surface */
static const cairn_real MAX_BEHIND_M = CAIRN_REAL(0.35);

/* ---- Poses as transforms ---- */

int32_t cairn_aligner_is_near(cairn_transform a, cairn_transform b, cairn_real metres,
                              cairn_real cosine)
{
    cairn_real dx = a.x - b.x, dy = a.y - b.y;

    return dx * dx + dy * dy < metres * metres && a.cosine * b.cosine + a.sine * b.sine > cosine;
}

cairn_transform cairn_aligner_moved(cairn_transform pose, cairn_vec2 centre,
                                    const cairn_real motion[3])
{
    cairn_vec2 to = {centre.x + motion[0], centre.y + motion[1]};
    cairn_transform moved;
    cairn_real sine, cosine, norm;

    cairn_sincos(motion[2], &sine, &cosine);
    moved = cairn_transform_compose(cairn_transform_mapping(cosine, sine, centre, to), pose);
    norm = 1 / cairn_sqrt(moved.cosine * moved.cosine + moved.sine * moved.sine);
    moved.cosine *= norm;
    moved.sine *= norm;
    return moved;
}

int32_t cairn_aligner_points_of(const cairn_aligner *aligner, int32_t scan)
{
    return aligner->scans[scan].end_point - aligner->scans[scan].first_point;
}

/* ---- Pairs ---- */

static int is_in_cone(const aligner_scan *scan, cairn_transform map_scan, cairn_real cosine,
                      cairn_real sine, cairn_vec2 middle, cairn_real radius)
{
    cairn_vec2 sensor = cairn_transform_point(map_scan, scan->sensor);
    cairn_vec2 axis = cairn_transform_direction(map_scan, scan->axis),
               to = cairn_vec2_sub(middle, sensor);
    cairn_real along = cairn_vec2_dot(axis, to), across = cairn_abs(cairn_vec2_cross(axis, to));

    /* Distance from the nearer side of the cone. */
    return cosine <= 0 || cosine * across - sine * along < radius;
}

int cairn_aligner_may_see(const aligner_scan *scan, cairn_transform map_scan, cairn_real turned,
                          cairn_vec2 middle, cairn_real radius)
{
    cairn_real cosine, sine;

    if (scan->view_cosine <= 0 || turned >= CAIRN_PI / 2)
        return 1;
    cairn_sincos(turned, &sine, &cosine);
    return is_in_cone(scan, map_scan, scan->view_cosine * cosine - scan->view_sine * sine,
                      scan->view_sine * cosine + scan->view_cosine * sine, middle, radius);
}

static int may_see(const aligner_scan *a, cairn_transform map_a, cairn_vec2 middle,
                   cairn_real radius)
{
    return is_in_cone(a, map_a, a->view_cosine, a->view_sine, middle, radius);
}

int32_t cairn_aligner_may_overlap(const cairn_aligner *aligner, int32_t i, int32_t j,
                                  cairn_transform map_i, cairn_transform map_j)
{
    const aligner_scan *a = &aligner->scans[i], *b = &aligner->scans[j];
    cairn_vec2 p = cairn_transform_point(map_i, a->middle),
               q = cairn_transform_point(map_j, b->middle);
    cairn_real sum = a->radius + b->radius + CAIRN_REAL(0.2);

    if (cairn_vec2_norm_squared(cairn_vec2_sub(p, q)) >= sum * sum)
        return 0;
    return may_see(a, map_i, q, b->radius) || may_see(b, map_j, p, a->radius);
}

/* The surfaces of a scan that points are compared with. */
typedef struct surfaces {
    const aligner_view *view;
    const aligner_segment *segments; /* [scan's segments] */
    int32_t is_oriented;
    cairn_real gate, margin; /* m: of the distance to a line, and beyond its ends */
} surfaces;

static surfaces surfaces_of(const cairn_aligner *aligner, int32_t scan, cairn_real gate)
{
    surfaces of = {&aligner->views[scan], &aligner->segments[aligner->scans[scan].first_segment],
                   aligner->params.oriented, gate, END_MARGIN_M + gate / 2};

    return of;
}

static int have_same_direction(const surfaces *of, cairn_vec2 a, cairn_vec2 b)
{
    cairn_real cosine = cairn_vec2_dot(a, b);

    return (of->is_oriented ? cosine : cairn_abs(cosine)) >= MIN_COSINE;
}

/* Returns the surface near a bin whose line is nearest to p and within the gate; NULL: none. */
static const aligner_segment *surface_at(const surfaces *of, int32_t bin, cairn_vec2 p,
                                         cairn_vec2 direction, cairn_real *error)
{
    const aligner_segment *best = NULL;
    int32_t before = CAIRN_VISIBILITY_NO_SURFACE;

    *error = of->gate;
    for (int32_t k = -1; k <= 1; k++) {
        int32_t id = of->view->surface[(bin + k) & (ALIGNER_VIEW_BINS - 1)];
        const aligner_segment *s;
        cairn_vec2 from;
        cairn_real across, along;

        if (id == CAIRN_VISIBILITY_NO_SURFACE || id == before)
            continue;
        before = id;
        s = &of->segments[id];
        if (!have_same_direction(of, s->direction, direction))
            continue;
        from = cairn_vec2_sub(p, s->a);
        across = cairn_vec2_cross(s->direction, from);
        along = cairn_vec2_dot(s->direction, from);
        if (cairn_abs(across) < cairn_abs(*error) && along > -of->margin &&
            along < s->length + of->margin) {
            *error = across;
            best = s;
        }
    }
    return best;
}

/* Returns how points are compared with a profile: within `gate` of a surface they are on it. */
static cairn_visibility_rule rule_of(cairn_real gate)
{
    cairn_visibility_rule rule = {
        .clearance = MIN_CLEARANCE_M + gate,
        .clearance_of_range = MIN_CLEARANCE_RATIO,
        .depth = SURFACE_DEPTH_M,
        .margin_of_distance = 0,
        .beside = 1,
        .is_closed = 1,
    };

    return rule;
}

/* Counts a point with a direction, in the frame of the scan whose profile is queried; *same: points
 * on the surface of their segment. */
static void count_point(const surfaces *of, cairn_vec2 p, cairn_vec2 direction,
                        const cairn_visibility_rule *rule, int32_t *same, aligner_count *count)
{
    const cairn_visibility *visibility = &of->view->visibility;
    cairn_vec2 ray = cairn_vec2_sub(p, visibility->sensor), normal = {0, 0};
    int32_t bin = cairn_visibility_bin(ray, ALIGNER_VIEW_BINS);
    cairn_visibility_answer answer;
    cairn_real error;

    if (visibility->range[bin] == 0)
        return;
    if (surface_at(of, bin, p, direction, &error) != NULL) {
        (*same)++;
        return;
    }
    if (of->is_oriented)
        normal = cairn_vec2_left_perp(direction);
    answer = cairn_visibility_query_bin(visibility, bin, ray, normal, rule);
    if (answer == CAIRN_VISIBILITY_SURFACE)
        count->other_surface += 1;
    else if (answer == CAIRN_VISIBILITY_FREE)
        count->free_space += 1;
}

/* Returns 1 when a circle, in the frame of the scan, may contain visible points. */
static int may_be_visible(const cairn_aligner *aligner, int32_t scan, cairn_vec2 middle,
                          cairn_real radius)
{
    cairn_vec2 ray = cairn_vec2_sub(middle, aligner->scans[scan].sensor);
    cairn_real squared = cairn_vec2_norm_squared(ray), reach;
    const uint16_t *sectors = aligner->views[scan].sector_max;
    int32_t sector = cairn_visibility_bin(ray, ALIGNER_VIEW_SECTORS);
    uint16_t farthest = sectors[sector];

    if (radius * radius > SINE_OF_SECTOR * SINE_OF_SECTOR * squared) {
        uint16_t before = sectors[(sector - 1) & (ALIGNER_VIEW_SECTORS - 1)];
        uint16_t after = sectors[(sector + 1) & (ALIGNER_VIEW_SECTORS - 1)];

        if (radius * radius > SINE_OF_TWO * SINE_OF_TWO * squared)
            return 1;
        farthest = farthest > before ? farthest : before;
        farthest = farthest > after ? farthest : after;
    }
    reach = (cairn_real)farthest * aligner->views[scan].visibility.step + radius + MAX_BEHIND_M;
    return farthest > 0 && squared < reach * reach;
}

static int32_t visible_patches_of(const cairn_aligner *aligner, int32_t from, int32_t to,
                                  cairn_transform to_from)
{
    int32_t first = aligner->scans[from].first_patch, shown = 0;
    int32_t end = first + (cairn_aligner_points_of(aligner, from) + ALIGNER_PATCH_POINTS - 1) /
                              ALIGNER_PATCH_POINTS;

    for (int32_t k = first; k < end; k++)
        shown +=
            may_be_visible(aligner, to, cairn_transform_point(to_from, aligner->patches[k].middle),
                           aligner->patches[k].radius);
    return shown;
}

int32_t cairn_aligner_visible_patches(const cairn_aligner *aligner, int32_t i, int32_t j,
                                      cairn_transform i_j)
{
    return visible_patches_of(aligner, j, i, i_j) +
           visible_patches_of(aligner, i, j, cairn_transform_inverse(i_j));
}

static cairn_real saturated(int32_t points)
{
    cairn_real n = (cairn_real)points;

    return n <= SATURATION_POINTS ? n
                                  : SATURATION_POINTS + SATURATED_WEIGHT * (n - SATURATION_POINTS);
}

/* Returns 1 when the log-likelihood ratio stays at `least` or below even if the next points are all
 * inliers. */
static int is_pruned(const cairn_aligner *aligner, aligner_count count, int32_t left,
                     cairn_real least)
{
    count.same_surface += cairn_min((cairn_real)left, LOOKAHEAD_POINTS);
    return cairn_aligner_log_likelihood_ratio(aligner, count) <= least;
}

cairn_real cairn_aligner_log_likelihood_ratio(const cairn_aligner *aligner, aligner_count count)
{
    return SAME_SURFACE_NATS * count.same_surface - OTHER_SURFACE_NATS * count.other_surface -
           aligner->params.free_space_penalty * count.free_space;
}

/* Adds the normal equations of a point of `from` against its surface of `to`, if any. */
static void add_point(const cairn_aligner *aligner, const aligner_walk *walk, const surfaces *of,
                      const aligner_point *point)
{
    cairn_vec2 p = cairn_transform_point(walk->to_from, point->position), normal;
    cairn_vec2 ray = cairn_vec2_sub(p, aligner->scans[walk->to].sensor);
    cairn_vec2 direction =
        cairn_transform_direction(walk->to_from, aligner->segments[point->segment].direction);
    cairn_real error, row[3];
    const aligner_segment *surface =
        surface_at(of, cairn_visibility_bin(ray, ALIGNER_VIEW_BINS), p, direction, &error);

    if (surface == NULL)
        return;
    normal = cairn_transform_direction(walk->map_to, cairn_vec2_left_perp(surface->direction));
    cairn_rigid_motion_jacobian(&walk->motion, normal, cairn_transform_point(walk->map_to, p), row);
    cairn_rigid_motion_add_residual(
        &walk->sums->equations, row, walk->sign * error,
        cairn_registration_weight(error * error, SIGMA_GATES * walk->gate));
    walk->sums->pairs++;
}

/* Adds the points of a segment that are on the same surface. */
static void add_same(const aligner_walk *walk, int32_t same, aligner_count *count)
{
    cairn_real points = saturated(same), sine = cairn_vec2_cross(walk->to_axis, walk->direction);

    count->same_surface += points;
    count->across += points * sine * sine;
}

/* Counts the points [at, end). */
static void count_points(const cairn_aligner *aligner, aligner_walk *walk, const surfaces *of)
{
    const cairn_visibility_rule rule = rule_of(walk->gate);
    const cairn_transform to_from = walk->to_from;
    aligner_count count = *walk->count;
    int32_t same = walk->same;

    for (int32_t i = walk->at; i < walk->end; i++) {
        const aligner_point *point = &aligner->points[i];

        if (point->segment != walk->segment) {
            add_same(walk, same, &count);
            same = 0;
            walk->segment = point->segment;
            walk->direction =
                cairn_transform_direction(to_from, aligner->segments[walk->segment].direction);
        }
        count_point(of, cairn_transform_point(to_from, point->position), walk->direction, &rule,
                    &same, &count);
    }
    *walk->count = count;
    walk->same = same;
}

/* Adds the points [at, end) to the count or to the normal equations. */
CAIRN_STEP_NOT_INLINED static void add_patch(const cairn_aligner *aligner, aligner_walk *walk)
{
    const surfaces of = surfaces_of(aligner, walk->to, walk->gate);

    if (walk->sums == NULL)
        count_points(aligner, walk, &of);
    else
        for (int32_t i = walk->at; i < walk->end; i++)
            add_point(aligner, walk, &of, &aligner->points[i]);
    walk->is_added = 1;
}

/* Starts the walk over the points of `from`. */
static void begin_points(const cairn_aligner *aligner, aligner_walk *walk)
{
    const aligner_scan *scan = &aligner->scans[walk->from];

    walk->to_from = cairn_transform_between(walk->map_to, walk->map_from);
    walk->patch = scan->first_patch;
    walk->at = walk->end = scan->first_point;
    walk->last = scan->end_point;
    walk->segment = -1;
    walk->same = 0;
    walk->is_added = 1;
    walk->to_axis = cairn_transform_inverse_direction(walk->map_to, walk->axis);
}

void cairn_aligner_begin_equations(const cairn_aligner *aligner, aligner_walk *walk, int32_t from,
                                   int32_t to, cairn_transform map_from, cairn_transform map_to,
                                   cairn_real gate, cairn_vec2 centre, aligner_sums *sums)
{
    memset(walk, 0, sizeof *walk);
    walk->from = from;
    walk->to = to;
    walk->map_from = map_from;
    walk->map_to = map_to;
    walk->gate = gate;
    if (sums != NULL)
        walk->motion = cairn_rigid_motion_at(cairn_pose_identity(), centre, 1);
    walk->sign = 1;
    walk->sums = sums;
    begin_points(aligner, walk);
}

void cairn_aligner_begin_count(const cairn_aligner *aligner, aligner_walk *walk, int32_t from,
                               int32_t to, cairn_transform to_from, cairn_real gate,
                               aligner_count *count)
{
    static const cairn_transform same = {0, 0, 1, 0};
    static const cairn_vec2 centre = {0, 0};

    cairn_aligner_begin_equations(aligner, walk, from, to, to_from, same, gate, centre, NULL);
    walk->least = -CAIRN_REAL_MAX;
    walk->count = count;
}

void cairn_aligner_split_count(aligner_walk *walk, cairn_vec2 axis)
{
    walk->axis = walk->to_axis = axis;
}

void cairn_aligner_turn_walk(const cairn_aligner *aligner, aligner_walk *walk)
{
    int32_t from = walk->from;
    cairn_transform map_from = walk->map_from;

    walk->from = walk->to;
    walk->to = from;
    walk->map_from = walk->map_to;
    walk->map_to = map_from;
    walk->sign = -walk->sign;
    begin_points(aligner, walk);
}

/* Returns 1 when patches are left that may change the decision, which those added last may have
 * made. */
static int has_patches(const cairn_aligner *aligner, const aligner_walk *walk)
{
    return walk->end < walk->last &&
           (walk->sums != NULL || !walk->is_added ||
            !is_pruned(aligner, *walk->count, walk->same + walk->last - walk->end, walk->least));
}

/* Advances to the next patch; returns 1 when it may be visible. */
static int next_patch(const cairn_aligner *aligner, aligner_walk *walk)
{
    const aligner_patch *patch = &aligner->patches[walk->patch++];

    walk->at = walk->end;
    walk->end =
        walk->at + ALIGNER_PATCH_POINTS < walk->last ? walk->at + ALIGNER_PATCH_POINTS : walk->last;
    walk->is_added = 0;
    return may_be_visible(aligner, walk->to, cairn_transform_point(walk->to_from, patch->middle),
                          patch->radius);
}

/* Charges lookups, in whole units: 1 when they may be done. */
static int charge_lookups(aligner_walk *walk, cairn_budget *budget, int32_t lookups)
{
    int32_t units =
        (lookups - walk->lookups_charged + ALIGNER_POINTS_PER_UNIT - 1) / ALIGNER_POINTS_PER_UNIT;

    if (lookups > walk->lookups_charged) {
        if (!cairn_budget_charge(budget, &walk->units_charged, units))
            return 0;
        walk->lookups_charged += units * ALIGNER_POINTS_PER_UNIT;
    }
    walk->lookups_charged -= lookups;
    walk->lookups += lookups;
    return 1;
}

int cairn_aligner_walk_points(const cairn_aligner *aligner, aligner_walk *walk,
                              cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(walk->resume);
    while (has_patches(aligner, walk)) {
        CAIRN_STEP_UNTIL(walk->resume, charge_lookups(walk, budget, (walk->patch + 1) & 1));
        if (!next_patch(aligner, walk))
            continue;
        CAIRN_STEP_UNTIL(walk->resume, charge_lookups(walk, budget, walk->end - walk->at));
        add_patch(aligner, walk);
    }
    if (walk->sums == NULL)
        add_same(walk, walk->same, walk->count);
    CAIRN_STEP_END(walk->resume);
}

int cairn_aligner_walk_pair(const cairn_aligner *aligner, aligner_walk *walk, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(walk->pair_resume);
    CAIRN_STEP_UNTIL(walk->pair_resume, cairn_aligner_walk_points(aligner, walk, budget));
    cairn_aligner_turn_walk(aligner, walk);
    CAIRN_STEP_UNTIL(walk->pair_resume, cairn_aligner_walk_points(aligner, walk, budget));
    CAIRN_STEP_END(walk->pair_resume);
}

int32_t cairn_aligner_solve(const aligner_sums *sums, cairn_real motion[3])
{
    static const cairn_rigid_motion_basis axes = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 0, 0};
    /* a prior at the current pose */
    static const cairn_rigid_motion_equations damping = {
        {CAIRN_REAL(0.5), 0, 0, CAIRN_REAL(0.5), 0, CAIRN_REAL(0.5)}, {0, 0, 0}};

    return sums->pairs >= 3 &&
           cairn_rigid_motion_solve(&axes, &sums->equations, &damping, CAIRN_REAL_MAX, motion);
}

void cairn_aligner_eigen(cairn_sym3 information, cairn_real values[3], cairn_real vectors[3][3])
{
    information.xz /= ALIGNER_ARM_M;
    information.yz /= ALIGNER_ARM_M;
    information.zz /= ALIGNER_ARM_M * ALIGNER_ARM_M;
    cairn_sym3_eigen(information, values, vectors);
}
