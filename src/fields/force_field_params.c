/* Parameters of force field simulation: presets and validation.
 *
 * Source: Adluru 2008, section 7.4.2. */
#include "src/base/build.h"

#include <stddef.h>
#include <string.h>

#include "src/fields/force_field_iteration.h"

enum { MAX_CORNERS = 1 << 24, MAX_EXTRA = 1 << 24, MAX_BONDS = 1 << 24 };

/* maximum value of a parameter */
#define MAX_VALUE CAIRN_REAL(1e6)

cairn_force_field_params cairn_force_field_default(void)
{
    cairn_force_field_params params = {
        .mode = CAIRN_FORCE_FIELD_GRADIENT,
        .max_scans = 64,
        .max_segments = 1024,
        .max_points = 8192,
        .max_corners = 1024,
        .sigma_start = CAIRN_REAL(0.15),
        .sigma_end = CAIRN_REAL(0.04),
        .sigma_step = CAIRN_REAL(0.0025),
        .sigma_factor = 1,
        .oriented_below = 0,
        .dt_start = CAIRN_REAL(0.05),
        .dt_end = CAIRN_REAL(0.01),
        .dt_factor = CAIRN_REAL(0.96),
        .reach = 4,
        .sensor_below = CAIRN_REAL(0.5),
        .roi = CAIRN_FORCE_FIELD_ROI_ENDS,
        .roi_radius = CAIRN_REAL(0.05),
        .roi_mass = 4,
        .corner_distance = CAIRN_REAL(0.30),
        .corner_min_opening = 80 * (CAIRN_PI / 180),
        .corner_max_opening = 100 * (CAIRN_PI / 180),
        .potential = 1,
        .max_steps = 50,
        .stop_relocation = CAIRN_REAL(0.0001),
        .spacing = 0,
        .max_extra = 0,
        .max_bonds = 0,
        .tangential_stiffness = CAIRN_REAL(0.1),
        .damping_sigma = CAIRN_REAL(0.35),
        .alignment_torque = 0,
        .max_relocation = CAIRN_REAL(0.3),
    };
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

/* Conditions of a value besides 0 ... MAX_VALUE, and the modes in which it is validated. */
enum { IS_POSITIVE = 1, IN_UNIT_INTERVAL = 2, WITH_ROI = 4, WITH_SPRINGS = 8 };

/* A table: separate comparisons take three times the code size. */
#define OFFSET_OF(field) (uint16_t) offsetof(cairn_force_field_params, field)
static const struct {
    uint16_t at, conditions;
} ranges[] = {
    {OFFSET_OF(sigma_start), IS_POSITIVE},
    {OFFSET_OF(sigma_end), IS_POSITIVE},
    {OFFSET_OF(sigma_step), 0},
    {OFFSET_OF(sigma_factor), IN_UNIT_INTERVAL},
    {OFFSET_OF(oriented_below), 0},
    {OFFSET_OF(dt_start), IS_POSITIVE},
    {OFFSET_OF(dt_end), IS_POSITIVE},
    {OFFSET_OF(dt_factor), IN_UNIT_INTERVAL},
    {OFFSET_OF(reach), IS_POSITIVE},
    {OFFSET_OF(sensor_below), 0},
    {OFFSET_OF(stop_relocation), 0},
    {OFFSET_OF(spacing), 0},
    {OFFSET_OF(roi_radius), WITH_ROI | IS_POSITIVE},
    {OFFSET_OF(roi_mass), WITH_ROI | IS_POSITIVE},
    {OFFSET_OF(tangential_stiffness), WITH_SPRINGS | IN_UNIT_INTERVAL},
    {OFFSET_OF(damping_sigma), WITH_SPRINGS},
    {OFFSET_OF(alignment_torque), WITH_SPRINGS},
    {OFFSET_OF(max_relocation), WITH_SPRINGS | IS_POSITIVE},
};

static int are_in_range(const cairn_force_field_params *params)
{
    int32_t unused = (params->roi ? 0 : WITH_ROI) |
                     (params->mode == CAIRN_FORCE_FIELD_SPRINGS ? 0 : WITH_SPRINGS);

    for (size_t i = 0; i < sizeof ranges / sizeof *ranges; i++) {
        int32_t conditions = ranges[i].conditions;
        cairn_real value, most = conditions & IN_UNIT_INTERVAL ? 1 : MAX_VALUE;

        memcpy(&value, (const unsigned char *)params + ranges[i].at, sizeof value);
        if (!(conditions & unused) &&
            !((conditions & IS_POSITIVE ? value > 0 : value >= 0) && value <= most))
            return 0;
    }
    return 1;
}

int32_t cairn_force_field_params_are_valid(const cairn_force_field_params *params)
{
    return params != NULL && params->mode >= CAIRN_FORCE_FIELD_GRADIENT &&
           params->mode <= CAIRN_FORCE_FIELD_SPRINGS && are_in_range(params) &&
           params->sigma_end <= params->sigma_start && params->dt_end <= params->dt_start &&
           params->reach <= CAIRN_FORCE_KERNEL_MAX_REACH &&
           (!params->roi || params->max_corners <= MAX_CORNERS) && params->max_steps >= 1 &&
           params->max_extra >= 0 && params->max_extra <= MAX_EXTRA &&
           (params->mode == CAIRN_FORCE_FIELD_GRADIENT ||
            (params->max_bonds >= 0 && params->max_bonds <= MAX_BONDS));
}
