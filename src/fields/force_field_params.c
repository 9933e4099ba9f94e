/* Parameters of force field simulation: presets and validation.
 *
 * Source: Adluru 2008, section 7.4.2. */
#include "src/base/build.h"

#include "src/fields/force_field_iteration.h"

enum { MAX_SCANS = 1 << 20, MAX_ITEMS = 1 << 24 };

#define WITH_ROI     CAIRN_WHEN(cairn_force_field_params, roi)
#define WITH_SPRINGS CAIRN_WHEN_IS(cairn_force_field_params, mode, CAIRN_FORCE_FIELD_SPRINGS)

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_force_field_params, field, is, from, to)
#define NUMBER(field, is, from, to)  CAIRN_NUMBER(cairn_force_field_params, field, is, from, to)
#define POSITIVE(field, is, to)      CAIRN_NUMBER_ABOVE(cairn_force_field_params, field, is, 0, to)
#define ROW(field, in_use, kind, is, from, to)                                                     \
    CAIRN_NUMBER_ROW(cairn_force_field_params, field, in_use, CAIRN_PARAMETER_##kind, is, from, to)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(mode, CAIRN_FORCE_FIELD_GRADIENT, CAIRN_FORCE_FIELD_GRADIENT,
            CAIRN_FORCE_FIELD_SPRINGS),
    INTEGER(max_scans, 64, 1, MAX_SCANS),
    INTEGER(max_segments, 1024, 1, MAX_ITEMS),
    INTEGER(max_points, 8192, 1, MAX_ITEMS),
    CAIRN_INTEGER_IF(cairn_force_field_params, max_corners, WITH_ROI, 1024, 1, MAX_ITEMS),
    POSITIVE(sigma_start, CAIRN_REAL(0.15), CAIRN_MAX_MAGNITUDE),
    POSITIVE(sigma_end, CAIRN_REAL(0.04), CAIRN_MAX_MAGNITUDE),
    NUMBER(sigma_step, CAIRN_REAL(0.0025), 0, CAIRN_MAX_MAGNITUDE),
    NUMBER(sigma_factor, 1, 0, 1),
    NUMBER(oriented_below, 0, 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(dt_start, CAIRN_REAL(0.05), CAIRN_MAX_MAGNITUDE),
    POSITIVE(dt_end, CAIRN_REAL(0.01), CAIRN_MAX_MAGNITUDE),
    NUMBER(dt_factor, CAIRN_REAL(0.96), 0, 1),
    POSITIVE(reach, 4, CAIRN_FORCE_KERNEL_MAX_REACH),
    NUMBER(sensor_below, CAIRN_REAL(0.5), 0, CAIRN_MAX_MAGNITUDE),
    INTEGER(roi, CAIRN_FORCE_FIELD_ROI_ENDS, CAIRN_FORCE_FIELD_ROI_NONE,
            CAIRN_FORCE_FIELD_ROI_CROSSINGS),
    ROW(roi_radius, WITH_ROI, NUMBER_ABOVE, CAIRN_REAL(0.05), 0, CAIRN_MAX_MAGNITUDE),
    ROW(roi_mass, WITH_ROI, NUMBER_ABOVE, 4, 0, CAIRN_MAX_MAGNITUDE),
    ROW(corner_distance, WITH_ROI, NUMBER_ABOVE, CAIRN_REAL(0.30), 0, CAIRN_REAL_MAX),
    ROW(corner_min_opening, WITH_ROI, NUMBER_ABOVE, 80 * (CAIRN_PI / 180), 0, CAIRN_PI),
    ROW(corner_max_opening, WITH_ROI, NUMBER_BELOW, 100 * (CAIRN_PI / 180), 0, CAIRN_PI),
    INTEGER(potential, 1, 0, 1),
    INTEGER(max_steps, 50, 1, INT32_MAX),
    NUMBER(stop_relocation, CAIRN_REAL(0.0001), 0, CAIRN_MAX_MAGNITUDE),
    NUMBER(spacing, 0, 0, CAIRN_MAX_MAGNITUDE),
    INTEGER(max_extra, 0, 0, MAX_ITEMS),
    CAIRN_INTEGER_IF(cairn_force_field_params, max_bonds, WITH_SPRINGS, 0, 0, MAX_ITEMS),
    ROW(tangential_stiffness, WITH_SPRINGS, NUMBER, CAIRN_REAL(0.1), 0, 1),
    ROW(damping_sigma, WITH_SPRINGS, NUMBER, CAIRN_REAL(0.35), 0, CAIRN_MAX_MAGNITUDE),
    ROW(alignment_torque, WITH_SPRINGS, NUMBER, 0, 0, CAIRN_MAX_MAGNITUDE),
    ROW(max_relocation, WITH_SPRINGS, NUMBER_ABOVE, CAIRN_REAL(0.3), 0, CAIRN_MAX_MAGNITUDE),
};
const cairn_parameters cairn_force_field_parameters =
    CAIRN_PARAMETERS("force_field", cairn_force_field_params, rows);

cairn_force_field_params cairn_force_field_default(void)
{
    cairn_force_field_params params;

    cairn_parameters_preset(&cairn_force_field_parameters, &params);
    return params;
}

cairn_force_field_params cairn_force_field_as_written(void)
{
    cairn_force_field_params params = cairn_force_field_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.roi = CAIRN_FORCE_FIELD_ROI_CROSSINGS;
    return params;
}

cairn_force_field_params cairn_force_field_spaced(cairn_real spacing)
{
    cairn_force_field_params params = cairn_force_field_default();
    cairn_real factor = cairn_sqrt(spacing / CAIRN_REAL(0.02));

    params.dt_start *= factor;
    params.dt_end *= factor;
    return params;
}

cairn_force_field_params cairn_force_field_springs(cairn_real sigma_start, int32_t steps)
{
    cairn_force_field_params params = cairn_force_field_default();

    params.mode = CAIRN_FORCE_FIELD_SPRINGS;
    params.max_bonds = params.max_scans * (params.max_scans - 1) / 2;
    params.sigma_start = sigma_start;
    params.sigma_end = cairn_min(sigma_start, CAIRN_REAL(0.03));
    params.sigma_step = 0;
    if (steps > 1)
        params.sigma_factor =
            cairn_exp(cairn_log(params.sigma_end / sigma_start) / (cairn_real)(steps - 1));
    params.oriented_below = CAIRN_REAL(0.15);
    /* 1/2 dt^2 is 5, and decreases by the factor 0.7 per iteration to 1. */
    params.dt_start = cairn_sqrt(10);
    params.dt_end = cairn_sqrt(2);
    params.dt_factor = cairn_sqrt(CAIRN_REAL(0.7));
    params.reach = CAIRN_REAL(2.5);
    params.alignment_torque = 40;
    params.roi = CAIRN_FORCE_FIELD_ROI_NONE;
    params.max_steps = steps;
    return params;
}

cairn_status cairn_force_field_check(const cairn_force_field_params *params,
                                     cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_force_field_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->sigma_end <= params->sigma_start, "force_field",
                                          "sigma_end: at most sigma_start", fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->dt_end <= params->dt_start, "force_field",
                                          "dt_end: at most dt_start", fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(
            !params->roi || params->corner_max_opening >= params->corner_min_opening, "force_field",
            "corner_max_opening: at least corner_min_opening", fault);
    return status;
}
