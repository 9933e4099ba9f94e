/* Internals of the module particle_filter, shared by particle_filter.c (object, histories,
 * populations) and particle_filter_step.c (the step). */
#ifndef CAIRN_NUMERICS_PARTICLE_FILTER_WORK_H
#define CAIRN_NUMERICS_PARTICLE_FILTER_WORK_H

#include "cairn/particle_filter.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_particle_filter_parameters;

/* Bytes of a state that are copied for one work unit. */
enum { PARTICLE_FILTER_BYTES_PER_UNIT = 512 };

/* Logarithms up to this value are those of 0. */
#define PARTICLE_FILTER_IMPOSSIBLE (-CAIRN_REAL_MAX / 4)

/* Node of the tree of histories; the state of the caller follows in memory. */
typedef struct particle_filter_node {
    /* Node of the state before, NULL: none is kept. */
    struct particle_filter_node *parent;
    /* Number of children, and of particles whose history ends here. */
    int32_t references;
    /* Steps since the first state of the history. */
    int32_t depth;
} particle_filter_node;

/* Bytes from a node to its state. */
#define PARTICLE_FILTER_HEADER                                                                     \
    ((sizeof(particle_filter_node) + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN)

/* Particle. */
typedef struct particle_filter_particle {
    /* Node of the last state of its history. */
    particle_filter_node *leaf;
    /* Logarithm of the weight, in nats. */
    cairn_real log_weight;
    /* Sum of the log-likelihoods along the history, in nats. */
    cairn_real log_likelihood;
    /* Number in order of creation, which breaks ties. */
    int32_t birth_number;
} particle_filter_particle;

/* Population of particles. */
typedef struct particle_filter_population {
    /* [max_particles] Particles. */
    particle_filter_particle *list;
    int32_t count;
} particle_filter_population;

/* Candidate. */
typedef struct particle_filter_candidate {
    /* Logarithm of the prior mass. */
    cairn_real log_prior;
    /* Log-likelihood, in nats. */
    cairn_real log_likelihood;
} particle_filter_candidate;

/* Masses relative to the largest one, and their sum (log-sum-exp). */
typedef struct particle_filter_masses {
    /* [max(max_candidates, max_particles)] Masses; then running sums of residuals, see below. */
    cairn_real *mass;
    /* Largest logarithm of the masses that are summed, their sum relative to it, the logarithm of
     * the sum, and the unnormalized entropy. */
    cairn_real max_log, sum, log_sum, entropy;
} particle_filter_masses;

/* Residual sampling. */
typedef struct particle_filter_drawing {
    /* [max(max_candidates, max_particles)] Number of copies drawn. */
    int32_t *copies;
    /* Running sum of the residuals, draws left, and last item with a residual. */
    cairn_real residual_sum;
    int32_t draws_left, last_residual;
} particle_filter_drawing;

/* From the candidates of a particle to its followers. */
typedef struct particle_filter_following {
    int32_t resume;
    /* Candidates with a mass above 0. */
    int32_t possible_count;
    /* Followers to draw, and followers created. */
    int32_t follower_count, created_count;
    /* 1: followers are drawn; 0: every candidate becomes a follower. */
    int32_t is_drawn;
} particle_filter_following;

struct cairn_particle_filter {
    cairn_particle_filter_params params;
    cairn_particle_filter_model model;
    cairn_random random;
    /* Nodes with their states. */
    cairn_block_pool *blocks;
    /* Bytes of a state, rounded up to CAIRN_ALIGN. */
    size_t state_stride;
    /* 1: the first step has begun, and no initial particles are accepted. */
    int32_t has_begun;
    /* 1: a step has begun and not ended. */
    int32_t is_running;

    /* What readers see: population, and statistics of the last step. */
    particle_filter_population current;
    cairn_particle_filter_trace last_trace;

    /* ---- Of a step ---- */
    cairn_particle_filter_trace step_trace;
    /* Followers, and population resampled from them. */
    particle_filter_population next, resampled;
    /* [max_candidates] Candidates of all particles. */
    particle_filter_candidate *candidates;
    /* [max_candidates] States of the candidates, of `state_stride` bytes each. */
    unsigned char *states;
    /* [max_particles + 1] Candidates of particle i are first_candidate[i] ... first_candidate[i +
     * 1] - 1. */
    int32_t *first_candidate;
    /* Node that loses a reference next. */
    particle_filter_node *node_to_release;
    /* Status of the step, returned when the step ends. */
    cairn_status outcome;
    /* Resume points of the step, and of a phase; units charged for the next operation so far. */
    int32_t resume, phase_resume, units_charged;
    /* 1: within propose, which may offer candidates. */
    int32_t is_proposing;
    /* Current particle, and current item of a phase. */
    int32_t index, cursor;
    /* Particles created in this step. */
    int32_t birth_count;
    /* Index of the follower with the largest weight. */
    int32_t max_weight_index;
    /* Largest log weight of all followers, and sum of the squared weights. */
    cairn_real max_log_weight, squared_weights;

    /* ---- Of a phase ---- */
    particle_filter_following follow;
    particle_filter_masses masses;
    particle_filter_drawing drawing;
};

/* State of a node. */
static inline void *particle_filter_state(particle_filter_node *node)
{
    return (unsigned char *)node + PARTICLE_FILTER_HEADER;
}

/* Removes a reference from a node. If it was the last one, the node is freed and its parent, which
 * loses a reference next, is returned; else NULL. */
particle_filter_node *cairn_particle_filter_drop_node(cairn_particle_filter *filter,
                                                      particle_filter_node *node);

/* 1 when a has a lower weight than b; of equal weights the later one is lighter. */
int cairn_particle_filter_is_lighter(const particle_filter_particle *a,
                                     const particle_filter_particle *b);

/* Adds a follower of the current particle; replaces the lightest one when the population is full.
 * CAIRN_FULL: no block is free. */
cairn_status cairn_particle_filter_add_follower(cairn_particle_filter *filter,
                                                particle_filter_particle follower,
                                                particle_filter_node *parent, const void *state);

#endif
