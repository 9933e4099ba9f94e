/* Three scans of a corner (Adluru 2008, figure 7.6): force field simulation compared with
 * nearest-neighbour correspondences. */
#ifndef CAIRN_BENCH_CORNERS_H
#define CAIRN_BENCH_CORNERS_H

/* Prints a row for the field after 12 steps by the preset's name ("thesis", "spaced" or
 * "springs") at this spacing of points, m, and one for nearest neighbours of all points after
 * 100; into the folder svg, when not NULL, a picture of the start and of both ends. 0 on
 * failure, with a line on standard error. */
int bench_corners(const char *preset, double spacing, const char *svg);

#endif
