/* aligner: translation of scans along their weakly observable direction.
 *
 * Method: a scan of one long wall is unobservable along it, up to the extent of the shared
 * surfaces. Its other surfaces, which no other scan shows there, mostly lie on the straight
 * continuation of a wall of the map.
 * 1. Find the weakly observable direction of each scan from its information matrix.
 * 2. Candidates: translations that bring a surface onto a wall, to the initial pose, and zero.
 * 3. Score: free-space violations, prior, and a gain for surfaces that continue a wall. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

/* m: standard deviation from which a direction is weakly observable */
static const cairn_real WEAK_SIGMA_M = CAIRN_REAL(0.03);
/* least sine between the weak direction and a wall */
static const cairn_real MIN_CROSS_SINE = CAIRN_REAL(0.5);
/* m */
static const cairn_real SAME_TRANSLATION_M = CAIRN_REAL(0.03), LINE_DISTANCE_M = CAIRN_REAL(0.05),
                        MAX_GAP_M = 6;
static const cairn_real CONTINUATION_NATS = 3, FULL_WEIGHT_LENGTH_M = CAIRN_REAL(0.3);

enum { WALLS_PER_UNIT = 16, SCANS_PER_UNIT = 4 };

/* Finds the unit direction of the translation that is weakly observable; returns 0 without one. */
static int find_weak_direction(const cairn_aligner *aligner, int32_t i, cairn_vec2 *along)
{
    cairn_real values[3], vectors[3][3];

    cairn_aligner_eigen(cairn_aligner_own_information(aligner, i), values, vectors);
    if (values[0] * WEAK_SIGMA_M * WEAK_SIGMA_M > 1 || values[1] * WEAK_SIGMA_M * WEAK_SIGMA_M <= 1)
        return 0;
    along->x = vectors[0][0];
    along->y = vectors[0][1];
    if (cairn_vec2_norm(*along) < CAIRN_REAL(0.9))
        return 0;
    *along = cairn_vec2_unit(*along);
    return 1;
}

/* A segment in the map, at a pose of its scan. */
typedef struct placed {
    const aligner_segment *segment;
    cairn_vec2 direction, mean;
} placed;

static placed place_at(const aligner_segment *segment, cairn_transform pose)
{
    placed p = {segment, cairn_transform_direction(pose, segment->direction),
                cairn_transform_point(pose, segment->mean)};

    return p;
}

/* Computes the translation that brings a segment onto the line of a wall; returns 0 without one. */
static int shift_to(const placed *p, cairn_vec2 along, const aligner_wall *wall, cairn_real *shift)
{
    cairn_real across = cairn_vec2_dot(wall->normal, along), place, half;
    cairn_vec2 way = cairn_aligner_along(wall);

    if (cairn_abs(across) < MIN_CROSS_SINE ||
        (wall->scan_count == 1 && wall->first_scan == p->segment->scan) ||
        !cairn_aligner_same_line(wall, p->segment, p->direction))
        return 0;
    *shift = (wall->offset - cairn_vec2_dot(wall->normal, p->mean)) / across;
    place = cairn_vec2_dot(way, p->mean) + *shift * cairn_vec2_dot(way, along);
    half = p->segment->length / 2 + MAX_GAP_M;
    return place > wall->low - half && place < wall->high + half;
}

static void insert_translation(cairn_aligner *aligner, cairn_real shift)
{
    cairn_pose *pose;

    for (int32_t k = 0; k < aligner->move.peak_count; k++)
        if (cairn_abs(aligner->move.peaks[k].score - shift) < SAME_TRANSLATION_M)
            return;
    if (aligner->move.peak_count == ALIGNER_MAX_TRANSLATIONS)
        return;
    pose = &aligner->move.peaks[aligner->move.peak_count].pose;
    *pose = cairn_pose_of(aligner->move.previous_pose);
    pose->x += shift * aligner->move.weak_direction.x;
    pose->y += shift * aligner->move.weak_direction.y;
    aligner->move.peaks[aligner->move.peak_count++].score = shift;
}

/* Starts the candidates: zero, and the initial pose. */
static void begin_translations(cairn_aligner *aligner)
{
    const aligner_scan *scan = &aligner->scans[aligner->cursor.scan];
    cairn_transform gauge =
        cairn_transform_inverse(cairn_aligner_gauge(aligner, aligner->move.home));
    cairn_transform expected = cairn_transform_compose(gauge, cairn_transform_of(scan->initial));
    cairn_vec2 off = {expected.x - aligner->move.previous_pose.x,
                      expected.y - aligner->move.previous_pose.y};

    aligner->move.peak_count = aligner->move.peak_index = 0;
    insert_translation(aligner, 0);
    insert_translation(aligner, cairn_vec2_dot(aligner->move.weak_direction, off));
}

/* Adds candidates: where the current surface meets walls. */
static void add_translations(cairn_aligner *aligner)
{
    placed p = place_at(&aligner->segments[aligner->cursor.item], aligner->move.previous_pose);
    cairn_real shift;

    for (int32_t w = 0; w < aligner->wall_count && p.segment->weight > 0; w++)
        if (shift_to(&p, aligner->move.weak_direction, &aligner->walls[w], &shift) &&
            cairn_abs(shift) <= aligner->params.max_initial_error)
            insert_translation(aligner, shift);
}

/* Adds the gain of the current surface on walls, nats. */
static void add_line_nats(cairn_aligner *aligner)
{
    const aligner_segment *s = &aligner->segments[aligner->cursor.item];
    placed p = place_at(s, aligner->evaluation.pose);
    cairn_real least = LINE_DISTANCE_M, shift;

    if (!(s->weight > 0))
        return;
    for (int32_t w = 0; w < aligner->wall_count; w++)
        if (shift_to(&p, aligner->move.weak_direction, &aligner->walls[w], &shift))
            least = cairn_min(least, cairn_abs(shift));
    least /= LINE_DISTANCE_M;
    aligner->move.line_nats +=
        CONTINUATION_NATS *
        (s->is_short ? CAIRN_REAL(0.5) : cairn_min(s->length / FULL_WEIGHT_LENGTH_M, 1)) *
        (1 - least * least);
}

/* Returns 1 when the current scan has a weakly observable direction. */
static int is_weak(cairn_aligner *aligner)
{
    aligner_scan *scan = &aligner->scans[aligner->cursor.scan];

    if (scan->cluster != aligner->move.home || aligner->clusters[aligner->move.home].size < 3 ||
        !find_weak_direction(aligner, aligner->cursor.scan, &aligner->move.weak_direction))
        return 0;
    aligner->changed_scans += !scan->is_weak;
    scan->is_weak = 1;
    aligner->move.previous_pose = aligner->poses[aligner->cursor.scan];
    return 1;
}

static void begin_translation(cairn_aligner *aligner)
{
    aligner->move.line_nats = 0;
    cairn_aligner_begin_evaluation(
        aligner, aligner->scan_count, aligner->move.home,
        cairn_transform_of(aligner->move.peaks[aligner->move.peak_index].pose), 0, -CAIRN_REAL_MAX);
}

/* Updates the best translation. */
static void update_best(cairn_aligner *aligner)
{
    aligner_count count = {.other_surface = aligner->evaluation.count.other_surface,
                           .free_space = aligner->evaluation.count.free_space};
    cairn_real score = cairn_aligner_log_likelihood_ratio(aligner, count) +
                       aligner->evaluation.log_prior + aligner->move.line_nats;

    if (score > aligner->move.best_score) {
        aligner->move.best_score = score;
        aligner->move.best_pose = aligner->evaluation.pose;
    }
}

static void place(cairn_aligner *aligner)
{
    aligner->changed_scans += !cairn_aligner_is_near(
        aligner->move.best_pose, aligner->move.previous_pose, CAIRN_REAL(0.005), 0);
    cairn_aligner_put_back(aligner, aligner->move.home, aligner->move.best_pose);
}

int cairn_aligner_translate(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_cursor *cursor = &aligner->cursor;
    aligner_move *move = &aligner->move;
    const aligner_scan *scan = &aligner->scans[cursor->scan];

    CAIRN_STEP_BEGIN(aligner->resume.part);
    for (cursor->scan = 0; cursor->scan < aligner->scan_count; cursor->scan++) {
        scan = &aligner->scans[cursor->scan];
        ALIGNER_CHARGE(part, 1 + scan->end_segment - scan->first_segment);
        if (!is_weak(aligner))
            continue;
        ALIGNER_CHARGE(part, 1 + aligner->clusters[move->home].size / SCANS_PER_UNIT);
        begin_translations(aligner);
        for (cursor->item = scan->first_segment; cursor->item < scan->end_segment; cursor->item++) {
            ALIGNER_CHARGE(part, 1 + aligner->wall_count / WALLS_PER_UNIT);
            add_translations(aligner);
        }
        if (move->peak_count == 1)
            continue;
        cairn_aligner_take_out(aligner);
        move->best_score = -CAIRN_REAL_MAX;
        for (; move->peak_index < move->peak_count; move->peak_index++) {
            begin_translation(aligner);
            CAIRN_STEP_RUN(aligner, resume.part, budget, cairn_aligner_evaluate);
            for (cursor->item = scan->first_segment; cursor->item < scan->end_segment;
                 cursor->item++) {
                ALIGNER_CHARGE(part, 1 + aligner->wall_count / WALLS_PER_UNIT);
                add_line_nats(aligner);
            }
            update_best(aligner);
        }
        ALIGNER_CHARGE(part, 1);
        place(aligner);
    }
    CAIRN_STEP_END(aligner->resume.part);
}
