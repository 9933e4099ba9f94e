/* Inner loop over pairs of points of force field simulation.
 *
 * Method.
 *
 * 1. exp(-s) = exp(-i) exp(-j/64) exp(d) with s = i + j/64 - d, from two tables and a short Taylor
 *    series. s is at most reach^2 / 2 = 18, so neither underflow nor scaling can occur.
 * 2. The potential uses erfc(x) = erfc(x0) - 2/sqrt(pi) times the integral of exp(-t^2) from the
 *    nearest table node x0 to x, by the two-point Hermite rule with two derivatives. Its end values
 *    are in the table or already computed: no second exponential.
 * 3. Forces are summed row by row. The torque and the opposite force on the other strip follow from
 *    these sums.
 *
 * Source: Adluru 2008, section 7.3.1. */
#include "src/base/build.h"

#include "cairn/force_kernel.h"

enum { EXP_INTEGER_NODES = 20, EXP_FRACTION_NODES = 64, ERFC_NODES = 69 };

/* points beyond reach that cost as much as a pair within it */
enum { COMPARISONS_PER_UNIT = 8 };

/* 1 / sqrt(2 pi), 1 / sqrt(2), 1 / sqrt(pi) */
#define INVERSE_SQRT_2PI CAIRN_REAL(0.39894228040143267794)
#define INVERSE_SQRT_2   CAIRN_REAL(0.70710678118654752440)
#define ONE_FIFTH        (CAIRN_REAL(1.0) / 5)
#define ONE_SIXTH        (CAIRN_REAL(1.0) / 6)
#define INVERSE_SQRT_PI  CAIRN_REAL(0.56418958354775628695)

cairn_vec2 cairn_force_kernel_pair(cairn_oriented_point p1, cairn_oriented_point p2, cairn_real m1,
                                   cairn_real m2, cairn_real sigma, cairn_real *potential)
{
    cairn_vec2 to = cairn_vec2_sub(p2.position, p1.position), none = {0, 0};
    cairn_real r = cairn_vec2_norm(to);
    cairn_real weight = m1 * m2 * cairn_abs(cairn_vec2_dot(p1.direction, p2.direction));
    cairn_real strength =
        weight * cairn_exp(-r * r / (2 * sigma * sigma)) * INVERSE_SQRT_2PI / sigma;

    if (potential != NULL)
        *potential = -weight / 2 * cairn_erfc(r * INVERSE_SQRT_2 / sigma);
    return r < CAIRN_FORCE_KERNEL_MIN_DISTANCE_M ? none : cairn_vec2_scale(to, strength / r);
}

void cairn_force_kernel_init(cairn_force_kernel *kernel)
{
    for (int32_t i = 0; i < EXP_INTEGER_NODES; i++)
        kernel->exp_integer[i] = cairn_exp(-(cairn_real)i);
    for (int32_t i = 0; i < EXP_FRACTION_NODES; i++)
        kernel->exp_fraction[i] = cairn_exp(-(cairn_real)i / EXP_FRACTION_NODES);
    for (int32_t i = 0; i < ERFC_NODES; i++) {
        cairn_real x = (cairn_real)i / 16, e = cairn_exp(-x * x);

        kernel->erfc[i][0] = cairn_erfc(x);
        kernel->erfc[i][1] = e;
        kernel->erfc[i][2] = 2 * x * e;
        kernel->erfc[i][3] = (2 * x * x - 1) * e;
    }
    cairn_force_kernel_set(kernel, 1, CAIRN_FORCE_KERNEL_MAX_REACH);
}

void cairn_force_kernel_set(cairn_force_kernel *kernel, cairn_real sigma, cairn_real reach)
{
    kernel->scale = 1 / (2 * sigma * sigma);
    kernel->root_scale = INVERSE_SQRT_2 / sigma;
    kernel->norm = INVERSE_SQRT_2PI / sigma;
    kernel->limit_squared = reach * sigma * (reach * sigma);
    /* Where they overflow nothing is within reach: what the tables are read at stays in range. */
    if (!(kernel->scale <= CAIRN_REAL_MAX && kernel->limit_squared <= CAIRN_REAL_MAX))
        kernel->limit_squared = -1;
    kernel->min_spring_length = sigma / 8;
}

/* Returns exp(-s), 0 <= s < EXP_INTEGER_NODES - 1. */
static inline cairn_real exp_negative(const cairn_force_kernel *kernel, cairn_real s)
{
    int32_t k = (int32_t)(s * EXP_FRACTION_NODES + CAIRN_REAL(0.5));
    cairn_real d = (cairn_real)k * (CAIRN_REAL(1.0) / EXP_FRACTION_NODES) - s; /* within 1/128 */
    cairn_real series;

    CAIRN_ASSERT(k >= 0 && k < EXP_INTEGER_NODES * EXP_FRACTION_NODES);
#ifdef CAIRN_FLOAT
    series = 1 + (d + d * d * CAIRN_REAL(0.5));
#else
    series =
        1 +
        (d +
         d * d * (CAIRN_REAL(1.0) / 2 + d * (CAIRN_REAL(1.0) / 6 + d * (CAIRN_REAL(1.0) / 24))));
#endif
    return kernel->exp_integer[(uint32_t)k / EXP_FRACTION_NODES] *
           kernel->exp_fraction[(uint32_t)k % EXP_FRACTION_NODES] * series;
}

/* Returns erfc(x), 0 <= x < ERFC_NODES / 16, with square = x^2 and e = exp(-x^2). */
static inline cairn_real erfc_interpolated(const cairn_force_kernel *kernel, cairn_real x,
                                           cairn_real square, cairn_real e)
{
    int32_t k = (int32_t)(x * 16 + CAIRN_REAL(0.5));
    cairn_real d = x - (cairn_real)k * (CAIRN_REAL(1.0) / 16), slopes, curvatures;
    const cairn_real *node;

    CAIRN_ASSERT(k >= 0 && k < ERFC_NODES);
    node = kernel->erfc[k];
    curvatures = node[3] + (2 * square - 1) * e;
    slopes = 2 * x * e - node[2];
    return node[0] - INVERSE_SQRT_PI * d *
                         (node[1] + e + d * ONE_FIFTH * (slopes + d * ONE_SIXTH * curvatures));
}

/* Adds the pair as a spring with the same force, but no stiffer than at the minimum length. */
static inline void add_spring(const cairn_force_kernel *kernel, cairn_real x, cairn_real y,
                              cairn_real r, cairn_real strength, cairn_force_kernel_pull *pull)
{
    cairn_real stiffness = strength / cairn_max(r, kernel->min_spring_length);

    pull->stiffness += stiffness;
    pull->spring_x += stiffness * x;
    pull->spring_y += stiffness * y;
    pull->spring_xx += stiffness * x * x;
    pull->spring_xy += stiffness * x * y;
    pull->spring_yy += stiffness * y * y;
}

static inline void add_pair(const cairn_force_kernel *kernel, cairn_real x, cairn_real y,
                            cairn_real square, cairn_real mass, int32_t with_potential,
                            int32_t with_springs, cairn_force_kernel_pull *pull)
{
    cairn_real r = cairn_sqrt(square), scaled = square * kernel->scale,
               e = exp_negative(kernel, scaled), strength;

    if (with_potential)
        pull->potential += mass * erfc_interpolated(kernel, r * kernel->root_scale, scaled, e);
    if (with_springs)
        add_spring(kernel, x, y, r, mass * e, pull);
    strength = r < CAIRN_FORCE_KERNEL_MIN_DISTANCE_M ? 0 : mass * e / r;
    pull->x += strength * x;
    pull->y += strength * y;
}

/* Adds the effect of the points *next ... of a strip on a point at p, as far as *left units
 * allow. */
static inline void add_row(const cairn_force_kernel *kernel, cairn_vec2 p,
                           const cairn_force_kernel_strip *strip, int32_t *next, int32_t *left,
                           int32_t with_potential, int32_t with_springs,
                           cairn_force_kernel_pull *pull)
{
    cairn_real limit = kernel->limit_squared;
    int32_t j = *next;

    for (; j < strip->count; j++) {
        cairn_real x = strip->position[j].x - p.x, y = strip->position[j].y - p.y,
                   square = x * x + y * y;

        if (!(square <= limit)) /* nor a NaN */
            continue;
        if (*left <= 0)
            break;
        (*left)--;
        add_pair(kernel, x, y, square, strip->mass[j], with_potential, with_springs, pull);
    }
    *next = j;
}

/* Adds the springs of a point of a mass at p relative to the centre. The midpoint of a spring is p
 * + d / 2. */
static void add_springs(cairn_force_kernel_springs *springs, cairn_vec2 p, cairn_real mass,
                        const cairn_force_kernel_pull *pull)
{
    cairn_real k = mass * pull->stiffness, x = mass * pull->spring_x, y = mass * pull->spring_y;
    cairn_real xx = mass * pull->spring_xx, xy = mass * pull->spring_xy,
               yy = mass * pull->spring_yy;

    springs->stiffness += k;
    springs->middle.x += k * p.x + x / 2;
    springs->middle.y += k * p.y + y / 2;
    springs->middle_xx += k * p.x * p.x + p.x * x + xx / 4;
    springs->middle_xy += k * p.x * p.y + (p.x * y + p.y * x) / 2 + xy / 4;
    springs->middle_yy += k * p.y * p.y + p.y * y + yy / 4;
    springs->pull.x += x;
    springs->pull.y += y;
    springs->middle_pull_xx += p.x * x + xx / 2;
    springs->middle_pull_xy += p.x * y + xy / 2;
    springs->middle_pull_yx += p.y * x + xy / 2;
    springs->middle_pull_yy += p.y * y + yy / 2;
}

static int is_outside(const cairn_box *zone, cairn_vec2 p)
{
    return p.x < zone->min.x || p.x > zone->max.x || p.y < zone->min.y || p.y > zone->max.y;
}

static inline cairn_status add_strips(const cairn_force_kernel *kernel,
                                      const cairn_force_kernel_strip *a,
                                      const cairn_force_kernel_strip *b,
                                      cairn_force_kernel_cursor *cursor, int32_t with_potential,
                                      int32_t with_springs, cairn_force_kernel_sum *sum,
                                      cairn_budget *budget)
{
    static const cairn_force_kernel_pull none = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    const int32_t near_cost = 1 + (b->count + COMPARISONS_PER_UNIT - 1) / COMPARISONS_PER_UNIT;
    cairn_vec2 centre = sum->centre, force = sum->force;
    cairn_real torque = sum->torque, potential = sum->potential;
    cairn_force_kernel_pull pull = cursor->pull;
    int32_t left = budget->left, row = cursor->row, next = cursor->next;

    if (left <= 0)
        return row < a->count ? CAIRN_MORE : CAIRN_OK;
    for (; row < a->count; row++) {
        cairn_vec2 p = a->position[row];
        cairn_real mass = a->mass[row];
        int32_t before;

        if (!cursor->is_begun) {
            int outside = is_outside(&b->reach_box, p);
            int32_t cost = (outside ? 1 : near_cost) - cursor->units_charged;

            if (left < cost) {
                cursor->units_charged += left;
                left = 0;
                break;
            }
            left -= cost;
            cursor->units_charged = 0;
            if (outside)
                continue;
            next = 0;
        }
        before = left;
        add_row(kernel, p, b, &next, &left, with_potential, with_springs, &pull);
        sum->pairs += before - left;
        cursor->is_begun = next < b->count;
        if (cursor->is_begun)
            break;
        force.x += mass * pull.x;
        force.y += mass * pull.y;
        torque += mass * ((p.x - centre.x) * pull.y - (p.y - centre.y) * pull.x);
        potential += mass * pull.potential;
        if (with_springs)
            add_springs(sum->springs, cairn_vec2_sub(p, centre), mass, &pull);
        pull = none;
    }
    sum->force = force;
    sum->torque = torque;
    sum->potential = potential;
    cursor->pull = pull;
    cursor->next = next;
    cursor->row = row;
    cairn_budget_spend(budget, budget->left - left);
    return row < a->count ? CAIRN_MORE : CAIRN_OK;
}

cairn_status cairn_force_kernel_strips(const cairn_force_kernel *kernel,
                                       const cairn_force_kernel_strip *a,
                                       const cairn_force_kernel_strip *b,
                                       cairn_force_kernel_cursor *cursor, int32_t with_potential,
                                       cairn_force_kernel_sum *sum, cairn_budget *budget)
{
    if (sum->springs != NULL)
        return add_strips(kernel, a, b, cursor, with_potential, 1, sum, budget);
    return add_strips(kernel, a, b, cursor, with_potential, 0, sum, budget);
}
