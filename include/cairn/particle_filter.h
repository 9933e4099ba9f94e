/* particle_filter: particle filter by sequential importance resampling (SIR) over any state.
 * Rao-Blackwellized when the caller's callbacks compute the rest of the posterior in closed form.
 *
 * A particle is a weight and a history of states of the caller. A step extends every particle to
 * its followers (offspring). `propose` offers candidate states with their prior masses (the motion
 * model). `likelihood` weights the candidates by the new observation. Followers are drawn among the
 * candidates. `append` completes a drawn state, which becomes the last state of a history.
 * Particles with a common past share the past in memory: the histories are a tree of blocks with
 * reference counts.
 *
 *     clear(seed) -> start(state) for each first particle -> begin() -> step(budget) until
 *     CAIRN_OK -> read(), begin() ... */
#ifndef CAIRN_PARTICLE_FILTER_H
#define CAIRN_PARTICLE_FILTER_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/random.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Particle filter. */
typedef struct cairn_particle_filter cairn_particle_filter;

/* Proposal distribution, from which followers are drawn. */
typedef int32_t cairn_particle_filter_proposal;
enum {
    /* Prior proposal: candidates are drawn by prior mass, and only drawn ones are weighted by their
     * likelihood. */
    CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR = 0,
    /* Optimal proposal: all candidates are weighted, and drawn by prior mass times likelihood. */
    CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL = 1,
    /* Prior boosting: candidates are drawn by prior mass, each at most once as a follower. Its
     * weight is that of the particle times its likelihood. When the prior mass is to count in the
     * weights, the likelihood has to include it. Copies of a resampled particle remain one particle
     * of their total weight, so that all particles differ. */
    CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED = 2
};

/* Parameters; defaults in brackets. */
typedef struct cairn_particle_filter_params {
    /* 1 ... 2^20 (100): N: number of particles after resampling */
    int32_t particles;
    /* particles ... 2^20 (100): largest number of particles while no resampling is needed. Of more
     * followers those with the lowest weights are discarded. */
    int32_t max_particles;
    /* 1 ... 2^20 (8): followers per particle and step */
    int32_t max_followers;
    /* 1 ... 2^20 (4096): candidates of all particles in a step */
    int32_t max_candidates;
    /* 1 ... 2^28 (4096): blocks (states) in all histories together, those of the step that runs
     * included. (max_history + 2) max_particles blocks suffice for any number of steps when
     * max_history is not 0. */
    int32_t max_blocks;
    /* 1 ... 2^20 (64): bytes of a state. States are aligned to CAIRN_ALIGN. */
    int32_t state_bytes;
    /* any (CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL): proposal distribution */
    cairn_particle_filter_proposal proposal;
    /* 0 or 1 (1): 1: a particle has exp(H) followers, rounded up, at most max_followers, where H is
     * the entropy of the distribution from which the followers are drawn: one per mode. 0:
     * max_followers. */
    int32_t adaptive_followers;
    /* 0 ... 2^20 (0): states of a history that are kept before the last one; 0: all states */
    int32_t max_history;
    /* 0 ... 1 (0.5): the population is resampled when N_eff is below this fraction of N */
    cairn_real resample_ratio;
} cairn_particle_filter_params;

/* Returns the default parameters. */
cairn_particle_filter_params cairn_particle_filter_default(void);

/* Motion model: offers the candidates of particle `index` by cairn_particle_filter_offer().
 * CAIRN_OK: all candidates are offered. CAIRN_MORE: the budget is used up, call again (for the same
 * particle; candidates offered so far stay). Negative: the step ends with this status and is
 * undone, so CAIRN_FULL of offer() (one candidate is lost) is not to be passed on. Called for all
 * particles in turn before any candidate is weighted, so scores may be normalized over all
 * particles.
 *
 * context: that of the model
 * index: index of the particle */
typedef cairn_status (*cairn_particle_filter_propose)(void *context, cairn_particle_filter *filter,
                                                      int32_t index, cairn_budget *budget);

/* Observation model: sets *log_likelihood to ln p(observation | history of particle `index`,
 * state), in nats; -infinity (or less than -CAIRN_REAL_MAX / 4): impossible. Statuses as for
 * propose.
 *
 * context: that of the model
 * index: index of the particle
 * state: [state_bytes] the candidate
 * log_likelihood: set to the log-likelihood, nats */
typedef cairn_status (*cairn_particle_filter_likelihood)(void *context,
                                                         const cairn_particle_filter *filter,
                                                         int32_t index, const void *state,
                                                         cairn_real *log_likelihood,
                                                         cairn_budget *budget);

/* Completes a drawn state when it becomes the last state of a history.
 *
 * context: that of the model
 * index: particle that the history belongs to
 * state: [state_bytes] the drawn state, to be completed */
typedef void (*cairn_particle_filter_append)(void *context, const cairn_particle_filter *filter,
                                             int32_t index, void *state);

/* Reports that particle `index` has no follower and is discarded; its history can still be read.
 * Statuses as for propose.
 *
 * context: that of the model
 * index: index of the particle */
typedef cairn_status (*cairn_particle_discard)(void *context, const cairn_particle_filter *filter,
                                               int32_t index, cairn_budget *budget);

/* The caller's model. The states passed to callbacks are aligned, and their addresses are valid
 * only during the call. Callbacks may read the filter. Of the functions that change the filter only
 * offer() may be called, and only by propose. */
typedef struct cairn_particle_filter_model {
    /* Passed to all callbacks. */
    void *context;
    /* Motion model. */
    cairn_particle_filter_propose propose;
    /* Observation model. */
    cairn_particle_filter_likelihood likelihood;
    /* NULL: states need no completion. */
    cairn_particle_filter_append append;
    /* NULL: discarded particles are not reported. */
    cairn_particle_discard discard;
} cairn_particle_filter_model;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_particle_filter_check(const cairn_particle_filter_params *params,
                                                       cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_particle_filter_memory(const cairn_particle_filter_params *params);

/* Creates a filter without particles; the model is copied. CAIRN_BAD_ARGUMENT (also a model without
 * propose or likelihood), CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_particle_filter_create(cairn_particle_filter **filter,
                                                        cairn_pool *pool,
                                                        const cairn_particle_filter_params *params,
                                                        const cairn_particle_filter_model *model);

/* Removes all particles and begins a new run, with random numbers of `seed`. CAIRN_BAD_ARGUMENT:
 * NULL. Cost: linear in the blocks in use.
 *
 * seed: any number */
CAIRN_CHECKED cairn_status cairn_particle_filter_clear(cairn_particle_filter *filter,
                                                       uint64_t seed);

/* Adds an initial particle; the state is copied. Weights need not add up to 1. CAIRN_BAD_ARGUMENT:
 * NULL, or begin() was called. CAIRN_NOT_FINITE: the log weight. CAIRN_FULL: max_particles or
 * max_blocks. Constant time.
 *
 * state: [state_bytes] first state of the history
 * log_weight: logarithm of the weight, finite */
CAIRN_CHECKED cairn_status cairn_particle_filter_start(cairn_particle_filter *filter,
                                                       const void *state, cairn_real log_weight);

/* Begins the next step of the filter. CAIRN_BAD_ARGUMENT: NULL, or the last step has not ended.
 * CAIRN_EMPTY: no particles. Constant time. */
CAIRN_CHECKED cairn_status cairn_particle_filter_begin(cairn_particle_filter *filter);

/* Offers a candidate of the current particle; only for calls by propose. The state is copied.
 * log_mass: logarithm of the prior mass; masses are normalized per particle, -infinity is a mass of
 * 0. CAIRN_BAD_ARGUMENT: NULL, or not called by propose. CAIRN_NOT_FINITE: NaN or +infinity.
 * CAIRN_FULL: max_candidates; the candidate is dropped and counted in the trace. Cost: linear in
 * state_bytes.
 *
 * state: [state_bytes] the candidate */
CAIRN_CHECKED cairn_status cairn_particle_filter_offer(cairn_particle_filter *filter,
                                                       const void *state, cairn_real log_mass);

/* Works on the step until the budget is used up. CAIRN_OK: the step has ended, or no step was
 * begun. CAIRN_MORE: call again. CAIRN_FULL (max_blocks), CAIRN_NOT_FINITE (a likelihood is NaN or
 * +infinity), or the status of a callback: the step is undone, and the particles are as before the
 * step. Cost: the cost of the callbacks; per particle three units, and two when resampled; per
 * candidate seven; per follower one, and one per 512 bytes of the state. */
CAIRN_CHECKED cairn_status cairn_particle_filter_step(cairn_particle_filter *filter,
                                                      cairn_budget *budget);

/* ---- Results of the last step that ended ---- */

/* Particle. */
typedef struct cairn_particle {
    /* Last state of the history; valid until the next step ends. */
    const void *state;
    /* Logarithm of the weight, in nats; normalized after a step. */
    cairn_real log_weight;
    /* Sum of the log-likelihoods along the history, in nats, not changed by resampling. */
    cairn_real log_likelihood;
    /* Number of steps of the history: its states minus one. */
    int32_t steps;
} cairn_particle;

/* Number of particles. */
int32_t cairn_particle_filter_count(const cairn_particle_filter *filter);

/* A particle, by index from 0. All zero when there is no such particle. */
cairn_particle cairn_particle_filter_particle(const cairn_particle_filter *filter, int32_t index);

/* The state before a state of a history; NULL before the first one that is kept. Constant time.
 *
 * state: state of a history */
const void *cairn_particle_filter_state_before(const void *state);

/* Returns a state of a particle's history for changes: the last one when `after` is NULL, else the
 * one before `after`, which an earlier call returned. When other histories share it, the particle
 * gets a copy of its own. NULL: no such particle or state, a step is running, or no block is free.
 * As many blocks as the histories have states together suffice. Cost: linear in state_bytes.
 *
 * index: index of the particle
 * after: the state after it; NULL: the last one */
void *cairn_particle_filter_own_state(cairn_particle_filter *filter, int32_t index, void *after);

/* Statistics of the last step. */
typedef struct cairn_particle_filter_trace {
    /* Steps of the run so far. */
    int32_t steps;
    /* Resamplings of the run so far. */
    int32_t resamplings;
    /* Number of particles. */
    int32_t particles;
    /* Index of the particle with the largest weight; of equal weights the lowest index. */
    int32_t best;
    /* Candidates offered. */
    int32_t candidates;
    /* Candidates dropped because of max_candidates. */
    int32_t dropped_candidates;
    /* Followers drawn. */
    int32_t followers;
    /* Followers of the lowest weights, discarded because of max_particles. */
    int32_t pruned_followers;
    /* Particles without a follower. */
    int32_t particles_without_follower;
    /* 1: no particle had a follower, and all particles stayed as they were (particle
     * depletion). */
    int32_t depleted;
    /* 1: the population was resampled, because N_eff was below the limit. */
    int32_t resampled;
    /* Effective sample size N_eff = 1 / sum w^2 before resampling. */
    cairn_real n_eff;
    /* Log marginal likelihood of all observations so far, in nats: the sum of ln sum_i w_i p(z |
     * ...). */
    cairn_real log_evidence;
    /* Blocks in use, and the most so far. */
    int32_t blocks, blocks_peak;
} cairn_particle_filter_trace;

/* The statistics. */
cairn_particle_filter_trace cairn_particle_filter_read(const cairn_particle_filter *filter);

#ifdef __cplusplus
}
#endif

#endif
