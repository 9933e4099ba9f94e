/* Gradients, edges, and objects cut out of photographs by OpenCV. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>

#include "src/host/base/host_parameters.h"
#include "src/host/images/vision_plugin.h"

enum { MAX_SIGMA_PIXELS = 50, MAX_GRADIENT = 1000, MIN_BOX_PIXELS = 8 };

static const cairn_host_parameter rows[] = {
    CAIRN_HOST_NUMBER(cairn_vision_canny_params, sigma, 1.4, 0, MAX_SIGMA_PIXELS),
    CAIRN_HOST_NUMBER_ABOVE(cairn_vision_canny_params, low, 3, 0, MAX_GRADIENT),
    CAIRN_HOST_NUMBER_ABOVE(cairn_vision_canny_params, high, 8, 0, MAX_GRADIENT),
};

const cairn_host_parameters cairn_vision_canny_parameters =
    CAIRN_HOST_PARAMETERS(cairn_vision_canny_params, rows);

cairn_vision_canny_params cairn_vision_canny_default(void)
{
    cairn_vision_canny_params params;

    cairn_host_parameters_preset(&cairn_vision_canny_parameters, &params);
    return params;
}

cairn_status cairn_vision_gradients(const cairn_vision_image *grey, double sigma, float *x,
                                    float *y, const char *name, cairn_file_error *error)
{
    char message[CAIRN_VISION_SHIM_MESSAGE_BYTES] = "";
    const cairn_vision_shim *shim;
    cairn_status status;

    if (!cairn_vision_is_grey(grey) || x == NULL || y == NULL || !(sigma >= 0) ||
        sigma > MAX_SIGMA_PIXELS)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, name, 0,
            "no gradients of this image, expected 8-bit grey and sigma 0 ... %d", MAX_SIGMA_PIXELS);
    shim = cairn_vision_require(name, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    status = shim->gradients(grey->samples, grey->width, grey->height, sigma, x, y, message,
                             sizeof message);
    return status == CAIRN_OK ? CAIRN_OK
                              : cairn_vision_report(status, name, "gradients", message, error);
}

cairn_status cairn_vision_canny(const cairn_vision_image *grey,
                                const cairn_vision_canny_params *params, uint8_t *strengths,
                                const char *name, cairn_file_error *error)
{
    char message[CAIRN_VISION_SHIM_MESSAGE_BYTES] = "";
    const cairn_vision_shim *shim;
    cairn_status status;

    if (!cairn_vision_is_grey(grey) || strengths == NULL)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, name, 0,
                                    "no edges of this image, expected 8-bit grey");
    status = cairn_host_parameters_check(&cairn_vision_canny_parameters, params, name, error);
    if (status != CAIRN_OK)
        return status;
    if (params->low > params->high)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, name, 0,
                                    "low is %.9g, expected at most high, %.9g", params->low,
                                    params->high);
    shim = cairn_vision_require(name, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    status = shim->canny(grey->samples, grey->width, grey->height, params->sigma, params->low,
                         params->high, strengths, message, sizeof message);
    return status == CAIRN_OK ? CAIRN_OK
                              : cairn_vision_report(status, name, "edges", message, error);
}

/* Returns the photograph as blue, green, red, without alpha, on the heap; NULL: no memory. */
static uint8_t *make_bgr(const cairn_vision_image *photo)
{
    size_t pixels = (size_t)photo->width * (size_t)photo->height;
    const uint8_t *from = photo->samples;
    uint8_t *bgr = malloc(3 * pixels);

    for (size_t i = 0; i < pixels && bgr != NULL; i++, from += photo->channels)
        for (int32_t k = 0; k < 3; k++)
            bgr[3 * i + (size_t)k] = from[photo->channels == 1 ? 0 : k];
    return bgr;
}

/* Returns 1 for a box within the image that leaves something of it as background. */
static int is_box(const cairn_vision_image *photo, const int32_t box[4])
{
    return box[0] >= 0 && box[1] >= 0 && box[2] >= MIN_BOX_PIXELS && box[3] >= MIN_BOX_PIXELS &&
           box[0] <= photo->width - box[2] && box[1] <= photo->height - box[3] &&
           (box[2] < photo->width || box[3] < photo->height);
}

cairn_status cairn_vision_grab(cairn_vision_image *silhouette, const cairn_vision_image *photo,
                               const int32_t box[4], const char *name, cairn_file_error *error)
{
    char message[CAIRN_VISION_SHIM_MESSAGE_BYTES] = "";
    const cairn_vision_shim *shim;
    cairn_status status = CAIRN_NO_MEMORY;
    uint8_t *bgr;

    memset(silhouette, 0, sizeof *silhouette);
    if (!cairn_vision_is_image(photo) || photo->sample_bytes != 1)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, name, 0,
                                    "no object can be cut out, expected an image of 8 bits");
    if (!is_box(photo, box))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, name, 0,
            "the box %d,%d,%d,%d, expected x,y,w,h within the %d x %d pixels of the image, at "
            "least %d a side, and not all of it",
            (int)box[0], (int)box[1], (int)box[2], (int)box[3], (int)photo->width,
            (int)photo->height, MIN_BOX_PIXELS);
    shim = cairn_vision_require(name, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    bgr = make_bgr(photo);
    *silhouette =
        (cairn_vision_image){.width = photo->width,
                             .height = photo->height,
                             .channels = 1,
                             .sample_bytes = 1,
                             .samples = malloc((size_t)photo->width * (size_t)photo->height)};
    if (bgr != NULL && silhouette->samples != NULL)
        status = shim->grab(bgr, photo->width, photo->height, box, silhouette->samples, message,
                            sizeof message);
    free(bgr);
    if (status == CAIRN_OK)
        return CAIRN_OK;
    cairn_vision_free(silhouette);
    return cairn_vision_report(status, name, "an object that differs from what is around the box",
                               message[0] != 0 ? message : "no memory", error);
}
