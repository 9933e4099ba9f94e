/* How clusters of the aligner grow: merging by the surest hypotheses of pairs of scans
 * (aligner_pairs.c).
 *
 * Every hypothesis stands for a relative pose of the clusters that its scans belong to. The best
 * is taken off the list time and again: looked at anew when its clusters have changed, compared
 * with its rivals, shifted along the direction that it knows least of, and, when it is still the
 * best after all that, carried out. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

/* nats, ... */
static const cairn_real HOPELESS = -15, FAR_OFF = -40;
/* ... of a shifted pose, which matters only above 0 */
static const cairn_real SHIFTED_OFF = -10;
/* m */
static const cairn_real SAME_PLACE = CAIRN_REAL(0.15);
/* cosine of 3 degrees */
static const cairn_real SAME_HEADING = CAIRN_REAL(0.9986);
/* m */
static const cairn_real SHIFT = CAIRN_REAL(0.25);
/* nats below which a rival does not matter */
static const cairn_real RIVAL = 8;
enum { LOOK_ROUNDS = 3, UNKNOWN = -2 };
enum { OPEN_OF_ITEM = 128, LINKS_OF_ITEM = 64, LINKS_OF_UNIT = 8 };

static int32_t cluster_of(const cairn_aligner *x, int32_t scan)
{
    return x->scans[scan].part;
}

static int is_fresh(const cairn_aligner *x, const aligner_hypothesis *h)
{
    return h->first_stamp == x->clusters[cluster_of(x, h->first)].stamp &&
           h->second_stamp == x->clusters[cluster_of(x, h->second)].stamp;
}

/* What a block of hypotheses has is to be looked for again. */
static void touch(cairn_aligner *x, const aligner_hypothesis *h)
{
    x->surest[(h - x->hypotheses) / ALIGNER_BLOCK] = UNKNOWN;
}

/* The pose of the cluster of the first scan as seen from that of the second. */
static cairn_transform clusters_pose(const cairn_aligner *x, const aligner_hypothesis *h)
{
    cairn_transform first =
        cairn_aligner_compose(x->poses[h->second], cairn_transform_of(h->second_first));

    return cairn_aligner_compose(first, cairn_aligner_inverse(x->poses[h->first]));
}

/* Begins a look; 0, and the hypothesis is out, when the initial poses speak against it as no
 * points could speak for it. */
static int look_at(cairn_aligner *x, aligner_hypothesis *h)
{
    int32_t first = cluster_of(x, h->first), second = cluster_of(x, h->second);
    cairn_transform pose = clusters_pose(x, h);

    if (cairn_aligner_prior(x, first, second, pose) < FAR_OFF) {
        h->state = ALIGNER_OUT;
        touch(x, h);
        return 0;
    }
    cairn_aligner_begin_look(x, first, second, pose, h->first_stamp < 0 ? 1 : LOOK_ROUNDS, FAR_OFF);
    return 1;
}

static void take_look(cairn_aligner *x, aligner_hypothesis *h)
{
    cairn_transform first = cairn_aligner_compose(x->look.pose, x->poses[h->first]);

    h->second_first = cairn_aligner_to_pose(cairn_aligner_between(x->poses[h->second], first));
    h->score = h->key = x->look.evidence + x->look.prior;
    h->first_stamp = x->clusters[cluster_of(x, h->first)].stamp;
    h->second_stamp = x->clusters[cluster_of(x, h->second)].stamp;
    h->state = h->score < HOPELESS ? ALIGNER_OUT : ALIGNER_LOOKED;
    touch(x, h);
}

static void find_surest_of(cairn_aligner *x, int32_t block)
{
    int32_t first = block * ALIGNER_BLOCK, end = first + ALIGNER_BLOCK, best = -1;

    for (int32_t i = first; i < end && i < x->hypothesis_count; i++) {
        const aligner_hypothesis *h = &x->hypotheses[i];

        if (h->state != ALIGNER_OUT && h->key > x->params.least_evidence &&
            (best < 0 || h->key > x->hypotheses[best].key))
            best = i;
    }
    x->surest[block] = best;
}

static int32_t blocks_of(const cairn_aligner *x)
{
    return (x->hypothesis_count + ALIGNER_BLOCK - 1) / ALIGNER_BLOCK;
}

/* Finds the surest of some blocks; 0: all are known. */
static int find_some(cairn_aligner *x)
{
    enum { OF_ITEM = 16 };
    int32_t found = 0;

    for (int32_t block = 0; block < blocks_of(x) && found < OF_ITEM; block++)
        if (x->surest[block] == UNKNOWN) {
            find_surest_of(x, block);
            found++;
        }
    x->debt += blocks_of(x) / 32 + found * (ALIGNER_BLOCK / 16);
    return found == OF_ITEM;
}

/* The hypothesis with the greatest key; -1: none is sure enough. */
static int32_t surest(cairn_aligner *x)
{
    int32_t best = -1;

    for (int32_t block = 0; block < blocks_of(x); block++) {
        int32_t own;

        if (x->surest[block] == UNKNOWN) {
            find_surest_of(x, block);
            x->debt += ALIGNER_BLOCK / 16;
        }
        own = x->surest[block];
        if (own >= 0 && (best < 0 || x->hypotheses[own].key > x->hypotheses[best].key))
            best = own;
    }
    x->debt += blocks_of(x) / 16;
    return best;
}

/* 1 when two hypotheses join the same clusters. */
static int is_rival(const cairn_aligner *x, const aligner_hypothesis *h,
                    const aligner_hypothesis *g)
{
    int32_t a = cluster_of(x, h->first), b = cluster_of(x, h->second);
    int32_t c = cluster_of(x, g->first), d = cluster_of(x, g->second);

    return h != g && g->state != ALIGNER_OUT && ((a == c && b == d) || (a == d && b == c));
}

/* The pose of h's clusters by g. */
static cairn_transform rival_pose(const cairn_aligner *x, const aligner_hypothesis *h,
                                  const aligner_hypothesis *g)
{
    cairn_transform pose = clusters_pose(x, g);

    return cluster_of(x, g->first) == cluster_of(x, h->first) ? pose : cairn_aligner_inverse(pose);
}

/* The rivals of the chosen one are among the hypotheses of the scans of the smaller cluster. */
static void begin_rivals(cairn_aligner *x)
{
    const aligner_hypothesis *h = &x->hypotheses[x->chosen];
    int32_t a = cluster_of(x, h->first), b = cluster_of(x, h->second);

    x->rival_scan = x->clusters[x->clusters[a].size <= x->clusters[b].size ? a : b].head;
    x->rival_link = x->links[x->rival_scan];
}

/* The next rival, unless `most` hypotheses have been passed before; NULL: none, and rival_scan <
 * 0 when that was the last. */
static aligner_hypothesis *next_rival(cairn_aligner *x, int32_t *passed, int32_t most)
{
    const aligner_hypothesis *h = &x->hypotheses[x->chosen];

    while (x->rival_scan >= 0 && *passed < most) {
        aligner_hypothesis *g;

        ++*passed;
        if (x->rival_link < 0) {
            x->rival_scan = x->scans[x->rival_scan].next;
            x->rival_link = x->rival_scan >= 0 ? x->links[x->rival_scan] : -1;
            continue;
        }
        g = &x->hypotheses[x->rival_link / 2];
        x->rival_link = g->next[x->rival_link & 1];
        if (is_rival(x, h, g))
            return g;
    }
    return NULL;
}

/* The pose of the chosen one's first scan, in the other cluster's frame, by that hypothesis and
 * by a rival. */
static cairn_transform pose_by(const cairn_aligner *x, const aligner_hypothesis *g)
{
    const aligner_hypothesis *h = &x->hypotheses[x->chosen];

    return cairn_aligner_compose(rival_pose(x, h, g), x->poses[h->first]);
}

/* Looks at rivals that have to be, one after the other; a look at one that says the same as the
 * chosen one would tell nothing new. */
static int32_t look_at_rivals(cairn_aligner *x)
{
    const aligner_hypothesis *h = &x->hypotheses[x->chosen];
    cairn_transform pose = pose_by(x, h);
    aligner_hypothesis *g;
    int32_t passed = 0, compared = 0;

    if (x->looked >= 0)
        take_look(x, &x->hypotheses[x->looked]);
    x->looked = -1;
    for (; (g = next_rival(x, &passed, LINKS_OF_ITEM)) != NULL; compared++)
        if (!is_fresh(x, g) && g->score >= h->score - RIVAL &&
            !cairn_aligner_near(pose, pose_by(x, g), SAME_PLACE, SAME_HEADING)) {
            x->looked = look_at(x, g) ? (int32_t)(g - x->hypotheses) : -1;
            break;
        }
    if (g == NULL && x->rival_scan < 0) {
        x->phase = surest(x) == x->chosen ? ALIGNER_WEIGHED : ALIGNER_PICK;
        x->odds = 1;
        begin_rivals(x);
    }
    return 2 + compared + passed / LINKS_OF_UNIT;
}

/* The odds of the chosen one against its rivals; those that are the same as it are out. */
static int32_t compare(cairn_aligner *x)
{
    aligner_hypothesis *h = &x->hypotheses[x->chosen], *g;
    cairn_transform pose = pose_by(x, h);
    int32_t passed = 0, compared = 0;

    for (; (g = next_rival(x, &passed, LINKS_OF_ITEM)) != NULL; compared++) {
        cairn_transform rival = pose_by(x, g);

        if (is_fresh(x, g) && !cairn_aligner_near(pose, rival, SAME_PLACE, SAME_HEADING)) {
            x->odds += cairn_exp(cairn_min(g->score, 60));
        } else if (g->score <= h->score &&
                   cairn_aligner_near(pose, rival, SAME_PLACE / 3, CAIRN_REAL(0.9998))) {
            g->state = ALIGNER_OUT;
            touch(x, g);
        }
    }
    if (x->rival_scan < 0) {
        h->key = h->score - cairn_log(x->odds);
        h->state = ALIGNER_COMPARED;
        touch(x, h);
        x->phase = ALIGNER_PICK;
    }
    return 2 + compared + passed / LINKS_OF_UNIT;
}

static void begin_shifted(cairn_aligner *x)
{
    const aligner_hypothesis *h = &x->hypotheses[x->chosen];
    cairn_real motion[3];

    for (int k = 0; k < 3; k++)
        motion[k] = (x->side == 1 ? SHIFT : -SHIFT) * x->shift[k];
    cairn_aligner_begin_look(x, cluster_of(x, h->first), cluster_of(x, h->second),
                             cairn_aligner_moved(clusters_pose(x, h), x->shift_centre, motion), 0,
                             SHIFTED_OFF);
}

/* The look for the weak direction, then those at both shifted poses. */
static void take_shifted(cairn_aligner *x)
{
    aligner_hypothesis *h = &x->hypotheses[x->chosen];

    if (x->side == 0) {
        memcpy(x->shift, x->look.weak, sizeof x->shift);
        x->shift_centre = x->look.centre;
        x->rest = 0;
    } else {
        x->rest = cairn_max(x->rest, x->look.evidence + x->look.prior);
    }
    if (++x->side <= 2) {
        begin_shifted(x);
        return;
    }
    h->key = cairn_min(h->key, h->score - x->rest);
    h->state = ALIGNER_SURE;
    touch(x, h);
    x->phase = ALIGNER_PICK;
}

void cairn_aligner_begin_open(cairn_aligner *x, int32_t again)
{
    x->phase = ALIGNER_OPEN;
    x->stage = again;
    x->k = 0;
}

static void link_to(cairn_aligner *x, int32_t hypothesis, int32_t side, int32_t scan)
{
    x->hypotheses[hypothesis].next[side] = x->links[scan];
    x->links[scan] = 2 * hypothesis + side;
}

/* Some hypotheses: those that join clusters are open. */
static int32_t open_some(cairn_aligner *x)
{
    int32_t end = x->k + OPEN_OF_ITEM < x->hypothesis_count ? x->k + OPEN_OF_ITEM
                                                            : x->hypothesis_count,
            units = 1;

    if (x->k == 0) {
        for (int32_t i = 0; i < x->scan_count; i++)
            x->links[i] = -1;
        units += x->scan_count / 64;
    }
    for (; x->k < end; x->k++, units += x->k % LINKS_OF_UNIT == 0) {
        aligner_hypothesis *h = &x->hypotheses[x->k];

        if (x->stage) {
            h->key = cairn_max(h->score, x->params.least_evidence * 2);
            h->first_stamp = -1;
        }
        h->state =
            cluster_of(x, h->first) != cluster_of(x, h->second) ? ALIGNER_LOOKED : ALIGNER_OUT;
        link_to(x, x->k, 0, h->first);
        link_to(x, x->k, 1, h->second);
        touch(x, h);
    }
    if (end == x->hypothesis_count)
        x->phase = ALIGNER_PICK;
    return units;
}

/* Hypotheses of a scan that has joined another cluster: those that join nothing any more are
 * out. */
static int32_t close_some(cairn_aligner *x)
{
    int32_t passed = 0, link;

    if (x->l == 0) {
        x->phase = ALIGNER_PICK;
        return 1;
    }
    for (link = x->links[x->k]; link >= 0; passed++) {
        aligner_hypothesis *h = &x->hypotheses[link / 2];

        link = h->next[link & 1];
        if (h->state != ALIGNER_OUT && cluster_of(x, h->first) == cluster_of(x, h->second)) {
            h->state = ALIGNER_OUT;
            touch(x, h);
        }
    }
    x->k = x->scans[x->k].next;
    x->l--;
    return 1 + passed / LINKS_OF_UNIT;
}

/* The scans that join come first in their new cluster. */
static void carry_out(cairn_aligner *x)
{
    aligner_hypothesis *h = &x->hypotheses[x->chosen];
    int32_t a = cluster_of(x, h->first), b = cluster_of(x, h->second), joined;

    x->l = x->clusters[a].size < x->clusters[b].size ? x->clusters[a].size : x->clusters[b].size;
    joined = cairn_aligner_join(x, a, b, clusters_pose(x, h));
    x->k = x->clusters[joined].head;
    x->phase = ALIGNER_CLOSE;
    x->result.merges++;
    cairn_aligner_begin_relax(x, joined, CAIRN_REAL(0.08), x->clusters[joined].size < 6 ? 3 : 2, 0);
}

static void pick(cairn_aligner *x)
{
    aligner_hypothesis *h;

    if (find_some(x))
        return;
    x->chosen = surest(x);
    if (x->chosen < 0) {
        x->phase = ALIGNER_REPAIR;
        x->i = 0;
        x->changed = 0;
        return;
    }
    h = &x->hypotheses[x->chosen];
    if (!is_fresh(x, h)) {
        if (look_at(x, h))
            x->phase = ALIGNER_LOOKED_AT;
    } else if (h->state == ALIGNER_LOOKED) {
        x->looked = -1;
        begin_rivals(x);
        x->phase = ALIGNER_RIVALS;
    } else if (h->state == ALIGNER_COMPARED) {
        x->side = 0;
        cairn_aligner_begin_look(x, cluster_of(x, h->first), cluster_of(x, h->second),
                                 clusters_pose(x, h), 1, CAIRN_REAL_MAX);
        x->phase = ALIGNER_SHIFTED;
    } else {
        carry_out(x);
    }
}

int32_t cairn_aligner_merge_item(cairn_aligner *x)
{
    switch (x->phase) {
    case ALIGNER_OPEN:
        return open_some(x);
    case ALIGNER_PICK:
        pick(x);
        return 1;
    case ALIGNER_LOOKED_AT:
        take_look(x, &x->hypotheses[x->chosen]);
        x->phase = ALIGNER_PICK;
        return 2;
    case ALIGNER_RIVALS:
        return look_at_rivals(x);
    case ALIGNER_WEIGHED:
        return compare(x);
    case ALIGNER_CLOSE:
        return close_some(x);
    default:
        take_shifted(x);
        return 2;
    }
}
