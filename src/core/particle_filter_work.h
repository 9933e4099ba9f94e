/* What the files of the particle filter share: the tree of histories, the populations, and the
 * state between steps. */
#ifndef CAIRN_CORE_PARTICLE_FILTER_WORK_H
#define CAIRN_CORE_PARTICLE_FILTER_WORK_H

#include "cairn/particle_filter.h"

enum { FILTER_BYTES_PER_UNIT = 512 };

/* Logarithms below are those of 0. */
#define FILTER_IMPOSSIBLE (-CAIRN_REAL_MAX / 4)

typedef struct filter_node {
    struct filter_node *parent;
    int32_t references;
    int32_t depth;
} filter_node;

/* From a node to its state. */
#define FILTER_HEADER ((sizeof(filter_node) + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN)

typedef struct filter_particle {
    filter_node *leaf;
    cairn_real log_weight;
    cairn_real log_likelihood;
    int32_t born; /* in order of birth, which breaks ties */
} filter_particle;

typedef struct filter_population {
    filter_particle *list; /* [max_particles] */
    int32_t count;
} filter_population;

typedef struct filter_candidate {
    cairn_real log_prior;
    cairn_real log_likelihood;
} filter_candidate;

/* Residual sampling: copies[k] for `left` draws by mass[k] / total. */
typedef struct filter_sampler {
    cairn_real total, rest;
    int32_t count, wanted, left, cursor;
    int32_t last; /* that has a residual */
} filter_sampler;

typedef int32_t filter_phase;
enum {
    FILTER_IDLE,
    FILTER_PROPOSE,
    FILTER_PRIORS,
    FILTER_WEIGH,
    FILTER_MASSES,
    FILTER_DRAW,
    FILTER_FOLLOW,
    FILTER_NEXT,
    FILTER_SUM,
    FILTER_NORMALISE,
    FILTER_RESAMPLE,
    FILTER_COPY,
    FILTER_RELEASE
};

struct cairn_particle_filter {
    cairn_particle_filter_params params;
    cairn_particle_model model;
    cairn_random random;
    cairn_block_pool *blocks;
    filter_population now, next, spare;
    /* [max_candidates] */
    filter_candidate *candidates;
    /* [max_candidates] of `stride` bytes */
    unsigned char *states;
    /* [max_particles + 1]: candidates of particle i are first[i] ... first[i + 1] - 1 */
    int32_t *first;
    /* [max_candidates or max_particles, whichever is more] */
    cairn_real *mass;
    /* likewise */
    int32_t *copies;
    size_t stride;

    filter_phase phase;
    int32_t proposing;              /* 1: within propose, when offers are welcome */
    int32_t begun;                  /* 1: no more first particles */
    int32_t index, cursor;          /* particle and candidate under way */
    int32_t alive;                  /* candidates of the group that are possible */
    int32_t wanted;                 /* followers of the group */
    int32_t drawn;                  /* 1: they are drawn; 0: all candidates follow */
    cairn_real top, total, entropy; /* of the masses that are being added up */
    cairn_real group;               /* log of the sum of prior mass times likelihood */
    cairn_real heaviest;            /* log weight of all followers */
    int32_t heaviest_at;            /* its place among the followers */
    cairn_real squares;
    filter_sampler sample;
    int32_t born, paid;
    int32_t entered;      /* 1: a call of the model is paid */
    filter_node *falling; /* to lose a reference */
    cairn_status outcome; /* of the step, once that is done */
    cairn_particle_trace trace, done;
};

static inline void *filter_state(filter_node *n)
{
    return (unsigned char *)n + FILTER_HEADER;
}

/* Takes a reference from a node. When that was the last one the node goes, and its parent, which
 * is returned, loses one. */
filter_node *cairn_particle_node_drop(cairn_particle_filter *f, filter_node *n);

/* 1 when a goes before b. */
int cairn_particle_is_lighter(const filter_particle *a, const filter_particle *b);

/* Adds a follower of particle f->index, in place of the lightest when the population is full.
 * CAIRN_FULL: no block. */
cairn_status cairn_particle_follow(cairn_particle_filter *f, filter_particle follower,
                                   filter_node *parent, const void *state);

#endif
