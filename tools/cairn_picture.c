/* Images for the subcommands that detect known objects. */
#include <ctype.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "src/host/base/posix.h"
#include "tools/cairn_picture.h"
#include "tools/cairn_tool.h"

/* Halves an image of 8 bits in place: mean or maximum of two by two pixels. An odd last row or
 * column is dropped. */
static void halve(cairn_vision_image *image, int32_t use_maximum)
{
    uint8_t *p = image->samples, *to = p;
    int32_t w = image->width, h = image->height, width = w > 1 ? w / 2 : 1,
            height = h > 1 ? h / 2 : 1, channels = image->channels;

    for (int32_t y = 0; y < height; y++)
        for (int32_t x = 0; x < width * channels; x++) {
            int32_t sum = 0, most = 0;

            for (int32_t k = 0; k < 4; k++) {
                int32_t u = 2 * (x / channels) + k % 2, v = 2 * y + k / 2;
                size_t at = (size_t)(v < h ? v : h - 1) * (size_t)w + (size_t)(u < w ? u : w - 1);
                int32_t value = p[at * (size_t)channels + (size_t)(x % channels)];

                sum += value;
                most = value > most ? value : most;
            }
            *to++ = (uint8_t)(use_maximum ? most : (sum + 2) / 4);
        }
    image->width = width;
    image->height = height;
}

int32_t picture_shrink(cairn_vision_image *image, int64_t side)
{
    int32_t shrink = 1;

    for (; image->width > side || image->height > side; shrink *= 2)
        halve(image, 0);
    return shrink;
}

void picture_shrink_edges(cairn_vision_image *edges, int32_t shrink)
{
    for (; shrink > 1; shrink /= 2)
        halve(edges, 1);
}

void picture_free(searched_picture *p)
{
    cairn_vision_free(&p->grey);
    cairn_vision_free(&p->edges);
}

cairn_status picture_read(searched_picture *p, const char *path, const picture_settings *settings,
                          cairn_file_error *error)
{
    cairn_status status;

    memset(p, 0, sizeof *p);
    status = cairn_vision_read_grey(&p->grey, path, error);
    if (status == CAIRN_OK && settings->edges != NULL)
        status = cairn_vision_read_grey(&p->edges, settings->edges, error);
    if (status != CAIRN_OK)
        return status;
    if (settings->edges != NULL &&
        (p->edges.width != p->grey.width || p->edges.height != p->grey.height))
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, settings->edges, 0,
                                    "%" PRId32 " x %" PRId32 " pixels, expected %" PRId32
                                    " x %" PRId32 " as of the image",
                                    p->edges.width, p->edges.height, p->grey.width, p->grey.height);
    p->width = p->grey.width;
    p->height = p->grey.height;
    p->shrink = picture_shrink(&p->grey, settings->side);
    if (settings->edges != NULL) {
        picture_shrink_edges(&p->edges, p->shrink);
        return CAIRN_OK;
    }
    p->edges = p->grey;
    p->edges.samples = malloc((size_t)p->grey.width * (size_t)p->grey.height);
    if (p->edges.samples == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory for the edges");
    return cairn_vision_canny(&p->grey, &settings->canny, p->edges.samples, path, error);
}

int picture_stem(const char *path, char stem[PICTURE_NAME_BYTES])
{
    const char *name = cairn_output_path_name(path), *dot = strrchr(name, '.');
    size_t length = dot != NULL && dot > name ? (size_t)(dot - name) : strlen(name);

    if (length < 1 || length >= PICTURE_NAME_BYTES)
        return 0;
    memcpy(stem, name, length);
    stem[length] = '\0';
    return 1;
}

cairn_status picture_remove_unless_of_image(cairn_output_set *set, const char *folder,
                                            const char *name, cairn_file_error *error)
{
    char stem[PICTURE_NAME_BYTES], json[PICTURE_NAME_BYTES + 8], *path;
    int is_of_image;

    if (!picture_stem(name, stem))
        return CAIRN_OK;
    (void)snprintf(json, sizeof json, "%s.json", stem);
    path = cairn_output_path_join(folder, json);
    if (path == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, name, 0, "no memory");
    is_of_image = access(path, F_OK) == 0;
    free(path);
    return is_of_image ? CAIRN_OK : cairn_output_set_remove(set, name, error);
}

int picture_check_name(const char *program, const char *path)
{
    char shown[PICTURE_NAME_BYTES];
    int is_plain = 1;

    (void)snprintf(shown, sizeof shown, "%s", path);
    for (const char *c = path; *c != '\0'; c++)
        if (iscntrl((unsigned char)*c)) {
            is_plain = 0;
            if (c - path < PICTURE_NAME_BYTES - 1)
                shown[c - path] = '?';
        }
    return is_plain
               ? TOOL_OK
               : options_refuse(
                     program,
                     "'%s' holds a control character (shown as ?), expected a name without", shown);
}

int picture_check_names(const char *program, const char *const *paths, size_t count)
{
    char stem[PICTURE_NAME_BYTES], other[PICTURE_NAME_BYTES];

    for (size_t i = 0; i < count; i++) {
        if (!picture_stem(paths[i], stem))
            return options_refuse(program, "'%s', expected the name of an image", paths[i]);
        if (picture_check_name(program, paths[i]) != TOOL_OK)
            return TOOL_BAD;
        for (size_t k = 0; k < i; k++)
            if (picture_stem(paths[k], other) && strcmp(stem, other) == 0)
                return options_refuse(program,
                                      "%s and %s are both named '%s', expected different names",
                                      paths[k], paths[i], stem);
    }
    return TOOL_OK;
}
