/* Drives through an apartment and back: sweeps of 241 beams over 240 degrees with drifting
 * odometry, mapped in external RAM, with a capacity of a third of the keyframes of one way
 * (keyframe culling). */
#include "src/base/build.h"

#include "apartment_scans.h"
#include "firmware/survey.h"

enum { KEYFRAMES = 64, BEAMS = 241 };

static SURVEY_EXTERNAL _Alignas(CAIRN_ALIGN) unsigned char memory[1536 * 1024];

void survey_read(survey *out)
{
    static const survey apartment = {.name = "apartment",
                                     .laps = 3,
                                     .noise = 0.01f,
                                     .slip = 0.05f,
                                     .arrival = 250,
                                     .budget = 1000};

    *out = apartment;
    out->sweeps = recorded;
    out->sweep_count = (int32_t)(sizeof recorded / sizeof *recorded);
    out->memory = memory;
    out->bytes = sizeof memory;
    out->params.range_max = 8;
    out->params.range_sigma = 0.01f;
    out->params.mapper = cairn_mapper_default_for(KEYFRAMES, BEAMS);
    out->params.mapper.cull_keyframes = 1;
}
