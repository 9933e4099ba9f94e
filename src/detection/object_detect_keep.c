/* The detection of a candidate or of a hypothesis: its scores by parts, its appearance, and whether it
 * is kept. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/detection/object_detect_object.h"

void cairn_object_detect_set_part_scores(const object_detect_hypothesis *hypothesis,
                                         cairn_object_detection *detection)
{
    detection->score = hypothesis->score;
    detection->shape_distance = hypothesis->distance;
    detection->configuration_score = hypothesis->agreement;
    detection->first_part = hypothesis->first_part;
    detection->part_count = hypothesis->part_count;
}

/* Starts to score the appearance of a detection's box. */
static cairn_status begin_appearance(const cairn_object_detector *detector,
                                     const cairn_object_detection *detection)
{
    const cairn_real box[4] = {detection->left, detection->top, detection->right,
                               detection->bottom};

    return cairn_appearance_begin_box(detector->params.appearance, box);
}

/* Adds the appearance term (Adluru 2008, eq. 5.1; with 1 - probability as the distance of appearance,
 * as written that of the nearest histogram). */
static void add_appearance(const cairn_object_detect_params *params,
                           cairn_object_detection *detection)
{
    cairn_appearance_result look = cairn_appearance_read(params->appearance);

    detection->appearance = params->appearance_nearest ? 1 - look.distance : look.probability;
    detection->score -= params->appearance_weight * (1 - detection->appearance);
}

int cairn_object_detect_keep_step(cairn_object_detector *detector, cairn_budget *budget)
{
    const cairn_object_detect_params *params = &detector->params;
    cairn_object_detection *detection = cairn_object_detect_current(detector);

    CAIRN_STEP_BEGIN(detector->appearance_resume);
    if (params->appearance != NULL) {
        detector->status = begin_appearance(detector, detection);
        CAIRN_STEP_UNTIL(detector->appearance_resume, detector->status == CAIRN_OK);
        CAIRN_STEP_UNTIL(detector->appearance_resume,
                         (detector->status = cairn_appearance_step(params->appearance, budget)) ==
                             CAIRN_OK);
    }
    detector->result.count += detection->score >= params->min_score;
    if (params->appearance != NULL)
        add_appearance(params, detection);
    CAIRN_STEP_END(detector->appearance_resume);
}
