/* Images for the subcommands that detect known objects: reading, downsampling, edge detection,
 * names of output files. */
#ifndef CAIRN_TOOLS_CAIRN_PICTURE_H
#define CAIRN_TOOLS_CAIRN_PICTURE_H

#include "cairn/output_set.h"
#include "cairn/vision.h"
#include "tools/options.h"

enum { PICTURE_NAME_BYTES = 256 };

typedef struct picture_settings {
    const char *edges; /* file of the edge map; NULL: Canny edge detector */
    int64_t side;      /* px: larger images are halved until they fit */
    cairn_vision_canny_params canny;
} picture_settings;

typedef struct searched_picture {
    cairn_vision_image grey, edges;
    int32_t shrink;        /* 1, 2, 4 ... */
    int32_t width, height; /* px, of the image before it was shrunk */
} searched_picture;

/* Reads an image and its edge map, or computes it. picture_free() is needed also on failure. */
CAIRN_CHECKED cairn_status picture_read(searched_picture *p, const char *path,
                                        const picture_settings *settings, cairn_file_error *error);
void picture_free(searched_picture *p);

/* Maximum side of an image, px. Larger images are halved, so that training and detection use the
 * same scale. */
enum { PICTURE_SIDE = 800 };

/* Halves an image of 8 bits in place until neither side is longer than `side`. Returns the scale
 * factor 1, 2, 4 ... */
int32_t picture_shrink(cairn_vision_image *image, int64_t side);

/* Halves an edge map in place as its image was, to the maxima of squares. */
void picture_shrink_edges(cairn_vision_image *edges, int32_t shrink);

/* "folder/swan.jpg" -> "swan"; Returns 0 when there is no such name. */
int picture_stem(const char *path, char stem[PICTURE_NAME_BYTES]);

/* Names in the set a picture NAME.svg of an earlier run, as cairn_output_set_remove(), unless
 * NAME.json beside it shows that it is the result of an image of that name. */
CAIRN_CHECKED cairn_status picture_remove_unless_of_image(cairn_output_set *set, const char *folder,
                                                          const char *name,
                                                          cairn_file_error *error);

/* TOOL_OK, or after a line on standard error another exit code: the path holds a control
 * character, which would break lines of the output. */
int picture_check_name(const char *program, const char *path);

/* TOOL_OK, or after a line on standard error another exit code: a path that picture_check_name()
 * refuses, an image without a name, or two whose files would overwrite each other. */
int picture_check_names(const char *program, const char *const *paths, size_t count);

#endif
