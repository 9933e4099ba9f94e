/* Scores of a relative pose of two maps: agreement, free-space violation, Psi and gamma; lists of
 * the best.
 *
 * Method: Psi and gamma are the sums of equations 9.5 and 9.6, by default over an evenly spread
 * sample of the cells of both maps and with exact disagreement; as written over all cells
 * (map_merge_image.c).
 *
 * Source: Adluru 2008, section 9.4. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/maps/map_merge_work.h"

/* cells: reach of the search kernel */
#define SOFT_REACH_CELLS 6

/* ---- Modes ---- */

int cairn_map_merge_is_same(cairn_pose a, cairn_pose b, cairn_real metres, cairn_real radians)
{
    cairn_real x = a.x - b.x, y = a.y - b.y;

    return x * x + y * y < metres * metres &&
           cairn_abs(cairn_wrap_angle(a.theta - b.theta)) < radians;
}

static cairn_real reach_of(const map_merge_map *map)
{
    return cairn_vec2_norm(map->corner);
}

int cairn_map_merge_is_disjoint(const cairn_map_merge *merge, int32_t first, int32_t second,
                                cairn_pose first_second)
{
    cairn_real reach = reach_of(&merge->maps[first]) + reach_of(&merge->maps[second]);

    return first_second.x * first_second.x + first_second.y * first_second.y > reach * reach;
}

/* Tolerances within which two modes are duplicates. */
typedef struct mode_tolerance {
    cairn_real metres, radians;
} mode_tolerance;

static int is_duplicate(const void *context, const void *entry, const void *other)
{
    const mode_tolerance *tolerance = context;
    const map_merge_mode *a = other, *b = entry;

    return cairn_map_merge_is_same(a->first_second, b->first_second, tolerance->metres,
                                   tolerance->radians);
}

void cairn_map_merge_insert_mode(map_merge_mode *list, int32_t *count, int32_t most,
                                 map_merge_mode mode, cairn_real metres, cairn_real radians)
{
    mode_tolerance tolerance = {metres, radians};
    ranked_list modes = {.entries = list,
                         .count = count,
                         .capacity = most,
                         .entry_bytes = sizeof mode,
                         .score_at = offsetof(map_merge_mode, log_ratio),
                         .is_near = is_duplicate,
                         .context = &tolerance,
                         .replaces_one = 1};

    (void)ranked_list_insert(&modes, &mode);
}

static uint16_t cell_of(const map_merge_map *to, cairn_vec2 p, cairn_real scale)
{
    return map_merge_cell_at(to, (p.x - to->corner.x) * scale, (p.y - to->corner.y) * scale);
}

/* Adds points begin ... end - 1 of `from`, mapped by t, looked up in the grid of `to`. A point
 * agrees when it lies on a wall and has free space in front, as in its own map: the two faces of a
 * wall do not agree. A point two cells beside a wall may lie on the other face or be displaced by
 * noise: it counts half. A third one is neutral. */
void cairn_map_merge_sum(const cairn_map_merge *merge, const map_merge_map *to,
                         const map_merge_map *from, const cairn_transform *transform, int32_t begin,
                         int32_t end, map_merge_sums *sums)
{
    cairn_real scale = 1 / to->input.resolution;

    for (int32_t i = begin; i < end; i++) {
        cairn_vec2 p = cairn_transform_point(*transform, from->points[i].position);
        uint16_t cell = cell_of(to, p, scale);
        int32_t d = map_merge_to_occupied(cell);

        if (map_merge_class(cell) == MAP_MERGE_UNKNOWN)
            continue;
        sums->known_count++;
        sums->centroid_sum = cairn_vec2_add(sums->centroid_sum, p);
        if (d > 3 && map_merge_class(cell) == MAP_MERGE_FREE) {
            sums->conflict += 1;
            sums->soft_conflict += d > 5;
        }
        if (d > SOFT_REACH_CELLS ||
            map_merge_class(
                cell_of(to, cairn_transform_point(*transform, from->points[i].free_side), scale)) !=
                MAP_MERGE_FREE)
            continue;
        sums->soft_agree += merge->soft_kernel[d];
        if (d <= 2)
            sums->agree += d < 2 ? from->points[i].weight : from->points[i].weight / 2;
    }
}

/* ---- Images ---- */

/* Sums of the kernels of Psi and d over the points of one class, scaled to the whole map. */
typedef struct image_sums {
    cairn_real same, other;
    int32_t known;
} image_sums;

static cairn_real kernel_of(int32_t cells)
{
    return cells > 20 ? 0 : cairn_exp(-(cairn_real)(cells * cells) / 8);
}

static void add_image(const map_merge_map *to, cairn_vec2 p, int32_t class, image_sums *sums)
{
    uint16_t cell = map_merge_cell_at(to, (p.x - to->corner.x) / to->input.resolution,
                                      (p.y - to->corner.y) / to->input.resolution);

    sums->known += map_merge_class(cell) != MAP_MERGE_UNKNOWN;
    sums->same += kernel_of(class == MAP_MERGE_OCCUPIED ? map_merge_to_occupied(cell)
                                                        : map_merge_to_free(cell));
    sums->other += map_merge_class(cell) != MAP_MERGE_UNKNOWN && map_merge_class(cell) != class;
}

/* Adds both classes of `from` in the grid of `to` to psi and d; returns the observed share of the
 * free cells. */
static cairn_real add_images(const map_merge_map *to, const map_merge_map *from, cairn_transform t,
                             cairn_map_merge_pair_score *score)
{
    image_sums walls = {0, 0, 0}, open = {0, 0, 0};
    cairn_real points = cairn_max((cairn_real)from->point_count, 1),
               cells = cairn_max((cairn_real)from->free_cell_count, 1);

    for (int32_t i = 0; i < from->point_count; i++)
        add_image(to, cairn_transform_point(t, from->points[i].position), MAP_MERGE_OCCUPIED,
                  &walls);
    for (int32_t i = 0; i < from->free_cell_count; i++)
        add_image(to, cairn_transform_point(t, from->free_cells[i]), MAP_MERGE_FREE, &open);
    score->psi += walls.same / points + open.same / cells;
    score->disagreement += walls.other / points + open.other / cells;
    return (cairn_real)open.known / cells;
}

void cairn_map_merge_score_at(const cairn_map_merge *merge, int32_t a, int32_t b,
                              cairn_pose centres, cairn_map_merge_pair_score *score)
{
    const map_merge_map *first = &merge->maps[a], *second = &merge->maps[b];
    cairn_transform there = cairn_transform_of(centres),
                    back = cairn_transform_of(cairn_pose_inverse(centres));
    map_merge_sums s[2] = {{0, 0, 0, 0, {0, 0}, 0}, {0, 0, 0, 0, {0, 0}, 0}};
    cairn_real share[2], d;

    memset(score, 0, sizeof *score);
    cairn_map_merge_sum(merge, first, second, &there, 0, second->point_count, &s[0]);
    cairn_map_merge_sum(merge, second, first, &back, 0, first->point_count, &s[1]);
    score->agreeing_wall = (s[0].agree * second->spacing + s[1].agree * first->spacing) / 2;
    score->free_space_violation = s[0].conflict * second->spacing + s[1].conflict * first->spacing;
    score->log_likelihood_ratio =
        cairn_map_merge_nats(merge, score->agreeing_wall, score->free_space_violation);
    if (map_merge_is_written(&merge->params)) {
        map_merge_images images;
        cairn_budget budget = {CAIRN_UNBOUNDED};
        int32_t charged = 0;

        cairn_map_merge_begin_images(&images, first, second, centres);
        while (!cairn_map_merge_step_images(&images, merge->written->kernel, &charged, &budget))
            budget.left = CAIRN_UNBOUNDED;
        cairn_map_merge_end_images(&images, score);
        return;
    }
    share[0] = add_images(first, second, there, score);
    share[1] = add_images(second, first, back, score);
    score->overlap = first->free_count < second->free_count ? share[1] : share[0];
    d = cairn_max(score->disagreement, CAIRN_REAL(1e-6));
    score->gamma = -cairn_log(d) - d;
}
