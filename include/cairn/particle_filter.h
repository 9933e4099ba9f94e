/* particle_filter: sequential importance resampling (SIR) over any state, Rao-Blackwellized where
 * the caller's callbacks work out the rest of the posterior themselves.
 *
 * A particle is a history of states of the caller's own, a weight, and nothing else. One step goes
 * from every particle to its followers: `propose` offers candidates with their prior masses,
 * `likelihood` weighs them by the new observation, some are drawn, `append` makes each drawn one
 * the next state of a history. Particles that share a past share it in memory: the histories are a
 * tree of blocks with reference counts.
 *
 *     clear(seed) -> start(state) for each first particle -> begin() -> step(budget) until
 *     CAIRN_OK -> read(), begin() ... */
#ifndef CAIRN_PARTICLE_FILTER_H
#define CAIRN_PARTICLE_FILTER_H

#include "cairn/pool.h"
#include "cairn/random.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_particle_filter cairn_particle_filter;

typedef int32_t cairn_particle_proposal;
enum {
    /* candidates are drawn by their prior mass; only those that are drawn are weighed */
    CAIRN_PROPOSAL_PRIOR = 0,
    /* all are weighed, and drawn by prior mass times likelihood */
    CAIRN_PROPOSAL_OPTIMAL = 1
};

typedef struct cairn_particle_filter_params {
    /* N: so many after resampling, 1 ... 2^20 */
    int32_t particles;
    /* >= particles, <= 2^20: so many live on while the weights are even; beyond it the lightest
     * go */
    int32_t max_particles;
    /* of one particle in one step, 1 ... 2^20 */
    int32_t max_followers;
    /* of all particles in one step, 1 ... 2^20 */
    int32_t max_candidates;
    /* states in all histories together, the next ones included, 1 ... 2^28 */
    int32_t max_blocks;
    /* of one state, 1 ... 2^20; states are aligned to CAIRN_ALIGN */
    int32_t state_bytes;
    cairn_particle_proposal proposal;
    /* 1: a particle has exp(H) followers, rounded up, at most max_followers, where H is the
     * entropy of what they are drawn from: as many as it has modes */
    int32_t by_entropy;
    /* states of a history that are kept behind its last one, 1 ... 2^20; 0: all of them */
    int32_t past;
    /* share of N, 0 ... 1: resampled when N_eff is below it */
    cairn_real resample_below;
} cairn_particle_filter_params;

/* 100 particles, as many at most, 8 followers, 4096 candidates, 4096 blocks of 64 bytes, optimal
 * proposal, followers by entropy, the whole past, resampled below one half. (past + 2)
 * max_particles blocks are enough for any number of steps, if past is not 0. */
cairn_particle_filter_params cairn_particle_filter_default(void);

/* Offers the candidates of particle `index`. CAIRN_OK: all are offered. CAIRN_MORE: the budget
 * is used up, call again. Negative: the step ends with this status. Called for all particles in
 * turn before any candidate is weighed, so that scores may be normalised over all of them. */
typedef cairn_status (*cairn_particle_propose)(void *context, cairn_particle_filter *filter,
                                               int32_t index, cairn_budget *budget);

/* The logarithm of p(observation | history of particle `index`, state); -infinity (or less than
 * -CAIRN_REAL_MAX / 4): impossible. Statuses as above. */
typedef cairn_status (*cairn_particle_likelihood)(void *context,
                                                  const cairn_particle_filter *filter,
                                                  int32_t index, const void *state,
                                                  cairn_real *log_likelihood, cairn_budget *budget);

/* Completes a state that becomes part of a history. */
typedef void (*cairn_particle_append)(void *context, const cairn_particle_filter *filter,
                                      int32_t index, void *state);

/* Particle `index` has no follower and goes; its history can still be read. */
typedef void (*cairn_particle_lost)(void *context, const cairn_particle_filter *filter,
                                    int32_t index);

/* What the filter is about. A state that is given is at an address of its own, aligned, and may
 * not be kept. Callbacks may read the filter; of those that change it only offer() may be
 * called, and only by propose. */
typedef struct cairn_particle_model {
    void *context;
    cairn_particle_propose propose;
    cairn_particle_likelihood likelihood;
    cairn_particle_append append; /* NULL: nothing to do */
    cairn_particle_lost lost;     /* NULL: nobody asks */
} cairn_particle_model;

/* 0 for params that create() would refuse. */
size_t cairn_particle_filter_memory(const cairn_particle_filter_params *params);

/* The model is copied. CAIRN_BAD_ARGUMENT (also a model without propose or likelihood),
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_particle_filter_create(cairn_particle_filter **filter,
                                                        cairn_pool *pool,
                                                        const cairn_particle_filter_params *params,
                                                        const cairn_particle_model *model);

/* Forgets all particles and begins a new run. CAIRN_BAD_ARGUMENT: NULL. Linear in the blocks in
 * use. */
CAIRN_CHECKED cairn_status cairn_particle_filter_clear(cairn_particle_filter *filter,
                                                       uint64_t seed);

/* Adds a first particle; the state is copied. Weights need not add up to 1. CAIRN_BAD_ARGUMENT:
 * NULL, or after begin(). CAIRN_NOT_FINITE: the log weight. CAIRN_FULL: max_particles or
 * max_blocks. Constant time. */
CAIRN_CHECKED cairn_status cairn_particle_filter_start(cairn_particle_filter *filter,
                                                       const void *state, cairn_real log_weight);

/* Begins the next step; one under way must have ended. CAIRN_BAD_ARGUMENT: NULL, or a step is
 * under way. CAIRN_EMPTY: no particles. */
CAIRN_CHECKED cairn_status cairn_particle_filter_begin(cairn_particle_filter *filter);

/* For propose alone: offers a candidate of the particle that it was called for; the state is
 * copied. Masses are divided by their sum over the particle. -infinity is a mass of 0.
 * CAIRN_BAD_ARGUMENT: NULL, or not in propose. CAIRN_NOT_FINITE: NaN or +infinity. CAIRN_FULL:
 * max_candidates; the candidate is left out, which read() counts. */
CAIRN_CHECKED cairn_status cairn_particle_filter_offer(cairn_particle_filter *filter,
                                                       const void *state, cairn_real log_mass);

/* CAIRN_OK: the step has ended, or none was begun. CAIRN_MORE: go on. CAIRN_FULL: max_blocks;
 * CAIRN_NOT_FINITE: a likelihood that is NaN or +infinity; or the status of a callback: the step
 * is undone, the particles are as they were before it. Costs what the callbacks take, three
 * units a particle and two when it is resampled, seven a candidate, a unit a follower and one
 * for each 512 bytes of its state. */
CAIRN_CHECKED cairn_status cairn_particle_filter_step(cairn_particle_filter *filter,
                                                      cairn_budget *budget);

/* ---- Reading: the last step that ended ---- */

typedef struct cairn_particle {
    const void *state;         /* the last one of its history; valid until the next step ends */
    cairn_real log_weight;     /* normalised after a step */
    cairn_real log_likelihood; /* the sum along its own history, whatever was resampled */
    int32_t steps;             /* behind it: states of its history less one */
} cairn_particle;

int32_t cairn_particle_filter_count(const cairn_particle_filter *filter);

/* All zero when there is no such particle. */
cairn_particle cairn_particle_filter_particle(const cairn_particle_filter *filter, int32_t index);

/* The state before a given one of a history; NULL before the first that is kept. Constant time. */
const void *cairn_particle_state_before(const void *state);

/* What the last step was. */
typedef struct cairn_particle_trace {
    int32_t steps;           /* so far */
    int32_t resamplings;     /* so far */
    int32_t particles;       /* now */
    int32_t best;            /* the heaviest one (ties: the lower index) */
    int32_t candidates;      /* offered */
    int32_t left_out;        /* offered beyond max_candidates */
    int32_t followers;       /* drawn */
    int32_t cut;             /* of these beyond max_particles: the lightest */
    int32_t lost;            /* particles without a follower */
    int32_t extinct;         /* 1: no particle had one; they have all stayed as they were */
    int32_t resampled;       /* 1: N_eff was below the limit */
    cairn_real n_eff;        /* before resampling */
    cairn_real log_evidence; /* of all observations so far: the sum of log sum_i w_i p(z | ...) */
    int32_t blocks, blocks_peak;
} cairn_particle_trace;

cairn_particle_trace cairn_particle_filter_read(const cairn_particle_filter *filter);

#ifdef __cplusplus
}
#endif

#endif
