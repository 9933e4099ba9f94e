/* What the files of boundary share. */
#ifndef CAIRN_CONTOUR_BOUNDARY_WORK_H
#define CAIRN_CONTOUR_BOUNDARY_WORK_H

#include "cairn/boundary.h"

enum { BOUNDARY_CHANNELS = 3, BOUNDARY_LEVELS = 4096 };
/* Bins of a region's histograms, of L, a and b: all of them, of L alone, of a and of b. */
enum {
    BOUNDARY_L_BINS = 9,
    BOUNDARY_AB_BINS = 7,
    BOUNDARY_BINS = BOUNDARY_L_BINS + 2 * BOUNDARY_AB_BINS
};
/* Vectors that are iterated at once. */
enum { BOUNDARY_BLOCK = 12 };
#define BOUNDARY_AB_MOST CAIRN_REAL(45.0) /* a and b beyond it fall into the last bins */

typedef int32_t boundary_phase;
enum {
    BOUNDARY_IDLE,
    BOUNDARY_COLOUR,
    BOUNDARY_FILL,
    BOUNDARY_COLUMNS,
    BOUNDARY_CHANGE,
    BOUNDARY_STRENGTH,
    BOUNDARY_FLOOD,
    BOUNDARY_BORDER,
    BOUNDARY_CUT,
    BOUNDARY_CLEAR,
    BOUNDARY_JOIN,
    BOUNDARY_TELL,
    BOUNDARY_TRACE,
    BOUNDARY_RANK,
    BOUNDARY_DONE
};

/* Of the cuts. */
typedef int32_t boundary_stage;
enum { BOUNDARY_TIE, BOUNDARY_DAMP, BOUNDARY_STRAIGHTEN, BOUNDARY_PROJECT, BOUNDARY_TURN };

/* The common border of two regions. Sides 0 and 1 of border e are the half-borders 2 e and 2 e +
 * 1, each in the list of its region. */
typedef struct boundary_border {
    /* regions that it parted at first, the smaller number first: what the table knows it by */
    int32_t first[2];
    /* and does now */
    int32_t region[2];
    /* half-borders of the same region; -1: none */
    int32_t next[2], before[2];
    /* of pixels: at first, and with those that became part of it */
    int32_t sides, length;
    /* in the heap; -1: no longer */
    int32_t at;
    /* the border that it became part of; itself */
    int32_t into;
    /* mean strength at first, with what the whole image says of it */
    cairn_real own;
    /* of strengths along it */
    cairn_real sum;
    /* of its levels, each way of joining */
    cairn_real logs;
    /* in the heap */
    cairn_real key;
    /* at which the two became one */
    cairn_real level;
} boundary_border;

typedef struct boundary_region {
    int32_t first;    /* half-border; -1: none */
    int32_t pixels;   /* at first */
    int32_t size;     /* and with those that were joined to it */
    int32_t count;    /* of borders */
    int32_t mark;     /* border with the region that another one is joined to; -1 */
    cairn_real share; /* of the image, to the power */
} boundary_region;

/* Tensors of change: xx, xy, yy. */
typedef struct boundary_change {
    cairn_real xx, xy, yy;
} boundary_change;

struct cairn_boundary {
    cairn_boundary_params params;
    cairn_boundary_image image;
    cairn_real linear[256]; /* light of a sample */
    /* Pictures, rows of the image's width without gaps. */
    cairn_real *colour;      /* [BOUNDARY_CHANNELS][pixels] */
    cairn_real *one, *other; /* [pixels]; one: strengths in the end */
    boundary_change *change; /* [pixels] */
    cairn_real *line;        /* [2][max_width]: a row on its way, sums of columns */
    /* Flooding. */
    /* [pixels], -1: none yet */
    int32_t *label;
    /* [pixels]: the next one of the same level to go on from */
    int32_t *queue;
    /* [pixels]: the next pixel of the same level */
    int32_t *same;
    /* [pixels]: upper side 1, left side 2 */
    uint8_t *walked;
    /* [BOUNDARY_LEVELS]: of queues; tail: of the level's pixels before it is flooded */
    int32_t *head, *tail;
    /* [BOUNDARY_LEVELS]: of the level's pixels */
    int32_t *first;
    /* Joining. */
    /* [max_regions] */
    boundary_region *regions;
    /* [max_borders] */
    boundary_border *borders;
    /* [table_size]: borders by their regions, -1: free */
    int32_t *table;
    /* [max_borders]: of borders by their keys, then of contours by strength */
    int32_t *heap;
    cairn_real *first_bins,
        /* [max_regions][BOUNDARY_BINS]: how much of each colour a region has, at first and now */
        *bins;
    /* Cuts. */
    cairn_real *root;    /* [max_regions]: 1 / the root of what a region's ties come to */
    cairn_real *vectors; /* [BOUNDARY_BLOCK + 2][regions]: and two that are at work */
    cairn_real small_matrix[BOUNDARY_BLOCK][BOUNDARY_BLOCK], basis[BOUNDARY_BLOCK][BOUNDARY_BLOCK];
    cairn_real value[BOUNDARY_BLOCK]; /* the greatest first */
    cairn_real mean_strength, cut;    /* of borders; values below it are damped */
    boundary_stage stage;
    int32_t block, turn, member, degree;
    /* Contours. */
    cairn_boundary_contour *found, *ranked; /* [max_borders] */
    cairn_boundary_corner *corners;         /* [max_points] */

    int32_t max_borders, table_size;
    int32_t pixels, channels;
    /* of the change at hand */
    int32_t map, row, pass;
    /* the map at hand is not 0 everywhere */
    int32_t some;
    int32_t level;
    int32_t region_count, border_count, heap_count;
    /* borders that have come to the heap; regions and borders that are cleared or told */
    int32_t fed;
    /* of joining */
    int32_t way;
    int32_t contour_count, corner_count, ranked_count;
    /* corner of a walk, 0 ... 3: right, down, left, up */
    int32_t x, y, heading, walking;
    /* corner where walks are looked for */
    int32_t from_x, from_y;
    /* 1: only closed contours are left */
    int32_t loops;
    cairn_real walk_sum;
    /* the highest key so far */
    cairn_real joined;
    boundary_phase phase;
    int32_t paid;
};

/* The least integer not below the quotient, both above 0. */
static inline int32_t boundary_share(int32_t n, int32_t of)
{
    return (n + of - 1) / of;
}

/* Rows of the phases COLOUR to STRENGTH, and what comes after them. */
void cairn_boundary_measure_row(cairn_boundary *b);
int32_t cairn_boundary_measure_cost(const cairn_boundary *b);

void cairn_boundary_flood_begin(cairn_boundary *b);
/* Files the pixels of a row under their levels. */
void cairn_boundary_flood_row(cairn_boundary *b, int32_t row);
/* One pixel. 0: all are labelled. */
int cairn_boundary_flood_pixel(cairn_boundary *b);
void cairn_boundary_border_row(cairn_boundary *b);
/* The strengths of borders before anything is joined, and the cuts of the whole image that add
 * to them: an item, what it costs. 0: it was the last one. */
void cairn_boundary_ties_begin(cairn_boundary *b);
int cairn_boundary_cuts_next(cairn_boundary *b);
int32_t cairn_boundary_cuts_cost(const cairn_boundary *b);
/* Regions and borders become what they were before they were joined, and afterwards say at which
 * level they were; one of them. 0: it was the last one. */
int cairn_boundary_clear_next(cairn_boundary *b);
int cairn_boundary_tell_next(cairn_boundary *b);
/* 1: borders are joined once more after this way. */
int cairn_boundary_has_ways(const cairn_boundary *b);
/* What the next border's way into the heap or the next joint costs; 0: there is none. */
int32_t cairn_boundary_join_cost(const cairn_boundary *b);
void cairn_boundary_join_next(cairn_boundary *b);
/* The border between two regions, as found. */
int32_t cairn_boundary_border_of(const cairn_boundary *b, int32_t p, int32_t q);

/* One side of a pixel. CAIRN_MORE: there is more. CAIRN_FULL. */
cairn_status cairn_boundary_trace_side(cairn_boundary *b);
/* One contour. 0: all are ranked. */
int cairn_boundary_rank_next(cairn_boundary *b);

#endif
