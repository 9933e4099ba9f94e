/* box_table: reader of bounding boxes of objects in images, as a CSV file.
 *
 *   image,left,top,right,bottom
 *
 * Coordinates are in pixels. Other columns are ignored, so that the table of `cairn detect
 * --detections` can be read. A field with , or " is quoted, with " doubled. */
#ifndef CAIRN_BOX_TABLE_H
#define CAIRN_BOX_TABLE_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Maximum rows, capacity of an image's name in bytes, maximum fields of a line. */
#define CAIRN_BOX_TABLE_MAX_ROWS   1000000
#define CAIRN_BOX_TABLE_NAME_BYTES 256
#define CAIRN_BOX_TABLE_MAX_FIELDS 64

/* A bounding box. */
typedef struct cairn_box_table_row {
    /* name of the image, 0-terminated */
    char image[CAIRN_BOX_TABLE_NAME_BYTES];
    double box[4]; /* pixels: left, top, right, bottom; left < right, top < bottom, within 1e6 */
    int64_t line;  /* of the file, from 1 */
} cairn_box_table_row;

/* Reads a table, plain or gzipped, into an array on the heap, *row [*count]. CAIRN_BAD_FORMAT with
 * the line: a missing column, a malformed field, an invalid box; CAIRN_FULL, CAIRN_TRUNCATED
 * (gzip), CAIRN_EMPTY: no header; CAIRN_UNSUPPORTED (not a regular file), CAIRN_IO,
 * CAIRN_NO_MEMORY. On failure there is nothing to free.
 *
 * path: file, plain or gzipped
 * row: set to the rows
 * count: set to their number */
CAIRN_CHECKED cairn_status cairn_box_table_read(const char *path, cairn_box_table_row **row,
                                                int32_t *count, cairn_file_error *error);

/* Sorts rows by image name; rows of one image keep the order of the file.
 *
 * row: [count] rows */
void cairn_box_table_sort(cairn_box_table_row *row, int32_t count);

/* Returns the index of the first row of an image among sorted rows. *own: the number of its rows,
 * 0: none. Binary search.
 *
 * row: [count] sorted rows
 * image: name of the image */
int32_t cairn_box_table_find(const cairn_box_table_row *row, int32_t count, const char *image,
                             int32_t *own);

#ifdef __cplusplus
}
#endif

#endif
