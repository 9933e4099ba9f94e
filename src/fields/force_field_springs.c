/* Joint motion of all scans in a force field: a sparse linear system of springs.
 *
 * Method.
 *
 * 1. A pair of points is a spring of stiffness force / distance. Near an optimum that is the second
 *    derivative of its potential normal to the lines, up to a factor. Tangential to the lines a
 *    spring has only a share of its stiffness, since the sampling along a line is arbitrary
 *    (point-to-line weighting).
 * 2. The springs between two scans add up to a bond: a stiffness against relative motions, and a
 *    wrench. A motion is (x, y, rotation) about the centre of its scan, the rotation linearized.
 * 3. The equilibrium of all bonds is a sparse symmetric system in the motions of all scans. It is
 *    solved by conjugate gradients with a block Jacobi preconditioner (inverses of the 3 x 3
 *    diagonal blocks). If each scan moved alone, errors shared by many scans, like a bend, would
 *    take very many iterations.
 * 4. Damping: a thousandth of a scan's own stiffness against translations and rotations makes the
 *    system positive definite. While sigma is large, a multiple of it acts against translations of
 *    the sensor.
 *
 * Layout: bonds in the order of the sweep; those of a scan with earlier ones form a linked list.
 *
 * Limits: 48 iterations of the solver, fewer when the residual has fallen to 1e-4 in the
 * preconditioned norm. The remaining error is reduced in the next iteration of the field.
 *
 * Source: in place of Adluru 2008, eqs. 7.6 and 7.7, using the freedom of section 7.3.4: masses in
 * the motion may differ from those in the forces. Hestenes and Stiefel 1952 for the solver. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/force_field_iteration.h"

enum { MAX_ITERATIONS = 48, BONDS_PER_UNIT = 8 };

/* reduction of the squared residual at which the solver stops, and the share of its stiffness that
 * damps a scan */
#define CONVERGED_RATIO CAIRN_REAL(1e-8)
#define DAMPING_SHARE   CAIRN_REAL(0.001)

/* ---- Bonds ---- */

void cairn_force_field_remove_springs(cairn_force_field *field, int32_t scan)
{
    struct cairn_force_field_unknown *unknown = &field->unknowns[scan];

    memset(unknown, 0, sizeof *unknown);
    unknown->last_bond = -1;
}

int32_t cairn_force_field_add_springs_cost(const cairn_force_field *field)
{
    return 3 + field->unknowns[field->pair.line[1].scan].bond_count / BONDS_PER_UNIT;
}

/* Returns the bond of the two current scans; NULL without capacity. */
static struct cairn_force_field_bond *find_bond(cairn_force_field *field, int32_t first,
                                                int32_t second)
{
    struct cairn_force_field_unknown *unknown = &field->unknowns[second];
    struct cairn_force_field_bond *bond;

    for (int32_t i = unknown->last_bond; i >= 0; i = field->bonds[i].next)
        if (field->bonds[i].first == first)
            return &field->bonds[i];
    if (field->bond_count == field->params.max_bonds)
        return NULL;
    bond = &field->bonds[field->bond_count];
    memset(bond, 0, sizeof *bond);
    bond->first = first;
    bond->second = second;
    bond->next = unknown->last_bond;
    unknown->last_bond = field->bond_count++;
    unknown->bond_count++;
    return bond;
}

/* Returns the 2 x 2 stiffness of unit springs between lines of these directions: 1 normal to a line
 * and `slide` tangential to it. */
static cairn_sym2 stiffness_shape(cairn_vec2 a, cairn_vec2 b, cairn_real slide)
{
    cairn_sym2 shape;

    shape.xx = 2 * slide + (1 - slide) * (a.y * a.y + b.y * b.y);
    shape.xy = -(1 - slide) * (a.x * a.y + b.x * b.y);
    shape.yy = 2 * slide + (1 - slide) * (a.x * a.x + b.x * b.x);
    return shape;
}

static cairn_vec2 times(cairn_sym2 m, cairn_vec2 v)
{
    cairn_vec2 product = {m.xx * v.x + m.xy * v.y, m.xy * v.x + m.yy * v.y};

    return product;
}

/* Adds the torque that aligns the two lines: P(g) also falls with the angle between them, which eq.
 * 7.7 neglects. */
static void add_twist(const cairn_force_field *field, struct cairn_force_field_bond *bond)
{
    const struct cairn_force_field_pair *pair = &field->pair;
    cairn_vec2 a = pair->line[0].direction, b = pair->line[1].direction;
    cairn_real cosine = cairn_vec2_dot(a, b);
    cairn_real torque = field->params.alignment_torque / 2 * pair->sum.potential /
                        field->kernel.norm * (cosine * cosine);

    bond->stiffness.zz += torque * (cosine * cosine);
    bond->wrench[2] += torque * (cosine * cairn_vec2_cross(a, b));
}

void cairn_force_field_add_springs(cairn_force_field *field)
{
    const struct cairn_force_field_pair *pair = &field->pair;
    const cairn_force_kernel_springs *s = &pair->springs;
    cairn_sym2 shape = stiffness_shape(pair->line[0].direction, pair->line[1].direction,
                                       field->params.tangential_stiffness);
    struct cairn_force_field_bond *bond = find_bond(field, pair->line[0].scan, pair->line[1].scan);
    cairn_real weight = pair->cosine;
    cairn_vec2 arm, pull;

    if (bond == NULL) {
        field->bonds_dropped++;
        return;
    }
    /* A rotation moves the midpoint c of a spring by (-c.y, c.x). */
    arm = times(shape, cairn_vec2_left_perp(s->middle));
    pull = times(shape, s->pull);
    bond->stiffness.xx += weight * shape.xx * s->stiffness;
    bond->stiffness.xy += weight * shape.xy * s->stiffness;
    bond->stiffness.yy += weight * shape.yy * s->stiffness;
    bond->stiffness.xz += weight * arm.x;
    bond->stiffness.yz += weight * arm.y;
    bond->stiffness.zz +=
        weight * (shape.xx * s->middle_yy - 2 * shape.xy * s->middle_xy + shape.yy * s->middle_xx);
    bond->wrench[0] += weight * pull.x;
    bond->wrench[1] += weight * pull.y;
    bond->wrench[2] += weight * (shape.xy * s->middle_pull_xx + shape.yy * s->middle_pull_xy -
                                 shape.xx * s->middle_pull_yx - shape.xy * s->middle_pull_yy);
    add_twist(field, bond);
}

/* ---- Linear system ---- */

/* Returns the lever arm of a scan's centre about the bond's centre: a rotation about its own centre
 * is the translation rotation * arm, plus the rotation. */
static cairn_vec2 lever_arm(const cairn_force_field *field,
                            const struct cairn_force_field_bond *bond)
{
    cairn_vec2 centre = field->bodies[bond->second].centre;

    return cairn_vec2_left_perp(cairn_vec2_sub(centre, field->bodies[bond->first].centre));
}

static cairn_real dot(const cairn_real a[3], const cairn_real b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* product = m v. One function for three uses, which takes less code than three inline products. */
static void multiply(const cairn_sym3 *m, const cairn_real v[3], cairn_real product[3])
{
    cairn_sym3_times(*m, v, product);
}

/* Returns the stiffness of a bond about another centre. */
static cairn_sym3 shift_stiffness(cairn_sym3 m, cairn_vec2 arm)
{
    cairn_sym3 shifted_stiffness = m;

    shifted_stiffness.xz = m.xz + m.xx * arm.x + m.xy * arm.y;
    shifted_stiffness.yz = m.yz + m.xy * arm.x + m.yy * arm.y;
    shifted_stiffness.zz =
        m.zz + (m.xz + shifted_stiffness.xz) * arm.x + (m.yz + shifted_stiffness.yz) * arm.y;
    return shifted_stiffness;
}

/* Distributes a wrench about the centre of a bond to its two scans. */
static void scatter_force(const cairn_force_field *field, const struct cairn_force_field_bond *bond,
                          const cairn_real force[3], cairn_real first[3], cairn_real second[3])
{
    if (first != NULL) {
        cairn_vec2 arm = lever_arm(field, bond);

        first[0] += force[0];
        first[1] += force[1];
        first[2] += force[2] + arm.x * force[0] + arm.y * force[1];
    }
    for (int32_t i = 0; i < 3; i++)
        second[i] -= force[i];
}

static struct cairn_force_field_unknown *first_of(const cairn_force_field *field,
                                                  const struct cairn_force_field_bond *bond)
{
    return bond->first == FORCE_FIELD_NO_SCAN ? NULL : &field->unknowns[bond->first];
}

static void assemble(cairn_force_field *field, const struct cairn_force_field_bond *bond)
{
    struct cairn_force_field_unknown *first = first_of(field, bond),
                                     *second = &field->unknowns[bond->second];

    second->diagonal = cairn_sym3_add(second->diagonal, bond->stiffness);
    if (first != NULL) {
        cairn_sym3 shifted_stiffness = shift_stiffness(bond->stiffness, lever_arm(field, bond));

        first->diagonal = cairn_sym3_add(first->diagonal, shifted_stiffness);
    }
    scatter_force(field, bond, bond->wrench, first == NULL ? NULL : first->residual,
                  second->residual);
}

/* Adds a bond's part of the matrix-vector product A direction. */
static void add_product(cairn_force_field *field, const struct cairn_force_field_bond *bond)
{
    struct cairn_force_field_unknown *first = first_of(field, bond),
                                     *second = &field->unknowns[bond->second];
    cairn_real relative_motion[3], force[3];

    for (int32_t i = 0; i < 3; i++)
        relative_motion[i] = -second->direction[i];
    if (first != NULL) {
        cairn_vec2 arm = lever_arm(field, bond);

        relative_motion[0] += first->direction[0] + arm.x * first->direction[2];
        relative_motion[1] += first->direction[1] + arm.y * first->direction[2];
        relative_motion[2] += first->direction[2];
    }
    multiply(&bond->stiffness, relative_motion, force);
    scatter_force(field, bond, force, first == NULL ? NULL : first->product, second->product);
}

/* ---- Conjugate gradients ---- */

/* Starts the product A direction of a scan with its damping. */
static void begin_product(struct cairn_force_field_unknown *unknown)
{
    for (int32_t i = 0; i < 3; i++)
        unknown->product[i] = unknown->damping[i] * unknown->direction[i];
}

/* Prepares the unknown of a scan. A fixed scan, or one without stiffness, stays at its pose. */
static void prepare_unknown(cairn_force_field *field, int32_t index)
{
    const struct cairn_force_field_body *body = &field->bodies[index];
    struct cairn_force_field_unknown *unknown = &field->unknowns[index];
    cairn_real shift = unknown->diagonal.xx + unknown->diagonal.yy, damping_ratio = 0;
    cairn_sym3 inverse = cairn_sym3_zero();

    if (field->params.damping_sigma > 0)
        damping_ratio = field->sigma / field->params.damping_sigma;
    unknown->damping[0] = unknown->damping[1] =
        (DAMPING_SHARE + damping_ratio * damping_ratio * damping_ratio) * shift;
    unknown->damping[2] = DAMPING_SHARE * shift * field->set->scans[index].sensor_spread;
    unknown->diagonal.xx += unknown->damping[0];
    unknown->diagonal.yy += unknown->damping[1];
    unknown->diagonal.zz += unknown->damping[2];
    if (!body->is_fixed)
        (void)cairn_sym3_inverse(unknown->diagonal, &inverse);
    unknown->diagonal = inverse;
    multiply(&unknown->diagonal, unknown->residual, unknown->direction);
    field->solver.residual2 += dot(unknown->residual, unknown->direction);
    begin_product(unknown);
}

/* Moves a scan along the direction by the step length; updates and preconditions the residual. */
static void update_motion(cairn_force_field *field, struct cairn_force_field_unknown *unknown)
{
    struct cairn_force_field_solver *solver = &field->solver;
    cairn_real step_length = solver->residual2 / solver->curvature;

    for (int32_t i = 0; i < 3; i++) {
        unknown->motion[i] += step_length * unknown->direction[i];
        unknown->residual[i] -= step_length * unknown->product[i];
    }
    multiply(&unknown->diagonal, unknown->residual, unknown->product);
    solver->next_residual2 += dot(unknown->residual, unknown->product);
}

/* Computes the next conjugate direction (Fletcher-Reeves). */
static void update_direction(cairn_force_field *field, struct cairn_force_field_unknown *unknown)
{
    cairn_real beta = field->solver.next_residual2 / field->solver.residual2;

    for (int32_t i = 0; i < 3; i++)
        unknown->direction[i] = unknown->product[i] + beta * unknown->direction[i];
    begin_product(unknown);
}

/* Adds a scan's part of direction^T A direction. */
static void add_curvature(cairn_force_field *field, const struct cairn_force_field_unknown *unknown)
{
    field->solver.curvature += dot(unknown->direction, unknown->product);
}

int cairn_force_field_solve(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    memset(&field->solver, 0, sizeof field->solver);
    for (field->solver.item = 0; field->solver.item < field->bond_count; field->solver.item++) {
        CAIRN_STEP_CHARGE(field, phase_resume, budget, 3);
        assemble(field, &field->bonds[field->solver.item]);
    }
    for (field->solver.item = 0; field->solver.item < field->slots; field->solver.item++) {
        CAIRN_STEP_CHARGE(field, phase_resume, budget, 3);
        prepare_unknown(field, field->solver.item);
    }
    field->solver.min_residual2 = CONVERGED_RATIO * field->solver.residual2;
    while (field->solver.residual2 > 0) {
        for (field->solver.item = 0; field->solver.item < field->bond_count; field->solver.item++) {
            CAIRN_STEP_CHARGE(field, phase_resume, budget, 1);
            add_product(field, &field->bonds[field->solver.item]);
        }
        field->solver.curvature = 0;
        for (field->solver.item = 0; field->solver.item < field->slots; field->solver.item++) {
            CAIRN_STEP_CHARGE(field, phase_resume, budget, 1);
            add_curvature(field, &field->unknowns[field->solver.item]);
        }
        if (!(field->solver.curvature > 0))
            break;
        field->solver.next_residual2 = 0;
        for (field->solver.item = 0; field->solver.item < field->slots; field->solver.item++) {
            CAIRN_STEP_CHARGE(field, phase_resume, budget, 1);
            update_motion(field, &field->unknowns[field->solver.item]);
        }
        if (++field->solver.iteration == MAX_ITERATIONS ||
            !(field->solver.next_residual2 > field->solver.min_residual2))
            break;
        for (field->solver.item = 0; field->solver.item < field->slots; field->solver.item++) {
            CAIRN_STEP_CHARGE(field, phase_resume, budget, 1);
            update_direction(field, &field->unknowns[field->solver.item]);
        }
        field->solver.residual2 = field->solver.next_residual2;
    }
    CAIRN_STEP_END(field->phase_resume);
}
