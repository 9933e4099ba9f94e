/* The visual words of an image: descriptors of patches on a regular grid, by the plug-in, quantized
 * by the library.
 *
 * Method: SIFT at a patch every 6 pixels, and every 12 of the image of half the size.
 *
 * Source: Adluru 2008, section 5.3.2, which leaves the patches open. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/base/interruption.h"
#include "src/host/images/appearance_patches.h"
#include "src/host/images/shim.h"

#define PLUGIN_NAME "libcairn-appearance.so"

/* px: spacing of patches, and keypoint size for SIFT, whose patch is six times as wide; twice that
 * in the image of half the size. */
enum { PATCH_STEP_PX = 6, KEYPOINT_SIZE_PX = 4, OCTAVE_COUNT = 2 };

/* ---- Patches ---- */

const cairn_appearance_shim *cairn_appearance_image_need_shim(const char *path,
                                                              cairn_file_error *error)
{
    const cairn_appearance_shim *shim =
        cairn_shim_find(PLUGIN_NAME, "CAIRN_APPEARANCE", "cairn_appearance_shim_table",
                        CAIRN_APPEARANCE_SHIM_VERSION);

    if (shim == NULL)
        (void)cairn_file_error_set(
            error, CAIRN_UNSUPPORTED, path, 0,
            "appearance needs " PLUGIN_NAME " of this version, expected it beside the program "
            "(built by `make appearance`, OpenCV 4: tools/deps.sh appearance)");
    return shim;
}

cairn_status cairn_appearance_image_load(cairn_file_error *error)
{
    return cairn_appearance_image_need_shim(PLUGIN_NAME, error) != NULL ? CAIRN_OK
                                                                        : CAIRN_UNSUPPORTED;
}

static void place_keypoints(appearance_patches *patches, int32_t width, int32_t height)
{
    for (int32_t octave = 0; octave < OCTAVE_COUNT; octave++) {
        int32_t step = PATCH_STEP_PX << octave;

        for (int32_t y = step / 2; y < height; y += step)
            for (int32_t x = step / 2; x < width; x += step) {
                cairn_appearance_shim_keypoint *keypoint = &patches->keypoints[patches->count++];

                keypoint->x = (float)x;
                keypoint->y = (float)y;
                keypoint->size = (float)(KEYPOINT_SIZE_PX << octave);
                keypoint->octave = octave;
            }
    }
}

static size_t max_keypoint_count(int32_t width, int32_t height)
{
    return 2 * ((size_t)width / PATCH_STEP_PX + 1) * ((size_t)height / PATCH_STEP_PX + 1);
}

cairn_status cairn_appearance_image_describe(appearance_patches *patches, const uint8_t *grey,
                                             int32_t width, int32_t height, const char *path,
                                             cairn_file_error *error)
{
    char message[CAIRN_APPEARANCE_SHIM_MESSAGE_BYTES] = "";
    const cairn_appearance_shim *shim;
    cairn_status status;

    memset(patches, 0, sizeof *patches);
    if (grey == NULL || width < 1 || height < 1 || width > CAIRN_APPEARANCE_IMAGE_MAX_SIDE ||
        height > CAIRN_APPEARANCE_IMAGE_MAX_SIDE)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "an image of %d x %d, expected 8-bit grey of at most %d a side",
                                    (int)width, (int)height, CAIRN_APPEARANCE_IMAGE_MAX_SIDE);
    shim = cairn_appearance_image_need_shim(path, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    patches->keypoints = malloc(max_keypoint_count(width, height) * sizeof *patches->keypoints);
    patches->descriptors = malloc(max_keypoint_count(width, height) * APPEARANCE_DESCRIPTOR_SIZE);
    if (patches->keypoints == NULL || patches->descriptors == NULL)
        return cairn_file_error_system(error, path, "describe", ENOMEM);
    place_keypoints(patches, width, height);
    if (patches->count == 0)
        return CAIRN_OK;
    status = shim->describe(grey, width, height, patches->keypoints, patches->count,
                            patches->descriptors, message, sizeof message);
    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0,
                                    "OpenCV: %s, expected patches of an image", message);
    return CAIRN_OK;
}

void cairn_appearance_image_patches_free(appearance_patches *patches)
{
    free(patches->keypoints);
    free(patches->descriptors);
    memset(patches, 0, sizeof *patches);
}

int cairn_appearance_image_is_in_box(const cairn_appearance_shim_keypoint *keypoint,
                                     const double box[4])
{
    return (double)keypoint->x >= box[0] && (double)keypoint->y >= box[1] &&
           (double)keypoint->x <= box[2] && (double)keypoint->y <= box[3];
}

/* ---- Words ---- */

static cairn_vec2 *centres_of(const appearance_patches *patches)
{
    cairn_vec2 *centres = malloc(((size_t)patches->count + 1) * sizeof *centres);

    for (int32_t i = 0; i < patches->count && centres != NULL; i++) {
        centres[i].x = (cairn_real)patches->keypoints[i].x;
        centres[i].y = (cairn_real)patches->keypoints[i].y;
    }
    return centres;
}

/* Creates the field in memory of the heap, and computes the words. */
static cairn_status make_field(cairn_appearance_image *image, const cairn_appearance_model *model,
                               const cairn_appearance_patches *patches)
{
    cairn_appearance_params params = {.max_patches = patches->count > 0 ? patches->count : 1,
                                      .max_words = model->word_count};
    size_t bytes = cairn_appearance_memory(&params);
    cairn_status status = bytes > 0 ? CAIRN_OK : CAIRN_BAD_ARGUMENT;
    cairn_budget budget;
    cairn_pool pool;

    image->memory = malloc(bytes + CAIRN_ALIGN);
    if (image->memory == NULL)
        return CAIRN_NO_MEMORY;
    if (status == CAIRN_OK)
        status = cairn_pool_init(&pool, image->memory, bytes + CAIRN_ALIGN);
    if (status == CAIRN_OK)
        status = cairn_appearance_create(&image->field, &pool, &params);
    if (status == CAIRN_OK)
        status = cairn_appearance_begin(image->field, model, patches);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_appearance_step(image->field, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    return status;
}

cairn_status cairn_appearance_image_make(cairn_appearance_image *image,
                                         const cairn_appearance_model *model, const uint8_t *grey,
                                         int32_t width, int32_t height, const char *path,
                                         cairn_file_error *error)
{
    appearance_patches described;
    cairn_status status =
        cairn_appearance_image_describe(&described, grey, width, height, path, error);
    cairn_vec2 *centres;

    memset(image, 0, sizeof *image);
    if (status != CAIRN_OK) {
        cairn_appearance_image_patches_free(&described);
        return status;
    }
    centres = centres_of(&described);
    status = CAIRN_NO_MEMORY;
    if (centres != NULL) {
        cairn_appearance_patches patches = {centres, described.descriptors, described.count};

        status = make_field(image, model, &patches);
    }
    free(centres);
    cairn_appearance_image_patches_free(&described);
    if (status == CAIRN_OK)
        return CAIRN_OK;
    cairn_appearance_image_free(image);
    if (status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(error, path, "describe", ENOMEM);
    return cairn_file_error_set(error, status, path, 0, "%s, expected a model of 2 to %d words",
                                cairn_status_text(status), CAIRN_APPEARANCE_MAX_WORDS);
}

void cairn_appearance_image_free(cairn_appearance_image *image)
{
    free(image->memory);
    memset(image, 0, sizeof *image);
}
