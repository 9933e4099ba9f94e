/* aligner: storage of a scan: segments with the moments of their hits, points along them,
 * visibility profile. aligner.c describes the method.
 *
 * Consecutive hits on no segment form a short segment: the few beams that just reach a wall at the
 * edge of the view. Its direction is poor, but it constrains a scan whose other walls are all
 * parallel. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/aligner_work.h"

static const cairn_real HIT_GATE_SIGMAS = 3;
static const cairn_real MAX_SEGMENT_DISTANCE_M = CAIRN_REAL(0.06); /* m */
static const cairn_real MIN_INCIDENCE = CAIRN_REAL(0.05);
static const cairn_real MAX_RUN_GAP_M =
    CAIRN_REAL(0.1); /* m: greatest distance of consecutive hits */
/* variances of a range: greatest scatter across a short segment */
static const cairn_real MAX_SCATTER_VARIANCES = 3;
/* Hits of a short segment; bins between neighbouring beams, about a hundredth of a turn. */
enum { MIN_HITS = 4, MAX_GAP_BINS = 6 };

/* ---- Hits of segments ---- */

/* Returns the segment of a hit, counted from the scan's first, and its distance. */
static int32_t segment_of(const cairn_aligner *aligner, const aligner_scan *scan, cairn_vec2 hit,
                          cairn_real *distance)
{
    int32_t best = CAIRN_VISIBILITY_NO_SURFACE;

    *distance = MAX_SEGMENT_DISTANCE_M;
    for (int32_t k = scan->first_segment;
         k < scan->end_segment && k - scan->first_segment < CAIRN_VISIBILITY_NO_SURFACE; k++) {
        const aligner_segment *s = &aligner->segments[k];
        cairn_vec2 from = cairn_vec2_sub(hit, s->a);
        cairn_real along = cairn_vec2_dot(s->direction, from);
        cairn_real beyond = cairn_max(cairn_max(-along, along - s->length), 0);
        cairn_real across = cairn_vec2_cross(s->direction, from), d;

        if (cairn_abs(across) >= *distance || beyond >= *distance)
            continue;
        d = cairn_sqrt(across * across + beyond * beyond);
        if (d < *distance) {
            *distance = d;
            best = k - scan->first_segment;
        }
    }
    return best;
}

/* Adds a hit to a segment, weighted by the variance of its range across the line. Called twice,
 * first for the mean. */
static void add_hit(cairn_aligner *aligner, aligner_segment *segment, const cairn_scan_beam *beam,
                    int32_t about_mean)
{
    cairn_vec2 ray = cairn_vec2_sub(beam->to, beam->from), d;
    cairn_real incidence =
                   cairn_abs(cairn_vec2_cross(segment->direction, ray)) / cairn_vec2_norm(ray),
               deviation, weight;

    deviation = aligner->params.range_sigma * cairn_max(incidence, MIN_INCIDENCE);
    weight = 1 / (deviation * deviation);
    d = cairn_vec2_sub(beam->to, about_mean ? segment->mean : segment->a);
    if (!about_mean) {
        segment->weight += weight;
        segment->scatter.xx += weight * d.x;
        segment->scatter.yy += weight * d.y;
        return;
    }
    segment->scatter.xx += weight * d.x * d.x;
    segment->scatter.xy += weight * d.x * d.y;
    segment->scatter.yy += weight * d.y * d.y;
}

static void finish_means(cairn_aligner *aligner, const aligner_scan *scan)
{
    for (int32_t k = scan->first_segment; k < scan->end_segment; k++) {
        aligner_segment *s = &aligner->segments[k];
        cairn_sym2 none = {0, 0, 0};

        if (s->weight > 0) {
            s->mean.x = s->a.x + s->scatter.xx / s->weight;
            s->mean.y = s->a.y + s->scatter.yy / s->weight;
        }
        s->scatter = none;
    }
}

static void finish_moments(cairn_aligner *aligner, const aligner_scan *scan)
{
    for (int32_t k = scan->first_segment; k < scan->end_segment; k++) {
        cairn_real values[2];
        cairn_vec2 minor, major;

        cairn_sym2_eigen(aligner->segments[k].scatter, values, &minor, &major);
        aligner->segments[k].min_scatter = cairn_max(values[0], 0);
    }
}

/* A run of consecutive hits on no segment. */
typedef struct run {
    cairn_vec2 first, last, sum;
    cairn_sym2 squares; /* about the first */
    int32_t count;
} run;

/* Adds a short segment for a straight run, if the capacity allows; its moments come with the second
 * pass. */
static void add_short_segment(cairn_aligner *aligner, aligner_scan *scan, const run *r)
{
    aligner_segment *s = &aligner->segments[aligner->segment_count];
    cairn_real share = 1 / (cairn_real)r->count, values[2], half;
    cairn_vec2 mean = cairn_vec2_scale(r->sum, share), minor, major;
    cairn_sym2 spread = {r->squares.xx * share - mean.x * mean.x,
                         r->squares.xy * share - mean.x * mean.y,
                         r->squares.yy * share - mean.y * mean.y};

    if (aligner->short_segment_count == aligner->params.max_short_segments)
        return;
    cairn_sym2_eigen(spread, values, &minor, &major);
    half = cairn_max(
        cairn_abs(cairn_vec2_dot(major, mean)),
        cairn_abs(cairn_vec2_dot(major, cairn_vec2_sub(cairn_vec2_sub(r->last, r->first), mean))));
    if (values[0] >
            MAX_SCATTER_VARIANCES * aligner->params.range_sigma * aligner->params.range_sigma ||
        !(half > 0))
        return;
    mean = cairn_vec2_add(mean, r->first);
    if (cairn_vec2_cross(major, cairn_vec2_sub(mean, scan->sensor)) > 0)
        major = cairn_vec2_scale(major, -1);
    memset(s, 0, sizeof *s);
    s->direction = major;
    s->length = 2 * half;
    s->a = cairn_vec2_sub(mean, cairn_vec2_scale(major, half));
    s->scan = aligner->scan_count;
    s->wall = -1;
    s->is_short = 1;
    aligner->segment_count++;
    aligner->short_segment_count++;
    scan->end_segment++;
}

/* Adds the next beam's hit to the run, or ends the run. */
static void extend_run(cairn_aligner *aligner, aligner_scan *scan, run *r,
                       const cairn_scan_beam *hit)
{
    cairn_vec2 d;

    if (r->count > 0 &&
        (hit == NULL || cairn_vec2_norm(cairn_vec2_sub(hit->to, r->last)) > MAX_RUN_GAP_M)) {
        if (r->count >= MIN_HITS)
            add_short_segment(aligner, scan, r);
        r->count = 0;
    }
    if (hit == NULL)
        return;
    if (r->count == 0) {
        memset(r, 0, sizeof *r);
        r->first = hit->to;
    }
    r->last = hit->to;
    r->count++;
    d = cairn_vec2_sub(hit->to, r->first);
    r->sum = cairn_vec2_add(r->sum, d);
    r->squares.xx += d.x * d.x;
    r->squares.xy += d.x * d.y;
    r->squares.yy += d.y * d.y;
}

static void find_short_segments(cairn_aligner *aligner, aligner_scan *scan,
                                const cairn_scan_view *view)
{
    cairn_real distance;
    run r;

    memset(&r, 0, sizeof r);
    for (int32_t i = 0; i < view->beam_count; i++) {
        const cairn_scan_beam *beam = &view->beams[i];
        int free_hit =
            beam->kind == CAIRN_SCAN_BEAM_HIT &&
            segment_of(aligner, scan, beam->to, &distance) == CAIRN_VISIBILITY_NO_SURFACE;

        extend_run(aligner, scan, &r, free_hit ? beam : NULL);
    }
    extend_run(aligner, scan, &r, NULL);
}

/* Empties the visibility profile of a scan. */
static void begin_view(const cairn_aligner *aligner, aligner_view *view, cairn_vec2 sensor)
{
    view->visibility.step = aligner->params.max_range / CAIRN_VISIBILITY_STEPS;
    view->visibility.range = view->range;
    view->visibility.surface = view->surface;
    view->visibility.bins = ALIGNER_VIEW_BINS;
    view->visibility.max_gap = MAX_GAP_BINS;
    cairn_visibility_clear(&view->visibility, sensor);
}

/* Visibility profile and moments. */
static void read_beams(cairn_aligner *aligner, int32_t index, const cairn_scan_view *view)
{
    aligner_scan *scan = &aligner->scans[index];
    cairn_real gate = HIT_GATE_SIGMAS * aligner->params.range_sigma, distance;

    for (int32_t pass = 0; pass < 2; pass++) {
        for (int32_t i = 0; i < view->beam_count; i++) {
            const cairn_scan_beam *beam = &view->beams[i];
            cairn_real range = cairn_vec2_norm(cairn_vec2_sub(beam->to, beam->from));
            cairn_vec2 ray = {0, 0};
            int32_t segment = CAIRN_VISIBILITY_NO_SURFACE;

            if (beam->kind == CAIRN_SCAN_BEAM_HIT && range > 0 &&
                range <= aligner->params.max_range)
                segment = segment_of(aligner, scan, beam->to, &distance);
            if (segment != CAIRN_VISIBILITY_NO_SURFACE && distance < gate)
                add_hit(aligner, &aligner->segments[scan->first_segment + segment], beam, pass);
            if (range > 0)
                ray = cairn_vec2_sub(beam->to, view->sensor);
            if (pass == 0)
                cairn_visibility_add(&aligner->views[index].visibility, ray, (uint8_t)segment);
        }
        if (pass == 0)
            finish_means(aligner, scan);
    }
    finish_moments(aligner, scan);
}

/* Field of view: the directions outside the widest blind gap. */
static void measure_view(cairn_aligner *aligner, int32_t index)
{
    aligner_scan *scan = &aligner->scans[index];
    const aligner_view *view = &aligner->views[index];
    int32_t widest = 0, end = 0, blind = 0;
    cairn_vec2 first, last; /* of the visible directions */

    for (int32_t k = 0; k < 2 * ALIGNER_VIEW_BINS; k++) {
        blind = view->range[k & (ALIGNER_VIEW_BINS - 1)] == 0 ? blind + 1 : 0;
        if (blind > widest) {
            widest = blind;
            end = k & (ALIGNER_VIEW_BINS - 1);
        }
    }
    scan->view_cosine = -1;
    scan->view_sine = 0;
    scan->axis.x = 1;
    scan->axis.y = 0;
    if (widest < ALIGNER_VIEW_BINS / 2 || widest >= ALIGNER_VIEW_BINS)
        return;
    /* Less than half a turn is visible: the axis bisects it. */
    first = cairn_visibility_direction((end + 1) & (ALIGNER_VIEW_BINS - 1), ALIGNER_VIEW_BINS);
    last = cairn_visibility_direction((end - widest) & (ALIGNER_VIEW_BINS - 1), ALIGNER_VIEW_BINS);
    scan->axis = cairn_vec2_unit(cairn_vec2_add(first, last));
    scan->view_cosine = cairn_vec2_dot(scan->axis, first) - CAIRN_REAL(0.02);
    scan->view_sine = cairn_sqrt(cairn_max(0, 1 - scan->view_cosine * scan->view_cosine));
}

/* Greatest range of each sector and its neighbours. */
static void measure_sectors(aligner_view *view)
{
    enum { SECTOR_BINS = ALIGNER_VIEW_BINS / ALIGNER_VIEW_SECTORS };

    for (int32_t k = 0; k < ALIGNER_VIEW_SECTORS; k++) {
        uint16_t farthest = 0;

        for (int32_t bin = (k - 1) * SECTOR_BINS; bin < (k + 2) * SECTOR_BINS; bin++)
            if (view->range[bin & (ALIGNER_VIEW_BINS - 1)] > farthest)
                farthest = view->range[bin & (ALIGNER_VIEW_BINS - 1)];
        view->sector_max[k] = farthest;
    }
}

/* Bounding circles of consecutive points. */
static void measure_patches(cairn_aligner *aligner, aligner_scan *scan)
{
    scan->first_patch = aligner->patch_count;
    for (int32_t first = scan->first_point; first < scan->end_point;
         first += ALIGNER_PATCH_POINTS) {
        int32_t end = first + ALIGNER_PATCH_POINTS < scan->end_point ? first + ALIGNER_PATCH_POINTS
                                                                     : scan->end_point;
        aligner_patch *patch = &aligner->patches[aligner->patch_count++];

        patch->middle.x = patch->middle.y = patch->radius = 0;
        for (int32_t i = first; i < end; i++)
            patch->middle = cairn_vec2_add(patch->middle, aligner->points[i].position);
        patch->middle = cairn_vec2_scale(patch->middle, 1 / (cairn_real)(end - first));
        for (int32_t i = first; i < end; i++)
            patch->radius = cairn_max(
                patch->radius,
                cairn_vec2_norm(cairn_vec2_sub(aligner->points[i].position, patch->middle)));
    }
}

static void measure_circle(cairn_aligner *aligner, aligner_scan *scan)
{
    int32_t count = scan->end_point - scan->first_point;
    cairn_real share = 1 / ((cairn_real)count + 1);

    scan->middle = cairn_vec2_scale(scan->sensor, share);
    for (int32_t i = scan->first_point; i < scan->end_point; i++)
        scan->middle =
            cairn_vec2_add(scan->middle, cairn_vec2_scale(aligner->points[i].position, share));
    scan->radius = cairn_vec2_norm(cairn_vec2_sub(scan->sensor, scan->middle));
    for (int32_t i = scan->first_point; i < scan->end_point; i++)
        scan->radius =
            cairn_max(scan->radius,
                      cairn_vec2_norm(cairn_vec2_sub(aligner->points[i].position, scan->middle)));
    scan->extent = scan->radius + cairn_vec2_norm(scan->middle);
}

static void copy_surfaces(cairn_aligner *aligner, aligner_scan *scan, const cairn_scan_view *view)
{
    for (int32_t k = 0; k < view->segment_count; k++) {
        aligner_segment *s = &aligner->segments[aligner->segment_count];
        cairn_vec2 along = cairn_vec2_sub(view->segments[k].b, view->segments[k].a);

        memset(s, 0, sizeof *s);
        s->a = view->segments[k].a;
        s->direction = cairn_vec2_unit(along);
        s->length = cairn_vec2_norm(along);
        s->scan = aligner->scan_count;
        s->wall = -1;
        for (int32_t i = view->first_point[k]; i < view->first_point[k + 1]; i++) {
            aligner_point *point = &aligner->points[aligner->point_count];

            point->position = view->points[i].position;
            point->segment = aligner->segment_count;
            if (cairn_vec2_norm(cairn_vec2_sub(point->position, scan->sensor)) <=
                aligner->params.max_range)
                aligner->point_count++;
        }
        aligner->segment_count++;
    }
}

void cairn_aligner_fill_scan(cairn_aligner *aligner, const cairn_scan_view *view,
                             cairn_pose initial)
{
    aligner_scan *scan = &aligner->scans[aligner->scan_count];
    aligner_view *profile = &aligner->views[aligner->scan_count];

    memset(scan, 0, sizeof *scan);
    scan->sensor = view->sensor;
    scan->initial = initial;
    scan->first_segment = aligner->segment_count;
    scan->first_point = aligner->point_count;
    copy_surfaces(aligner, scan, view);
    scan->end_segment = aligner->segment_count;
    scan->end_point = aligner->point_count;
    begin_view(aligner, profile, view->sensor);
    find_short_segments(aligner, scan, view);
    read_beams(aligner, aligner->scan_count, view);
    measure_view(aligner, aligner->scan_count);
    measure_circle(aligner, scan);
    measure_sectors(profile);
    measure_patches(aligner, scan);
    aligner->poses[aligner->scan_count] = cairn_transform_of(initial);
    aligner->scan_count++;
}
