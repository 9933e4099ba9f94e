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

    for (int32_t k = 0; k < aligner->peak_count; k++)
        if (cairn_abs(aligner->peaks[k].score - shift) < SAME_TRANSLATION_M)
            return;
    if (aligner->peak_count == ALIGNER_MAX_TRANSLATIONS)
        return;
    pose = &aligner->peaks[aligner->peak_count].pose;
    *pose = cairn_pose_of(aligner->previous_pose);
    pose->x += shift * aligner->weak_direction.x;
    pose->y += shift * aligner->weak_direction.y;
    aligner->peaks[aligner->peak_count++].score = shift;
}

/* Candidates: zero, the initial pose, and where walls meet. */
static void find_translations(cairn_aligner *aligner)
{
    const aligner_scan *scan = &aligner->scans[aligner->scan_index];
    cairn_transform gauge = cairn_transform_inverse(cairn_aligner_gauge(aligner, aligner->home));
    cairn_transform expected = cairn_transform_compose(gauge, cairn_transform_of(scan->initial));
    cairn_vec2 off = {expected.x - aligner->previous_pose.x, expected.y - aligner->previous_pose.y};
    cairn_real shift;

    aligner->peak_count = aligner->peak_index = 0;
    insert_translation(aligner, 0);
    insert_translation(aligner, cairn_vec2_dot(aligner->weak_direction, off));
    for (int32_t k = scan->first_segment; k < scan->end_segment; k++) {
        placed p = place_at(&aligner->segments[k], aligner->previous_pose);

        for (int32_t w = 0; w < aligner->wall_count && p.segment->weight > 0; w++)
            if (shift_to(&p, aligner->weak_direction, &aligner->walls[w], &shift) &&
                cairn_abs(shift) <= aligner->params.max_initial_error)
                insert_translation(aligner, shift);
    }
}

/* Returns the gain of the current scan's surfaces on walls, nats. */
static cairn_real line_nats(const cairn_aligner *aligner, cairn_transform pose)
{
    const aligner_scan *scan = &aligner->scans[aligner->scan_index];
    cairn_real sum = 0, shift;

    for (int32_t k = scan->first_segment; k < scan->end_segment; k++) {
        const aligner_segment *s = &aligner->segments[k];
        placed p = place_at(s, pose);
        cairn_real least = LINE_DISTANCE_M;

        if (!(s->weight > 0))
            continue;
        for (int32_t w = 0; w < aligner->wall_count; w++)
            if (shift_to(&p, aligner->weak_direction, &aligner->walls[w], &shift))
                least = cairn_min(least, cairn_abs(shift));
        least /= LINE_DISTANCE_M;
        sum += CONTINUATION_NATS *
               (s->is_short ? CAIRN_REAL(0.5) : cairn_min(s->length / FULL_WEIGHT_LENGTH_M, 1)) *
               (1 - least * least);
    }
    return sum;
}

static int32_t choose(cairn_aligner *aligner)
{
    int32_t home = aligner->home, units;

    if (aligner->scan_index == aligner->scan_count) {
        cairn_aligner_end_translations(aligner, aligner->changed_scans);
        return 1;
    }
    units = 1 + aligner->scans[aligner->scan_index].end_segment -
            aligner->scans[aligner->scan_index].first_segment;
    if (aligner->scans[aligner->scan_index].cluster != home || aligner->clusters[home].size < 3 ||
        !find_weak_direction(aligner, aligner->scan_index, &aligner->weak_direction)) {
        aligner->scan_index++;
        return units;
    }
    aligner->changed_scans += !aligner->scans[aligner->scan_index].is_weak;
    aligner->scans[aligner->scan_index].is_weak = 1;
    aligner->previous_pose = aligner->poses[aligner->scan_index];
    find_translations(aligner);
    if (aligner->peak_count == 1) {
        aligner->scan_index++;
    } else {
        cairn_transform same = {0, 0, 1, 0};

        cairn_aligner_put_back(aligner, aligner->scan_count, same);
        aligner->best_score = -CAIRN_REAL_MAX;
        aligner->phase = ALIGNER_TRY_TRANSLATIONS;
    }
    return units + units * aligner->wall_count / 16;
}

static int32_t try_translation(cairn_aligner *aligner)
{
    if (aligner->peak_index > 0) {
        aligner_count count = {.other_surface = aligner->evaluation.count.other_surface,
                               .free_space = aligner->evaluation.count.free_space};
        cairn_real score = cairn_aligner_log_likelihood_ratio(aligner, count) +
                           aligner->evaluation.log_prior +
                           line_nats(aligner, aligner->evaluation.pose);

        if (score > aligner->best_score) {
            aligner->best_score = score;
            aligner->best_pose = aligner->evaluation.pose;
        }
    }
    if (aligner->peak_index < aligner->peak_count) {
        cairn_aligner_begin_evaluation(
            aligner, aligner->scan_count, aligner->home,
            cairn_transform_of(aligner->peaks[aligner->peak_index++].pose), 0, -CAIRN_REAL_MAX);
        return 1 + aligner->wall_count / 16;
    }
    aligner->changed_scans +=
        !cairn_aligner_is_near(aligner->best_pose, aligner->previous_pose, CAIRN_REAL(0.005), 0);
    cairn_aligner_put_back(aligner, aligner->home, aligner->best_pose);
    aligner->scan_index++;
    aligner->phase = ALIGNER_TRANSLATE;
    return 1;
}

int32_t cairn_aligner_translate_item(cairn_aligner *aligner)
{
    return aligner->phase == ALIGNER_TRANSLATE ? choose(aligner) : try_translation(aligner);
}
