/* aligner: translation of scans along their weakly observable direction.
 *
 * Method: a scan of one long wall is unobservable along it, up to the extent of the shared
 * surfaces. Its other surfaces, which no other scan shows there, mostly lie on the straight
 * continuation of a wall of the map.
 * 1. Find the weakly observable direction of each scan from its information matrix.
 * 2. Candidates: translations that bring a surface onto a wall, to the initial pose, and zero.
 * 3. Score: free-space violations, prior, and a gain for surfaces that continue a wall. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

enum { MAX_PASSES = 2 };

/* m: standard deviation from which a direction is weakly observable */
static const cairn_real WEAK_SIGMA_M = CAIRN_REAL(0.03);
/* m: lever arm that weights rotations against translations */
static const cairn_real ARM_M = CAIRN_REAL(1.5);
/* least sine between the weak direction and a wall */
static const cairn_real MIN_CROSS_SINE = CAIRN_REAL(0.5);
/* m */
static const cairn_real SAME_TRANSLATION_M = CAIRN_REAL(0.03), LINE_DISTANCE_M = CAIRN_REAL(0.05),
                        MAX_GAP_M = 6;
static const cairn_real CONTINUATION_NATS = 3, FULL_WEIGHT_LENGTH_M = CAIRN_REAL(0.3);

void cairn_aligner_begin_slides(cairn_aligner *aligner)
{
    aligner->phase = ALIGNER_SLIDE;
    aligner->i = 0;
    aligner->changed = 0;
    if (aligner->slides++ == MAX_PASSES)
        aligner->i = aligner->scan_count;
}

/* Finds the unit direction of the translation that is weakly observable; returns 0 without one. */
static int find_weak_direction(const cairn_aligner *aligner, int32_t i, cairn_vec2 *along)
{
    cairn_sym3 own = cairn_aligner_own_information(aligner, i);
    cairn_real values[3], vectors[3][3];

    own.xz /= ARM_M;
    own.yz /= ARM_M;
    own.zz /= ARM_M * ARM_M;
    cairn_sym3_eigen(own, values, vectors);
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

static placed place_at(const aligner_segment *s, cairn_transform pose)
{
    placed p = {s, cairn_transform_direction(pose, s->direction),
                cairn_transform_point(pose, s->mean)};

    return p;
}

/* Computes the translation that brings a segment onto the line of a wall; returns 0 without one. */
static int shift_to(const placed *p, cairn_vec2 along, const aligner_wall *wall, cairn_real *shift)
{
    cairn_real across = cairn_vec2_dot(wall->normal, along), place, half;
    cairn_vec2 way = cairn_aligner_along(wall);

    if (cairn_abs(across) < MIN_CROSS_SINE ||
        (wall->scans == 1 && wall->first_scan == p->segment->scan) ||
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

    for (int32_t k = 0; k < aligner->find_count; k++)
        if (cairn_abs(aligner->find[k].score - shift) < SAME_TRANSLATION_M)
            return;
    if (aligner->find_count == ALIGNER_SLIDES)
        return;
    pose = &aligner->find[aligner->find_count].pose;
    *pose = cairn_aligner_to_pose(aligner->before);
    pose->x += shift * aligner->along.x;
    pose->y += shift * aligner->along.y;
    aligner->find[aligner->find_count++].score = shift;
}

/* Candidates: zero, the initial pose, and where walls meet. */
static void find_translations(cairn_aligner *aligner)
{
    const aligner_scan *scan = &aligner->scans[aligner->i];
    cairn_transform gauge = cairn_aligner_inverse(cairn_aligner_gauge(aligner, aligner->home));
    cairn_transform expected = cairn_aligner_compose(gauge, cairn_transform_of(scan->initial));
    cairn_vec2 off = {expected.x - aligner->before.x, expected.y - aligner->before.y};
    cairn_real shift;

    aligner->find_count = aligner->find_at = 0;
    insert_translation(aligner, 0);
    insert_translation(aligner, cairn_vec2_dot(aligner->along, off));
    for (int32_t k = scan->first_segment; k < scan->end_segment; k++) {
        placed p = place_at(&aligner->segments[k], aligner->before);

        for (int32_t w = 0; w < aligner->wall_count && p.segment->weight > 0; w++)
            if (shift_to(&p, aligner->along, &aligner->walls[w], &shift) &&
                cairn_abs(shift) <= aligner->params.spread)
                insert_translation(aligner, shift);
    }
}

/* Returns the gain of the current scan's surfaces on walls, nats. */
static cairn_real line_nats(const cairn_aligner *aligner, cairn_transform pose)
{
    const aligner_scan *scan = &aligner->scans[aligner->i];
    cairn_real sum = 0, shift;

    for (int32_t k = scan->first_segment; k < scan->end_segment; k++) {
        const aligner_segment *s = &aligner->segments[k];
        placed p = place_at(s, pose);
        cairn_real least = LINE_DISTANCE_M;

        if (!(s->weight > 0))
            continue;
        for (int32_t w = 0; w < aligner->wall_count; w++)
            if (shift_to(&p, aligner->along, &aligner->walls[w], &shift))
                least = cairn_min(least, cairn_abs(shift));
        least /= LINE_DISTANCE_M;
        sum += CONTINUATION_NATS *
               (s->stub ? CAIRN_REAL(0.5) : cairn_min(s->length / FULL_WEIGHT_LENGTH_M, 1)) *
               (1 - least * least);
    }
    return sum;
}

static int32_t choose(cairn_aligner *aligner)
{
    int32_t home = aligner->home, units;

    if (aligner->i == aligner->scan_count) {
        cairn_aligner_end_slides(aligner, aligner->changed);
        return 1;
    }
    units = 1 + aligner->scans[aligner->i].end_segment - aligner->scans[aligner->i].first_segment;
    if (aligner->scans[aligner->i].part != home || aligner->clusters[home].size < 3 ||
        !find_weak_direction(aligner, aligner->i, &aligner->along)) {
        aligner->i++;
        return units;
    }
    aligner->changed += !aligner->scans[aligner->i].weak;
    aligner->scans[aligner->i].weak = 1;
    aligner->before = aligner->poses[aligner->i];
    find_translations(aligner);
    if (aligner->find_count == 1) {
        aligner->i++;
    } else {
        cairn_transform same = {0, 0, 1, 0};

        cairn_aligner_put_back(aligner, aligner->scan_count, same);
        aligner->best_score = -CAIRN_REAL_MAX;
        aligner->phase = ALIGNER_SLIDE_TRY;
    }
    return units + units * aligner->wall_count / 16;
}

static int32_t try_translation(cairn_aligner *aligner)
{
    if (aligner->find_at > 0) {
        aligner_count count = {.other = aligner->look.count.other,
                               .through = aligner->look.count.through};
        cairn_real score = cairn_aligner_evidence(aligner, count) + aligner->look.prior +
                           line_nats(aligner, aligner->look.pose);

        if (score > aligner->best_score) {
            aligner->best_score = score;
            aligner->best = aligner->look.pose;
        }
    }
    if (aligner->find_at < aligner->find_count) {
        cairn_aligner_begin_look(aligner, aligner->scan_count, aligner->home,
                                 cairn_transform_of(aligner->find[aligner->find_at++].pose), 0,
                                 -CAIRN_REAL_MAX);
        return 1 + aligner->wall_count / 16;
    }
    aligner->changed += !cairn_aligner_near(aligner->best, aligner->before, CAIRN_REAL(0.005), 0);
    cairn_aligner_put_back(aligner, aligner->home, aligner->best);
    aligner->i++;
    aligner->phase = ALIGNER_SLIDE;
    return 1;
}

int32_t cairn_aligner_slide_item(cairn_aligner *aligner)
{
    return aligner->phase == ALIGNER_SLIDE ? choose(aligner) : try_translation(aligner);
}
