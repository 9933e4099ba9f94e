/* pose_consensus: the starts of phases that follow more than one other. pose_consensus.c describes the
 * method. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/pose_consensus_work.h"

/* Sweeps of relaxation of the best map. */
enum { SWEEPS_END = 10 };

void cairn_pose_consensus_enter(cairn_pose_consensus *consensus, pose_consensus_phase phase,
                                int32_t end)
{
    consensus->phase = phase;
    consensus->next = 0;
    consensus->end = end;
}

void cairn_pose_consensus_begin_relaxation(cairn_pose_consensus *consensus, int32_t sweeps,
                                           pose_consensus_phase after)
{
    cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_RELAX, consensus->node_count);
    consensus->sweeps = sweeps;
    consensus->after = after;
}

void cairn_pose_consensus_begin_rounds(cairn_pose_consensus *consensus)
{
    consensus->merge.support = 0;
    cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_MERGE, consensus->hypothesis_count);
}

void cairn_pose_consensus_begin_report(cairn_pose_consensus *consensus)
{
    memcpy(consensus->current, consensus->best,
           (size_t)consensus->node_count * sizeof *consensus->current);
    cairn_pose_consensus_begin_relaxation(consensus, SWEEPS_END, POSE_CONSENSUS_REPORT);
}
