/* Table of the competing pose hypotheses of each map (fig. 9.5 of the thesis): Psi, gamma and their
 * normalized product. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "tools/cairn_merge.h"

/* Returns 1 when `other` was placed before `map`. For a rejected map all placed maps count. */
static int was_before(const merge_job *job, int32_t other, int32_t map)
{
    const cairn_map_merge_placed *a = &job->map[other].placed, *b = &job->map[map].placed;

    return other != map && a->verdict == CAIRN_MAP_MERGE_PLACED && a->rank < b->rank;
}

/* Appends a hypothesis. Returns 0 when there is no memory. */
static int add_place(merge_job *job, const merge_place *place)
{
    if ((job->place_count & (job->place_count - 1)) == 0) {
        size_t most = job->place_count > 0 ? 2 * (size_t)job->place_count : 1;
        merge_place *grown = realloc(job->place, most * sizeof *grown);

        if (grown == NULL)
            return 0;
        job->place = grown;
    }
    job->place[job->place_count++] = *place;
    return 1;
}

/* Normalizes Psi, and gamma above its minimum, over the hypotheses first ... place_count - 1; a
 * single hypothesis has 1. */
static void normalize_scores(merge_job *job, int32_t first)
{
    double psi = 0, gamma = 0, least = 0, products = 0;
    int32_t n = job->place_count - first;
    merge_place *list = job->place + first;

    for (int32_t i = 0; i < n; i++) {
        psi += (double)list[i].score.psi;
        least = i == 0 || (double)list[i].score.gamma < least ? (double)list[i].score.gamma : least;
    }
    for (int32_t i = 0; i < n; i++)
        gamma += (double)list[i].score.gamma - least;
    for (int32_t i = 0; i < n; i++) {
        list[i].psi_share = n > 1 && psi > 0 ? (double)list[i].score.psi / psi : 1;
        list[i].gamma_share =
            n > 1 && gamma > 0 ? ((double)list[i].score.gamma - least) / gamma : 1;
        products += list[i].psi_share * list[i].gamma_share;
    }
    for (int32_t i = 0; i < n; i++)
        list[i].product = products > 0 ? list[i].psi_share * list[i].gamma_share / products : 0;
}

int merge_read_places(merge_job *job)
{
    job->place_count = 0;
    for (int32_t map = 0; map < job->settings->count; map++) {
        int32_t first = job->place_count;

        for (int32_t other = 0; other < job->settings->count; other++)
            for (int32_t k = 0; was_before(job, other, map); k++) {
                merge_place p = {.map = map, .placed_map = other};
                cairn_pose seen;

                if (!cairn_map_merge_mode(job->merge, other, map, k, &seen,
                                          &p.log_likelihood_ratio))
                    break;
                if (cairn_map_merge_score(job->merge, other, map, seen, &p.score) != CAIRN_OK)
                    break;
                p.pose = cairn_pose_compose(job->map[other].placed.reference_map, seen);
                if (!add_place(job, &p))
                    return 0;
            }
        normalize_scores(job, first);
    }
    return 1;
}

cairn_status merge_write_places(const merge_job *job, const char *path, cairn_file_error *error)
{
    cairn_output *out;
    cairn_status status = cairn_output_open(&out, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(out,
                       "map,beside,x,y,theta,evidence,psi,gamma,psi_share,gamma_share,product\n");
    for (int32_t i = 0; i < job->place_count; i++) {
        const merge_place *p = &job->place[i];

        cairn_output_print(
            out, "%" PRId32 ",%" PRId32 ",%.9g,%.9g,%.9g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", p->map,
            p->placed_map, (double)p->pose.x, (double)p->pose.y, (double)p->pose.theta,
            (double)p->log_likelihood_ratio, (double)p->score.psi, (double)p->score.gamma,
            p->psi_share, p->gamma_share, p->product);
    }
    return cairn_output_commit(out, error);
}
