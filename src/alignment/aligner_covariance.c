/* aligner: the datum of the marginal covariances.
 *
 * Method: the system of the joint solution has no origin but the anchor, one fixed scan. Relative to
 * it all scans share the errors of its part of the map, and those of its heading times their
 * distance. The map lies where its scans are in the mean: the covariances are those after the best
 * common motion (minimum-norm datum of a free network). Those relative to the anchor are kept, too:
 * they say which scans are rigid with each other, where no datum makes them observable.
 * 1. The common motion is the least-squares one of the reference scans, a rotation as a length at
 *    ALIGNER_ARM_M. At first these are the scans that their own walls make observable.
 * 2. The covariances of all scans with its three coordinates are solutions of the system, one column
 *    each; with them the inverse's blocks are transformed.
 * 3. Reference scans that are not observable then spoil the datum: groups that are connected along
 *    one direction only. It is found once more, by those that are observable, unless these are less
 *    than .3 of the reference scans: then no group is the map that others could be right in.
 * Source: free networks after Meissl 1962; gauges after Triggs et al. 2000, section 9. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

/* least share of the reference scans that are observable, for a datum of these */
static const cairn_real MIN_REFERENCES = CAIRN_REAL(0.3);

/* Computes the translation of a scan by a unit rotation of the datum; lever[2] is 0. */
static void lever_of(const cairn_aligner *aligner, int32_t i, cairn_real lever[3])
{
    cairn_vec2 centre = aligner->joint.datum.centre;

    lever[0] = centre.y - aligner->poses[i].y;
    lever[1] = aligner->poses[i].x - centre.x;
    lever[2] = 0;
}

/* Returns the weight of the reference scans in a coordinate of the datum. */
static cairn_real weight_of(const aligner_datum *datum, int32_t column)
{
    return column < 2 ? datum->count : datum->squares;
}

/* Sets the centre of the datum to the mean of the reference scans. */
static void find_centre(cairn_aligner *aligner)
{
    aligner_datum *datum = &aligner->joint.datum;

    for (int32_t i = 0; i < aligner->scan_count; i++) {
        if (!aligner->scans[i].is_reference)
            continue;
        datum->count += 1;
        datum->centre.x += (aligner->poses[i].x - datum->centre.x) / datum->count;
        datum->centre.y += (aligner->poses[i].y - datum->centre.y) / datum->count;
    }
}

void cairn_aligner_begin_datum(cairn_aligner *aligner)
{
    aligner_datum *datum = &aligner->joint.datum;
    cairn_real lever[3];

    datum->count = datum->squares = datum->kept = datum->centre.x = datum->centre.y = 0;
    datum->is_spoilt = 0;
    memset(datum->covariance, 0, sizeof datum->covariance);
    find_centre(aligner);
    for (int32_t i = 0; i < aligner->scan_count && datum->count <= 0; i++)
        aligner->scans[i].is_reference = aligner->scans[i].cluster == aligner->move.home;
    if (datum->count <= 0)
        find_centre(aligner);
    for (int32_t i = 0; i < aligner->scan_count; i++) {
        lever_of(aligner, i, lever);
        if (aligner->scans[i].is_reference)
            datum->squares +=
                lever[0] * lever[0] + lever[1] * lever[1] + ALIGNER_ARM_M * ALIGNER_ARM_M;
    }
}

void cairn_aligner_set_column(cairn_aligner *aligner)
{
    const aligner_datum *datum = &aligner->joint.datum;
    cairn_real lever[3];

    memset(aligner->rhs, 0, 3 * (size_t)aligner->node_count * sizeof *aligner->rhs);
    for (int32_t i = 0; i < aligner->scan_count; i++) {
        cairn_real *share = &aligner->rhs[3 * i];

        if (!aligner->scans[i].is_reference)
            continue;
        lever_of(aligner, i, lever);
        lever[2] = ALIGNER_ARM_M * ALIGNER_ARM_M;
        for (int k = 0; k < 3; k++)
            share[k] = (datum->column == 2 ? lever[k] : datum->column == k) /
                       weight_of(datum, datum->column);
        aligner_into_axes(aligner->scans[i].first_axis, share);
    }
}

/* The covariances with the datum are kept in the place of the scans' own until these are read. */
cairn_status cairn_aligner_read_column(cairn_aligner *aligner)
{
    aligner_datum *datum = &aligner->joint.datum;
    cairn_real *sum = &datum->covariance[datum->column], lever[3];
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < aligner->scan_count && status == CAIRN_OK; i++) {
        cairn_real motion[3] = {0, 0, 0};

        status = cairn_block_solver_solution(aligner->solver, i, motion);
        aligner_out_of_axes(aligner->scans[i].first_axis, motion);
        for (int k = 0; k < 3; k++)
            aligner->results[i].covariance[3 * k + datum->column] = motion[k];
        if (!aligner->scans[i].is_reference)
            continue;
        lever_of(aligner, i, lever);
        sum[0] += motion[0];
        sum[3] += motion[1];
        sum[6] +=
            lever[0] * motion[0] + lever[1] * motion[1] + ALIGNER_ARM_M * ALIGNER_ARM_M * motion[2];
    }
    for (int32_t k = 0; k < 3; k++)
        sum[3 * k] /= weight_of(datum, k);
    return status;
}

/* Writes a rotated covariance. */
static void write_rotated(cairn_real sine, cairn_real cosine, const cairn_real m[9],
                          cairn_real out[9])
{
    cairn_sym3_to_full(cairn_sym3_rotate(cairn_sym3_of_full(m), sine, cosine), out);
}

/* Computes the covariance m of a scan after the common motion from that relative to the anchor, a:
 * m = a - G Z^T - Z G^T + G V G^T, G its motions by those of the datum, Z its covariance with the
 * datum, V that of the datum. */
static void relate_to_datum(const cairn_aligner *aligner, int32_t i, const cairn_real a[9],
                            cairn_real m[9])
{
    const cairn_real *v = aligner->joint.datum.covariance, *z = aligner->results[i].covariance;
    cairn_real lever[3], half[9];

    lever_of(aligner, i, lever);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            half[3 * r + c] = z[3 * r + c] - (v[3 * r + c] + lever[r] * v[6 + c]) / 2;
    memcpy(m, a, 9 * sizeof *m);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            cairn_real common = half[3 * r + c] + lever[c] * half[3 * r + 2];

            m[3 * r + c] -= common;
            m[3 * c + r] -= common;
        }
    for (int k = 0; k < 9; k += 4)
        m[k] = cairn_max(m[k], 0);
}

/* Computes the covariances of a scan of the largest cluster in the axes of the cluster: relative to
 * the anchor, and after the common motion. */
static void covariances_of(const cairn_aligner *aligner, int32_t i, cairn_real to_anchor[9],
                           cairn_real covariance[9])
{
    cairn_vec2 axis = aligner->scans[i].first_axis;
    cairn_real block[9] = {0};

    cairn_must_be_ok(cairn_block_solver_covariance(aligner->solver, i, i, block));
    write_rotated(axis.y, axis.x, block, to_anchor);
    relate_to_datum(aligner, i, to_anchor, covariance);
}

int cairn_aligner_is_observable(const cairn_aligner *aligner, const cairn_real covariance[9],
                                cairn_real sigmas)
{
    return sigmas * cairn_sqrt(covariance[0] + covariance[4]) < aligner->params.observable_sigma &&
           cairn_sqrt(covariance[8]) < aligner->params.observable_sigma_theta;
}

void cairn_aligner_choose_reference(cairn_aligner *aligner, int32_t i)
{
    aligner_datum *datum = &aligner->joint.datum;
    aligner_scan *scan = &aligner->scans[i];
    cairn_real to_anchor[9], covariance[9];
    int was_reference = scan->is_reference;

    if (scan->cluster != aligner->move.home)
        return;
    covariances_of(aligner, i, to_anchor, covariance);
    scan->is_reference = cairn_aligner_is_observable(aligner, covariance, 1);
    datum->is_spoilt |= was_reference && !scan->is_reference;
    datum->kept += (cairn_real)scan->is_reference;
}

int cairn_aligner_is_datum_spoilt(const cairn_aligner *aligner)
{
    const aligner_datum *datum = &aligner->joint.datum;

    return datum->is_spoilt && datum->kept >= MIN_REFERENCES * datum->count;
}

void cairn_aligner_set_initial_covariances(cairn_aligner_pose *pose, cairn_real variance,
                                           cairn_real turn)
{
    memset(pose->covariance, 0, sizeof pose->covariance);
    pose->covariance[0] = pose->covariance[4] = variance;
    pose->covariance[8] = turn;
    memcpy(pose->anchor_covariance, pose->covariance, sizeof pose->covariance);
}

void cairn_aligner_write_covariances(cairn_aligner *aligner, int32_t i)
{
    cairn_transform gauge = aligner->joint.gauge;
    cairn_aligner_pose *r = &aligner->results[i];
    cairn_real to_anchor[9], own[9];

    if (aligner->scans[i].cluster == aligner->move.home && aligner->result.anchor >= 0) {
        covariances_of(aligner, i, to_anchor, own);
        write_rotated(gauge.sine, gauge.cosine, to_anchor, r->anchor_covariance);
        write_rotated(gauge.sine, gauge.cosine, own, r->covariance);
        return;
    }
    cairn_aligner_set_initial_covariances(r, 2 * aligner->sigma * aligner->sigma,
                                          2 * aligner->sigma_angle * aligner->sigma_angle);
}
