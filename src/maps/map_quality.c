/* Map entropy, beam likelihood, pose errors and relation errors.
 *
 * Method: one pass over cells, beams, poses or relations, as the header defines; no state.
 *
 * Limits: entropy decreases with every unobserved cell and depends on the resolution; a map may be
 * sharp and wrong. */
#include "src/base/build.h"

#include "cairn/map_quality.h"

/* Returns the binary entropy -p log p - (1 - p) log(1 - p), nats. */
static cairn_real entropy_of(cairn_real p)
{
    if (!(p > 0 && p < 1))
        return 0;
    return -p * cairn_log(p) - (1 - p) * cairn_log(1 - p);
}

static int quadrant_of(const cairn_occupancy_grid_params *params, int32_t x, int32_t y)
{
    int east = x >= params->width / 2;

    if (y >= params->height / 2)
        return east ? CAIRN_MAP_QUALITY_QUADRANT_NE : CAIRN_MAP_QUALITY_QUADRANT_NW;
    return east ? CAIRN_MAP_QUALITY_QUADRANT_SE : CAIRN_MAP_QUALITY_QUADRANT_SW;
}

cairn_status cairn_map_quality_entropy_add(const cairn_occupancy_grid *grid, int32_t first_row,
                                           int32_t rows, cairn_map_quality_entropy *entropy)
{
    cairn_occupancy_grid_params params;

    if (grid == NULL || entropy == NULL)
        return CAIRN_BAD_ARGUMENT;
    params = cairn_occupancy_grid_read(grid);
    if (first_row < 0 || rows < 0 || first_row > params.height || rows > params.height - first_row)
        return CAIRN_BAD_ARGUMENT;
    for (int32_t y = first_row; y < first_row + rows; y++)
        for (int32_t x = 0; x < params.width; x++) {
            cairn_real p = cairn_occupancy_grid_probability(grid, x, y), h;

            if (p < 0)
                continue;
            h = entropy_of(p);
            entropy->total += h;
            entropy->quadrant[quadrant_of(&params, x, y)] += h;
            entropy->cells++;
        }
    return CAIRN_OK;
}

/* Returns -log of the probability that a beam passes a chord. A cell of hits without any length
 * gets a large finite value: it stops every beam. */
static cairn_real resistance(const cairn_occupancy_grid *grid,
                             const cairn_occupancy_grid_chord *chord)
{
    cairn_occupancy_grid_cell_state cell = cairn_occupancy_grid_cell(grid, chord->x, chord->y);

    if (cell.hits <= 0)
        return 0;
    if (!(cell.length > 0))
        return CAIRN_REAL_MAX / 4;
    return chord->length * (cairn_real)cell.hits / (cairn_real)cell.length;
}

cairn_status cairn_map_quality_beam_likelihood(const cairn_occupancy_grid *grid, cairn_vec2 from,
                                               cairn_vec2 to, int32_t hit, cairn_real least,
                                               cairn_real *log_likelihood)
{
    cairn_real passed = 0, last = 0, p;
    cairn_occupancy_grid_chord chord;
    cairn_occupancy_grid_ray walk;
    cairn_status status;
    int ends_inside = 0;

    if (grid == NULL || log_likelihood == NULL || !(least > 0 && least < 1))
        return CAIRN_BAD_ARGUMENT;
    status = cairn_occupancy_grid_walk(grid, from, to, &walk);
    if (status == CAIRN_NOT_FINITE)
        return status;
    if (status == CAIRN_OK) {
        ends_inside = walk.ends_inside;
        while (cairn_occupancy_grid_ray_next(&walk, &chord)) {
            passed = cairn_min(passed + last, CAIRN_REAL_MAX / 4);
            last = resistance(grid, &chord);
        }
    }
    if (hit)
        p = ends_inside ? cairn_exp(-passed) * (1 - cairn_exp(-last)) : 0;
    else
        p = cairn_exp(-cairn_min(passed + last, CAIRN_REAL_MAX / 4));
    *log_likelihood = cairn_log(least + (1 - least) * p);
    return CAIRN_OK;
}

cairn_status cairn_map_quality_pose_errors_of(const cairn_pose *estimate, const cairn_pose *truth,
                                              int32_t count, cairn_map_quality_pose_errors *errors)
{
    cairn_map_quality_pose_errors sum = {0, 0, 0};

    if (estimate == NULL || truth == NULL || errors == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (count < 1)
        return CAIRN_EMPTY;
    for (int32_t i = 0; i < count; i++) {
        cairn_pose a, b;

        if (!cairn_pose_is_finite(estimate[i]) || !cairn_pose_is_finite(truth[i]))
            return CAIRN_NOT_FINITE;
        a = cairn_pose_between(estimate[0], estimate[i]);
        b = cairn_pose_between(truth[0], truth[i]);
        sum.x += cairn_abs(a.x - b.x);
        sum.y += cairn_abs(a.y - b.y);
        sum.theta += cairn_abs(cairn_wrap_angle(a.theta - b.theta));
    }
    errors->x = sum.x / (cairn_real)count;
    errors->y = sum.y / (cairn_real)count;
    errors->theta = sum.theta / (cairn_real)count;
    return CAIRN_OK;
}

cairn_status cairn_map_quality_relation_add(cairn_map_quality_relation_sums *sums,
                                            cairn_pose reference, cairn_pose map_first,
                                            cairn_pose map_second)
{
    cairn_pose off;
    cairn_real distance, angle;

    if (sums == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pose_is_finite(reference) || !cairn_pose_is_finite(map_first) ||
        !cairn_pose_is_finite(map_second))
        return CAIRN_NOT_FINITE;
    off = cairn_pose_between(reference, cairn_pose_between(map_first, map_second));
    distance = cairn_sqrt(off.x * off.x + off.y * off.y);
    angle = cairn_abs(off.theta);
    sums->count++;
    sums->distance += distance;
    sums->angle += angle;
    sums->distance_squared += distance * distance;
    sums->angle_squared += angle * angle;
    return CAIRN_OK;
}

static cairn_real deviation(cairn_real mean, cairn_real square)
{
    return cairn_sqrt(cairn_max(square - mean * mean, 0));
}

cairn_map_quality_relation_errors
cairn_map_quality_relation_errors_of(const cairn_map_quality_relation_sums *sums)
{
    cairn_map_quality_relation_errors errors = {0, 0, 0, 0, 0, 0};
    cairn_real n = (cairn_real)sums->count;

    if (sums->count == 0)
        return errors;
    errors.distance_mean = sums->distance / n;
    errors.distance_squared = sums->distance_squared / n;
    errors.distance_sd = deviation(errors.distance_mean, errors.distance_squared);
    errors.angle_mean = sums->angle / n;
    errors.angle_squared = sums->angle_squared / n;
    errors.angle_sd = deviation(errors.angle_mean, errors.angle_squared);
    return errors;
}
