/* Scores of a relative pose of two maps: agreement, free-space violation, Psi and gamma.
 *
 * Method: Psi and gamma are the sums of equations 9.5 and 9.6, by default over an evenly spread
 * sample of the cells of both maps and with exact disagreement; as written over all cells
 * (map_merge_image.c).
 *
 * Source: Adluru 2008, section 9.4. */
#include "src/base/build.h"

#include <string.h>

#include "src/merging/map_merge_work.h"

/* Points or cells whose kernels are added per unit. */
enum { KERNELS_PER_UNIT = 2 };

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

int32_t cairn_map_merge_score_units(const cairn_map_merge *merge, int32_t a, int32_t b)
{
    const map_merge_map *first = &merge->maps[a], *second = &merge->maps[b];
    int32_t points = first->point_count + second->point_count,
            cells = first->free_cell_count + second->free_cell_count;

    return 1 + points / MAP_MERGE_POINTS_PER_UNIT + (points + cells) / KERNELS_PER_UNIT;
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
        int32_t is_done = 0;

        cairn_map_merge_begin_images(&images, first, second, centres);
        while (!is_done) {
            cairn_budget budget = {CAIRN_UNBOUNDED};

            is_done = cairn_map_merge_step_images(&images, merge->written->kernel, &budget);
        }
        cairn_map_merge_end_images(&images, score);
        return;
    }
    share[0] = add_images(first, second, there, score);
    share[1] = add_images(second, first, back, score);
    score->overlap = first->free_count < second->free_count ? share[1] : share[0];
    d = cairn_max(score->disagreement, CAIRN_REAL(1e-6));
    score->gamma = -cairn_log(d) - d;
}
