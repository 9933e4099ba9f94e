/* Shared by the writers of results of a shrunk image. Internal to the folder. */
#ifndef CAIRN_HOST_CONTOUR_FILE_WORK_H
#define CAIRN_HOST_CONTOUR_FILE_WORK_H

#include "cairn/contour_file.h"
#include "cairn/output.h"

/* Returns a coordinate of the searched picture in pixels of the image, which is `shrink` times as
 * large. */
static inline double contour_file_coordinate(double at, int32_t shrink)
{
    return (at + 0.5) * shrink - 0.5;
}

/* Prints segments of the tokens as JSON: "segments" with index, chain and ends in pixels of the
 * image.
 *
 * segments: indices of tokens, of which those from `first` on are printed */
void cairn_contour_file_print_segments(cairn_output *output,
                                       const cairn_contour_search_tokens *tokens, int32_t shrink,
                                       const int32_t *segments, int32_t first, int32_t count);

#endif
