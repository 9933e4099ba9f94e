/* box_table: boxes about objects in images, as a CSV file.
 *
 *   image,left,top,right,bottom
 *
 * px; other columns are passed over, so that the table of `cairn detect --detections` can be
 * read. A field that holds , or " stands in quotes, " doubled. */
#ifndef CAIRN_BOX_TABLE_H
#define CAIRN_BOX_TABLE_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CAIRN_BOX_TABLE_ROWS_MOST   1000000
#define CAIRN_BOX_TABLE_NAME_BYTES  256
#define CAIRN_BOX_TABLE_FIELDS_MOST 64

typedef struct cairn_box_row {
    char image[CAIRN_BOX_TABLE_NAME_BYTES];
    double box[4]; /* left < right, top < bottom, within 1e6 */
    int64_t line;  /* from 1 */
} cairn_box_row;

/* Reads a table, plain or gzipped, into memory from the heap: *row [*count]. CAIRN_BAD_FORMAT: a
 * column is missing, a field is none, a box is not as said above: the error names the line;
 * CAIRN_FULL, CAIRN_TRUNCATED (gzip), CAIRN_EMPTY: no head; CAIRN_UNSUPPORTED (not a regular
 * file), CAIRN_IO, CAIRN_NO_MEMORY. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_box_table_read(const char *path, cairn_box_row **row,
                                                int32_t *count, cairn_file_error *error);

/* Sorts rows by their images' names, those of one image as they were in the file. */
void cairn_box_table_sort(cairn_box_row *row, int32_t count);

/* Of sorted rows the first of an image, and *own, how many there are, 0: none. Cost:
 * logarithmic. */
int32_t cairn_box_table_find(const cairn_box_row *row, int32_t count, const char *image,
                             int32_t *own);

#ifdef __cplusplus
}
#endif

#endif
