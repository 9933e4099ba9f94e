/* Simulated partial maps of one arena: occupancy grids in separate frames; neighbours overlap by a
 * given fraction. */
#ifndef CAIRN_BENCH_PARTS_H
#define CAIRN_BENCH_PARTS_H

#include "cairn/map_merge.h"
#include "sim/arena.h"

typedef struct bench_part {
    /* [side * side] as CAIRN_CELL_..., row 0 lowest */
    uint8_t *cells;
    /* [side * side] m, x and y of a cell from the middle of the part's own tile */
    float *place[2];
    /* [side * side] cells before cropping to the part */
    uint8_t *seen;
    /* cells */
    int32_t side;
    /* truth */
    sim_pose world_map;
    /* of the tile */
    sim_point middle;
    /* m, of the tile in x and y */
    double half[2];
    /* m, and rad per m, rad, rad per m, rad: amplitude and waves of the errors of its own poses */
    double bend, bend_waves[4];
    /* of its map, 1: that of the world */
    double scale;
    /* m, margins of the part around its tile: in x and y, below and above */
    double margin[2][2];
} bench_part;

typedef struct bench_parts_options {
    uint64_t seed;
    const char *scene;
    int32_t robots;
    /* share of the smaller map's known cells that each pair of neighbours has in common */
    double overlap;
    /* m, side of the part of one robot, overlap included */
    double tile;
    /* m */
    double resolution;
    /* from which a robot scans */
    int32_t places;
    /* 1: two robots in an arena of 20 by 16 m */
    int32_t pair;
    /* m: amplitude of the smooth errors of a robot's own poses, by which its map is distorted */
    double bend;
    /* largest relative error of a robot's scale */
    double stretch;
} bench_parts_options;

typedef struct bench_parts {
    bench_part *list; /* [count] */
    int32_t count;
    double overlap; /* median over neighbours, as measured */
    double resolution;
} bench_parts;

/* 0 on failure, with a line on standard error. */
int bench_parts_make(const bench_parts_options *options, bench_parts *parts);
void bench_parts_free(bench_parts *parts);

/* Returns the overlap at the true poses: cells known in both, relative to the known cells of the
 * smaller map. */
double bench_parts_shared(const bench_parts *parts, int32_t a, int32_t b);

/* Returns the mirror image of a part. */
void bench_part_mirror(bench_part *part);

cairn_map_merge_map bench_part_map(const bench_part *part, double resolution);

/* Merges all parts and, when not NULL, another map, which is the last one. order: NULL, or of the
 * maps. 0 on failure, with a line on standard error. */
int bench_parts_merge(cairn_map_merge *merge, const bench_parts *parts, const bench_part *other,
                      const int32_t *order);

#endif
