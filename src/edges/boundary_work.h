/* Internal structures of module boundary. */
#ifndef CAIRN_EDGES_BOUNDARY_WORK_H
#define CAIRN_EDGES_BOUNDARY_WORK_H

#include "cairn/boundary.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_boundary_parameters;

enum { BOUNDARY_CHANNELS = 3, BOUNDARY_LEVELS = 4096 };
/* Histogram bins of a region for channels L, a and b, and their total. */
enum {
    BOUNDARY_L_BINS = 9,
    BOUNDARY_AB_BINS = 7,
    BOUNDARY_BINS = BOUNDARY_L_BINS + 2 * BOUNDARY_AB_BINS
};
/* Upper bound of the borders per region of a planar graph, and of the border chains between
 * junctions. Counting the image's border, every junction has degree three. With V junctions, E
 * chains and C connected components: 3 V <= 2 E, and Euler's formula V - E + regions = C gives E
 * <= 3 regions. */
enum { BOUNDARY_BORDERS_PER_REGION = 3 };
/* Number of vectors of the subspace iteration. */
enum { BOUNDARY_BLOCK_SIZE = 12 };
/* Values of a and b beyond this are counted in the outermost bins. */
#define BOUNDARY_MAX_AB CAIRN_REAL(45.0)

/* The common border of two regions. Sides 0 and 1 of border e are the half-borders 2 e and 2 e +
 * 1, each in the list of its region. */
typedef struct boundary_border {
    /* Initial regions, the smaller index first: the key of the hash table. */
    int32_t initial_region[2];
    /* Current regions. */
    int32_t region[2];
    /* Doubly linked list of the half-borders of the same region; -1: none. */
    int32_t next[2], previous[2];
    /* Length in pixel sides: initially, and with the borders merged into it. */
    int32_t initial_length, length;
    /* Index in the heap; -1: not in the heap. */
    int32_t heap_index;
    /* The border into which it was merged; itself if not merged. */
    int32_t merged_into;
    /* Mean edge strength before merging, including the spectral cue. */
    cairn_real strength;
    /* Sum of edge strengths along the border. */
    cairn_real strength_sum;
    /* Sum of the logarithms of its levels over the merge criteria. */
    cairn_real log_level_sum;
    /* Heap key (merge cost); in the spectral stage the affinity or the spectral strength. */
    cairn_real key;
    /* Ultrametric level: merge cost at which both sides became one region. */
    cairn_real level;
} boundary_border;

typedef struct boundary_region {
    int32_t first_half_border; /* First half-border of the region; -1: none. */
    int32_t initial_size;      /* Pixels before merging. */
    int32_t size;              /* Pixels including the merged regions. */
    int32_t border_count;      /* Number of borders. */
    int32_t marked_border;     /* Border with the region that is being merged; -1: none. */
    cairn_real size_factor;    /* Share of the image to the power of the size exponent. */
} boundary_region;

/* Structure tensor of a pixel. */
typedef struct boundary_tensor {
    cairn_real xx, xy, yy;
} boundary_tensor;

/* Edge strengths: filters of the feature maps. */
typedef struct boundary_filter {
    cairn_real *scratch;     /* [pixels] Filtered copy of the feature map. */
    boundary_tensor *tensor; /* [pixels] */
    cairn_real *row_buffer;  /* [2][max_width] Filtered row, running column sums. */
    /* Current feature map, image row and filter pass. */
    int32_t map_index, row, pass;
    int32_t is_nonzero; /* 1: the current feature map has a non-zero value. */
} boundary_filter;

/* Regions: a watershed, which floods level after level; their borders, row by row. */
typedef struct boundary_flood {
    /* [pixels] Next pixel of the same queue, and of the same strength level. */
    int32_t *next_in_queue, *next_of_level;
    /* [BOUNDARY_LEVELS] Queue of each level; queue_tail: before the flooding the last pixel of
     * the level. */
    int32_t *queue_head, *queue_tail;
    /* [BOUNDARY_LEVELS] First pixel of each strength level. */
    int32_t *level_first;
    /* Current strength level, image row. */
    int32_t level, row;
} boundary_flood;

/* Merging of the regions. */
typedef struct boundary_merge {
    /* [max_regions][BOUNDARY_BINS] Colour histogram of each region, initially and currently. */
    cairn_real *initial_histogram, *histogram;
    cairn_real level; /* Greatest merge cost so far. */
    /* Next border to insert into the heap; next region or border to reset or record. */
    int32_t cursor;
    int32_t criterion; /* Index of the current merge criterion. */
} boundary_merge;

/* Spectral cue: eigenvectors of the affinities by subspace iteration. */
typedef struct boundary_spectral {
    /* [max_regions] 1 / sqrt(degree) of each region in the affinity graph. */
    cairn_real *inverse_sqrt_degree;
    /* [BOUNDARY_BLOCK_SIZE + 2][region_count] Vectors of the subspace iteration and two work
     * vectors. */
    cairn_real *vectors;
    cairn_real projected_matrix[BOUNDARY_BLOCK_SIZE][BOUNDARY_BLOCK_SIZE],
        eigenbasis[BOUNDARY_BLOCK_SIZE][BOUNDARY_BLOCK_SIZE];
    cairn_real eigenvalue[BOUNDARY_BLOCK_SIZE]; /* In decreasing order. */
    /* Mean border strength; upper bound of the eigenvalues that the polynomial damps. */
    cairn_real mean_strength, damping_bound;
    /* Iteration, current vector, term of the recurrence. */
    int32_t iteration, vector_index, chebyshev_term;
} boundary_spectral;

/* Contours: their tracing around the regions. */
typedef struct boundary_trace {
    cairn_real strength_sum; /* Sum of the edge strengths along the traced contour. */
    /* Current corner of a traced contour; heading 0 ... 3: right, down, left, up. */
    int32_t x, y, heading;
    int32_t is_open; /* 1: the contour has not ended. */
    /* Corner at which contour starts are sought. */
    int32_t scan_x, scan_y;
    int32_t is_closed_pass; /* 1: second pass, only closed contours remain. */
} boundary_trace;

/* [max_borders] of an array: BOUNDARY_BORDERS_PER_REGION * max_regions. */
struct cairn_boundary {
    /* Resume points of the detection and of a phase. */
    int32_t resume, phase_resume;
    /* Work units charged for the next work item. */
    int32_t units_charged;
    /* CAIRN_FULL: more than max_corners. */
    cairn_status outcome;

    /* The image, and its colour channels. Arrays [pixels] have rows of its width, without
     * padding. */
    cairn_boundary_image image;
    int32_t channels;
    /* 1: an image was begun and is not done; 1: the result is complete. */
    int32_t is_running, is_complete;

    /* What the phases pass on to each other. */
    int32_t table_size;
    cairn_real *colour; /* [BOUNDARY_CHANNELS][pixels] */
    /* [pixels] Feature map; finally the edge strengths. */
    cairn_real *strength;
    /* [pixels] Region index; -1: unlabelled. */
    int32_t *label;
    /* [max_regions] */
    boundary_region *regions;
    /* [max_borders] */
    boundary_border *borders;
    /* [table_size] Hash table of borders by their initial regions; -1: free. */
    int32_t *border_table;
    /* [max_borders] Binary heap of borders by key, then of contours by strength. */
    int32_t *heap;
    /* [pixels] Flags of traced sides: upper side 1, left side 2. */
    uint8_t *traced_sides;
    cairn_boundary_contour *traced; /* [max_borders] */
    int32_t region_count, border_count, heap_count, contour_count;

    /* Each of one phase. */
    boundary_filter filter;
    boundary_flood flood;
    boundary_merge merge;
    boundary_spectral spectral;
    boundary_trace trace;

    /* The result. */
    cairn_boundary_contour *ranked; /* [max_borders] */
    cairn_boundary_corner *corners; /* [max_corners] */
    int32_t corner_count, ranked_count;
    cairn_real linear[256]; /* Linear intensity of an sRGB sample, 0 ... 1. */
    cairn_boundary_params params;
};

/* Number of pixels of the image. */
static inline int32_t boundary_pixels(const cairn_boundary *boundary)
{
    return boundary->image.width * boundary->image.height;
}

/* Returns the quotient of two positive integers, rounded up. */
static inline int32_t boundary_ceil_divide(int32_t n, int32_t of)
{
    return (n + of - 1) / of;
}

/* Clears the lists of the watershed. */
void cairn_boundary_flood_begin(cairn_boundary *boundary);

/* Appends the pixels of a row to the lists of their strength levels. */
void cairn_boundary_flood_row(cairn_boundary *boundary, int32_t row);

/* Returns the current border between two initial regions. */
int32_t cairn_boundary_border_of(const cairn_boundary *boundary, int32_t p, int32_t q);

/* Returns 1 if the current run of the merging has a criterion, 0 for the last one, which has the
 * mean of their levels. */
int cairn_boundary_has_criterion(const cairn_boundary *boundary);

/* ---- Phases: each is a step that returns 1 when done, 0 when the budget is used up ---- */

/* Edge strengths, and the lists of the pixels of each strength level. */
int cairn_boundary_measure(cairn_boundary *boundary, cairn_budget *budget);

/* Watershed: the regions. */
int cairn_boundary_flood(cairn_boundary *boundary, cairn_budget *budget);

/* Borders of the regions, and their colour histograms. */
int cairn_boundary_collect_borders(cairn_boundary *boundary, cairn_budget *budget);

/* Strengths of the borders, with the spectral cue. */
int cairn_boundary_add_spectral(cairn_boundary *boundary, cairn_budget *budget);

/* Regions and borders as before merging. */
int cairn_boundary_reset(cairn_boundary *boundary, cairn_budget *budget);

/* Levels of the borders by the current criterion. */
int cairn_boundary_merge(cairn_boundary *boundary, cairn_budget *budget);

/* Adds the levels to those of the other criteria. */
int cairn_boundary_record(cairn_boundary *boundary, cairn_budget *budget);

/* Contours; sets the outcome. */
int cairn_boundary_trace(cairn_boundary *boundary, cairn_budget *budget);

/* Contours by decreasing strength. */
int cairn_boundary_rank(cairn_boundary *boundary, cairn_budget *budget);

#endif
