/* Evaluation of a bag-of-visual-words classifier.
 *
 * Method:
 * 1. Each patch of an image gets the nearest word of the dictionary.
 * 2. The histogram of a box counts the words of the patches centred in it.
 * 3. The decision function is a sum over the support vectors, whose kernel falls with the
 *    chi-squared distance of the histograms. Platt scaling makes it a probability. In the same
 *    pass the nearest positive support vector is found.
 *
 * Memory layout: the field; centre and word of each patch; one histogram.
 *
 * Limits: one box at a time.
 *
 * Source: Adluru 2008, section 5.3.2, which leaves patches and kernel open. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/appearance.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Descriptor components between two tests whether a word can still be the nearest. */
enum { EARLY_EXIT_STEP = 32 };
enum { UNITS_PER_WORD = 3, PATCHES_PER_UNIT = 32, WORDS_PER_UNIT = 8 };

/* Probability of a box without a patch. */
static const cairn_real UNKNOWN_PROBABILITY = CAIRN_REAL(0.5);
/* Greatest chi-squared distance of two normalized histograms. */
static const cairn_real MAX_CHI2 = 2;
/* Greatest argument of the logistic function, whose exponential is finite. */
static const cairn_real MAX_EXPONENT = CAIRN_REAL_MAX > CAIRN_REAL(1e38) * 10 ? CAIRN_REAL(700.0)
                                                                              : CAIRN_REAL(87.0);

/* State of a field: its image is worked on, ready, a box is worked on, scored. */
enum { STATE_EMPTY, STATE_WORDS, STATE_READY, STATE_BOX, STATE_SCORED };

struct cairn_appearance_field {
    cairn_appearance_params params;
    const cairn_appearance_model *model;
    const uint8_t *descriptors;
    cairn_vec2 *centres; /* [max_patches] px */
    int32_t *words;      /* [max_patches] word of each patch */
    float *histogram;    /* [max_words] of the box */
    int32_t count;       /* patches */
    int32_t state, resume, cursor, units_charged;
    cairn_real box[4];
    cairn_real decision; /* sum over the support vectors so far */
    cairn_real smallest; /* chi-squared distance to the nearest positive support vector so far */
    cairn_appearance_result result;
};

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_appearance_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_patches, 6500, 1, CAIRN_APPEARANCE_MAX_PATCHES),
    INTEGER(max_words, 100, 2, CAIRN_APPEARANCE_MAX_WORDS),
};
extern const cairn_parameters cairn_appearance_parameters;
const cairn_parameters cairn_appearance_parameters =
    CAIRN_PARAMETERS("appearance", cairn_appearance_params, rows);

cairn_appearance_params cairn_appearance_default(void)
{
    cairn_appearance_params params;

    cairn_parameters_preset(&cairn_appearance_parameters, &params);
    return params;
}

cairn_status cairn_appearance_check(const cairn_appearance_params *params,
                                    cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_appearance_parameters, params, fault);
}

static cairn_appearance_result unknown_result(void)
{
    cairn_appearance_result result = {0, UNKNOWN_PROBABILITY, 1};

    return result;
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_appearance_field *build(cairn_pool *pool, const cairn_appearance_params *params)
{
    cairn_appearance_field *field = cairn_object_take(pool, sizeof *field);

    CAIRN_TAKE(field, pool, centres, params->max_patches);
    CAIRN_TAKE(field, pool, words, params->max_patches);
    CAIRN_TAKE(field, pool, histogram, params->max_words);
    if (field != NULL) {
        field->params = *params;
        field->result = unknown_result();
    }
    return field;
}

CAIRN_OBJECT(appearance, appearance_field, build);

/* ---- The model ---- */

static int sizes_are_valid(const cairn_appearance_model *model)
{
    return model != NULL && model->word_count >= 2 &&
           model->word_count <= CAIRN_APPEARANCE_MAX_WORDS && model->support_count >= 1 &&
           model->support_count <= CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS && model->words != NULL &&
           model->histograms != NULL && model->weights != NULL;
}

static const float *support_histogram(const cairn_appearance_model *model, int32_t index)
{
    return &model->histograms[(size_t)index * (size_t)model->word_count];
}

static int shares_are_valid(const float *histogram, int32_t count)
{
    int ok = 1;

    for (int32_t i = 0; i < count; i++)
        ok &= histogram[i] >= 0 && histogram[i] <= 1;
    return ok;
}

cairn_status cairn_appearance_model_check(const cairn_appearance_model *model, cairn_fault *fault)
{
    if (!sizes_are_valid(model))
        return cairn_refuse(fault, -1,
                            "a model without words or support vectors, or with too many, expected "
                            "2 to 1000 words and 1 to 20000 support vectors",
                            CAIRN_BAD_ARGUMENT);
    if (!cairn_is_finite(model->gamma) || !cairn_is_finite(model->rho) ||
        !cairn_is_finite(model->platt_slope) || !cairn_is_finite(model->platt_offset))
        return cairn_refuse(fault, -1, "a machine that is not finite, expected finite numbers",
                            CAIRN_NOT_FINITE);
    if (!(model->gamma > 0))
        return cairn_refuse(fault, -1, "a kernel width gamma of 0 or less, expected more than 0",
                            CAIRN_BAD_ARGUMENT);
    for (int32_t i = 0; i < model->support_count; i++) {
        if (!cairn_is_finite(model->weights[i]))
            return cairn_refuse(fault, i, "a weight that is not finite, expected a finite one",
                                CAIRN_NOT_FINITE);
        if (!shares_are_valid(support_histogram(model, i), model->word_count))
            return cairn_refuse(fault, i, "a share of a histogram, expected 0 to 1",
                                CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

int32_t cairn_appearance_nearest_word(const uint8_t *words, int32_t count,
                                      const uint8_t *descriptor, int32_t *distance)
{
    int32_t best = 0, smallest = INT32_MAX;

    for (int32_t i = 0; i < count; i++) {
        const uint8_t *word = &words[(size_t)i * CAIRN_APPEARANCE_DESCRIPTOR_SIZE];
        int32_t sum = 0;

        /* Early exit: stops when the partial sum exceeds the least distance. */
        for (int32_t from = 0; from < CAIRN_APPEARANCE_DESCRIPTOR_SIZE && sum < smallest;
             from += EARLY_EXIT_STEP)
            for (int32_t k = from; k < from + EARLY_EXIT_STEP; k++)
                sum += (word[k] - descriptor[k]) * (word[k] - descriptor[k]);
        if (sum < smallest) {
            smallest = sum;
            best = i;
        }
    }
    if (distance != NULL)
        *distance = smallest;
    return best;
}

void cairn_appearance_normalize(float *histogram, int32_t count)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < count; i++)
        sum += (cairn_real)histogram[i];
    for (int32_t i = 0; i < count && sum > 0; i++)
        histogram[i] = (float)((cairn_real)histogram[i] / sum);
}

cairn_real cairn_appearance_chi2(const float *a, const float *b, int32_t count)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_real d = (cairn_real)a[i] - (cairn_real)b[i], s = (cairn_real)a[i] + (cairn_real)b[i];

        sum += s > 0 ? d * d / s : 0;
    }
    return sum;
}

/* Kernel value of a chi-squared distance, times the weight of the support vector. */
static cairn_real support_term(const cairn_appearance_model *model, int32_t index, cairn_real chi2)
{
    return model->weights[index] * cairn_exp(-model->gamma * chi2);
}

static cairn_real probability_of(const cairn_appearance_model *model, cairn_real decision)
{
    return 1 / (1 + cairn_exp(cairn_min(MAX_EXPONENT,
                                        model->platt_slope * decision + model->platt_offset)));
}

cairn_real cairn_appearance_decision(const cairn_appearance_model *model, const float *histogram)
{
    cairn_real sum = -model->rho;

    for (int32_t i = 0; i < model->support_count; i++)
        sum += support_term(
            model, i,
            cairn_appearance_chi2(support_histogram(model, i), histogram, model->word_count));
    return sum;
}

cairn_real cairn_appearance_histogram_probability(const cairn_appearance_model *model,
                                                  const float *histogram)
{
    return probability_of(model, cairn_appearance_decision(model, histogram));
}

/* ---- An image ---- */

cairn_status cairn_appearance_begin(cairn_appearance_field *field,
                                    const cairn_appearance_model *model,
                                    const cairn_appearance_patches *patches)
{
    if (field == NULL || patches == NULL || patches->count < 0 || !sizes_are_valid(model) ||
        (patches->count > 0 && (patches->centres == NULL || patches->descriptors == NULL)))
        return CAIRN_BAD_ARGUMENT;
    if (patches->count > field->params.max_patches || model->word_count > field->params.max_words)
        return CAIRN_FULL;
    for (int32_t i = 0; i < patches->count; i++)
        if (!cairn_is_finite(patches->centres[i].x) || !cairn_is_finite(patches->centres[i].y))
            return CAIRN_NOT_FINITE;
    field->model = model;
    field->descriptors = patches->descriptors;
    field->count = patches->count;
    if (patches->count > 0)
        memcpy(field->centres, patches->centres, (size_t)patches->count * sizeof *field->centres);
    field->result = unknown_result();
    field->state = STATE_WORDS;
    field->resume = field->units_charged = 0;
    return CAIRN_OK;
}

/* The word of each patch. */
static int find_words(cairn_appearance_field *field, cairn_budget *budget)
{
    const cairn_appearance_model *model = field->model;

    CAIRN_STEP_BEGIN(field->resume);
    for (field->cursor = 0; field->cursor < field->count; field->cursor++) {
        CAIRN_STEP_CHARGE(field, resume, budget, UNITS_PER_WORD * model->word_count);
        field->words[field->cursor] = cairn_appearance_nearest_word(
            model->words, model->word_count,
            &field->descriptors[(size_t)field->cursor * CAIRN_APPEARANCE_DESCRIPTOR_SIZE], NULL);
    }
    CAIRN_STEP_END(field->resume);
}

/* ---- A box ---- */

cairn_status cairn_appearance_begin_box(cairn_appearance_field *field, const cairn_real box[4])
{
    if (field == NULL || box == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (field->state < STATE_READY)
        return CAIRN_EMPTY;
    for (int32_t k = 0; k < 4; k++)
        if (!cairn_is_finite(box[k]))
            return CAIRN_NOT_FINITE;
    memcpy(field->box, box, sizeof field->box);
    memset(field->histogram, 0, (size_t)field->model->word_count * sizeof *field->histogram);
    field->result = unknown_result();
    field->decision = -field->model->rho;
    field->smallest = MAX_CHI2;
    field->state = STATE_BOX;
    field->resume = field->units_charged = 0;
    return CAIRN_OK;
}

static int is_in_box(cairn_vec2 centre, const cairn_real box[4])
{
    return centre.x >= box[0] && centre.y >= box[1] && centre.x <= box[2] && centre.y <= box[3];
}

static void count_patch(cairn_appearance_field *field, int32_t patch)
{
    if (is_in_box(field->centres[patch], field->box)) {
        field->histogram[field->words[patch]]++;
        field->result.patch_count++;
    }
}

/* Positive support vectors raise the probability: the sign of their weights is opposite to that of
 * the slope. */
static void add_support(cairn_appearance_field *field, int32_t index)
{
    const cairn_appearance_model *model = field->model;
    cairn_real chi2 =
        cairn_appearance_chi2(support_histogram(model, index), field->histogram, model->word_count);

    field->decision += support_term(model, index, chi2);
    if (model->weights[index] * model->platt_slope < 0)
        field->smallest = cairn_min(field->smallest, chi2);
}

/* Scores the box; one without a patch is unknown. */
static int score_box(cairn_appearance_field *field, cairn_budget *budget)
{
    const cairn_appearance_model *model = field->model;

    CAIRN_STEP_BEGIN(field->resume);
    for (field->cursor = 0; field->cursor < field->count; field->cursor++) {
        CAIRN_STEP_CHARGE_EVERY(field, resume, budget, PATCHES_PER_UNIT, field->cursor);
        count_patch(field, field->cursor);
    }
    cairn_appearance_normalize(field->histogram, model->word_count);
    if (field->result.patch_count > 0) {
        for (field->cursor = 0; field->cursor < model->support_count; field->cursor++) {
            CAIRN_STEP_CHARGE(field, resume, budget, 1 + model->word_count / WORDS_PER_UNIT);
            add_support(field, field->cursor);
        }
        field->result.probability = probability_of(model, field->decision);
        field->result.distance = field->smallest / MAX_CHI2;
    }
    CAIRN_STEP_END(field->resume);
}

cairn_status cairn_appearance_step(cairn_appearance_field *field, cairn_budget *budget)
{
    if (field == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (field->state == STATE_WORDS && find_words(field, budget))
        field->state = STATE_READY;
    if (field->state == STATE_BOX && score_box(field, budget))
        field->state = STATE_SCORED;
    return field->state == STATE_WORDS || field->state == STATE_BOX ? CAIRN_MORE : CAIRN_OK;
}

cairn_appearance_result cairn_appearance_read(const cairn_appearance_field *field)
{
    return field->state == STATE_SCORED ? field->result : unknown_result();
}
