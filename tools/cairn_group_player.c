/* The page that plays a search: edges drawn as walls, every particle as a robot on the axis, the
 * model at the particle of largest weight. Lengths are pixels, y up, as the page has it. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/report.h"
#include "tools/cairn_group.h"

/* Line strengths of the model at the best particle, and at other particles. */
#define BEST_STRENGTH  1
#define OTHER_STRENGTH 0.25
/* Line strength of the skeleton in the mode as written. */
#define SKELETON_STRENGTH 0.3
/* Line strength of the skeletons of other particles there. */
#define OTHER_SKELETON_STRENGTH 0.12
enum { MAX_SHOWN_MODELS = 6 };

void group_record_step(void *context, const cairn_contour_grouping_particle *particles,
                       int32_t count, int32_t mirrored)
{
    group_record *r = context;
    int32_t used = r->steps > 0 ? r->first[r->steps] : 0;

    if (r->steps + 2 > r->capacity) {
        int32_t *grown = realloc(r->first, (size_t)(2 * r->capacity + 64) * sizeof *grown);

        r->out_of_memory |= grown == NULL;
        if (grown == NULL)
            return;
        r->first = grown;
        r->capacity = 2 * r->capacity + 64;
        r->first[0] = 0;
    }
    if (used + count > r->particle_capacity) {
        int32_t capacity = 2 * r->particle_capacity + count + 1024;
        cairn_contour_grouping_particle *grown =
            realloc(r->particles, (size_t)capacity * sizeof *grown);

        r->out_of_memory |= grown == NULL;
        if (grown == NULL)
            return;
        r->particles = grown;
        r->particle_capacity = capacity;
    }
    memcpy(&r->particles[used], particles, (size_t)count * sizeof *particles);
    r->mirrored_from = mirrored ? r->mirrored_from : r->steps + 1;
    r->first[++r->steps] = used + count;
}

/* Grows an array to hold `more` items after the first `used`. Returns 0 when there is no memory. */
static int grow(group_record *r, void **items, int32_t *capacity, int32_t used, int32_t more,
                size_t size)
{
    void *grown;

    if (used + more <= *capacity)
        return 1;
    grown = realloc(*items, (size_t)(2 * *capacity + more + 64) * size);
    r->out_of_memory |= grown == NULL;
    if (grown == NULL)
        return 0;
    *items = grown;
    *capacity = 2 * *capacity + more + 64;
    return 1;
}

/* Adds the trajectory of the particle of largest weight: a step of the filter begins. */
static void add_best_walk(group_record *r, const cairn_contour_grouping_disc *discs, int32_t count)
{
    int32_t used = r->walks > 0 ? r->walk[r->walks] : 0,
            lines = r->walks > 0 ? r->skeleton[r->walks] : 0;
    void *walk = r->walk, *all = r->discs, *skeleton = r->skeleton;
    int ok = grow(r, &walk, &r->walk_capacity, r->walks + 2, 0, sizeof *r->walk) &&
             grow(r, &skeleton, &r->step_capacity, r->walks + 2, 0, sizeof *r->skeleton) &&
             grow(r, &all, &r->disc_capacity, used, count, sizeof *r->discs);

    r->walk = walk;
    r->discs = all;
    r->skeleton = skeleton;
    if (!ok)
        return;
    memcpy(&r->discs[used], discs, (size_t)count * sizeof *discs);
    r->walk[r->walks] = used;
    r->skeleton[r->walks] = lines;
    r->walk[++r->walks] = used + count;
    r->skeleton[r->walks] = lines;
}

/* Adds the skeleton of another particle to the step. */
static void add_skeleton(group_record *r, const cairn_contour_grouping_disc *discs, int32_t count)
{
    int32_t *used = &r->skeleton[r->walks];
    void *all = r->skeletons;
    int ok = grow(r, &all, &r->skeleton_capacity, *used, count, sizeof *r->skeletons);

    r->skeletons = all;
    for (int32_t i = 1; i < count && ok; i++) {
        r->skeletons[*used].a = discs[i - 1].centre;
        r->skeletons[(*used)++].b = discs[i].centre;
    }
}

void group_record_walk(void *context, const cairn_contour_grouping_disc *discs, int32_t count,
                       int32_t rank)
{
    group_record *r = context;

    if (rank == 0)
        add_best_walk(r, discs, count);
    else if (r->walks > 0)
        add_skeleton(r, discs, count);
}

void group_record_free(group_record *record)
{
    free(record->discs);
    free(record->walk);
    free(record->skeletons);
    free(record->skeleton);
    free(record->particles);
    free(record->first);
    memset(record, 0, sizeof *record);
}

static cairn_vec2 flipped(cairn_vec2 p)
{
    cairn_vec2 up = {p.x, -p.y};

    return up;
}

/* Adds the edges as scan 0, which does not move and has no marker, and an empty scan per
 * particle. */
static cairn_status add_scans(cairn_report_player *player,
                              const cairn_contour_search_tokens *tokens, int32_t most)
{
    cairn_segment *lines = malloc(((size_t)tokens->count + 1) * sizeof *lines);
    cairn_report_scan scan = {NULL, lines, 0, tokens->count};
    cairn_status status = lines != NULL ? CAIRN_OK : CAIRN_NO_MEMORY;

    for (int32_t i = 0; i < tokens->count && status == CAIRN_OK; i++) {
        lines[i].a = flipped(tokens->lines[i].a);
        lines[i].b = flipped(tokens->lines[i].b);
    }
    if (status == CAIRN_OK)
        status = cairn_report_player_add_scan(player, &scan, -1);
    free(lines);
    memset(&scan, 0, sizeof scan);
    for (int32_t i = 1; i <= most && status == CAIRN_OK; i++)
        status = cairn_report_player_add_scan(player, &scan, i);
    return status;
}

static cairn_vec2 place(const cairn_contour_grouping_particle *p, cairn_vec2 m, int mirrored)
{
    double c = (double)p->size * cos((double)p->turn), s = (double)p->size * sin((double)p->turn);
    double x = mirrored ? -(double)m.x : (double)m.x, y = (double)m.y;
    cairn_vec2 out = {p->origin.x + (cairn_real)(c * x - s * y),
                      -(p->origin.y + (cairn_real)(s * x + c * y))};

    return out;
}

/* A model's outline as dashes; their number. */
static int32_t add_outline(const cairn_shape_model *m, const cairn_contour_grouping_particle *p,
                           int mirrored, double strength, cairn_report_hypothesis *guesses)
{
    int32_t count = 0;

    for (int32_t i = 0; i + 1 < m->outline_count; i += 2) {
        guesses[count].segment.a = place(p, m->outline[i].position, mirrored);
        guesses[count].segment.b = place(p, m->outline[i + 1].position, mirrored);
        guesses[count++].strength = (cairn_real)strength;
    }
    return count;
}

static int32_t add_dash(cairn_report_hypothesis *guess, cairn_vec2 a, cairn_vec2 b, double strength)
{
    guess->segment.a = flipped(a);
    guess->segment.b = flipped(b);
    guess->strength = (cairn_real)strength;
    return 1;
}

/* The trajectory of the particle of largest weight: its contour and skeleton as lines, their
 * number. open_end[2]: the centres of the look-ahead circles. */
static int32_t add_walk(const group_record *r, const cairn_contour_file_picture *p, int32_t step,
                        cairn_report_hypothesis *guesses, cairn_vec2 *open_end)
{
    const cairn_contour_grouping_disc *d = &r->discs[r->walk[step]];
    int32_t n = 0, count = r->walk[step + 1] - r->walk[step];

    for (int32_t i = 0; i < count; i++) {
        for (int32_t k = 0; k < 2; k++) {
            cairn_segment line = p->tokens->lines[d[i].segment[k]];

            n += add_dash(&guesses[n], line.a, line.b, BEST_STRENGTH);
        }
        if (i > 0)
            n += add_dash(&guesses[n], d[i - 1].centre, d[i].centre, SKELETON_STRENGTH);
    }
    for (int32_t k = 0; k < 2 && count > 0; k++)
        open_end[k] = flipped(d[count - 1].open_end[k]);
    return n;
}

/* The skeletons of other particles as lines, their number. */
static int32_t add_skeletons(const group_record *r, int32_t step, cairn_report_hypothesis *guesses)
{
    int32_t n = 0;

    for (int32_t i = r->skeleton[step]; i < r->skeleton[step + 1]; i++)
        n += add_dash(&guesses[n], r->skeletons[i].a, r->skeletons[i].b, OTHER_SKELETON_STRENGTH);
    return n;
}

static cairn_pose pose_of(const cairn_shape_model *m, const cairn_contour_grouping_particle *p,
                          int mirrored)
{
    int32_t before = p->sample > 0 ? p->sample - 1 : 0,
            after = p->sample + 1 < m->sample_count ? p->sample + 1 : p->sample;
    cairn_vec2 a = place(p, m->samples[before].centre, mirrored),
               b = place(p, m->samples[after].centre, mirrored);
    cairn_pose pose = {p->centre.x, -p->centre.y,
                       (cairn_real)atan2((double)(b.y - a.y), (double)(b.x - a.x))};

    return pose;
}

typedef struct frame_memory {
    cairn_pose *pose;
    uint8_t *low_confidence;
    cairn_report_hypothesis *hypothesis;
} frame_memory;

/* 1: the particles before the first step, whose trajectories have one symmetric point. */
static int32_t is_initial(const group_record *r, int32_t step)
{
    return r->walks > 0 && r->walk[step + 1] - r->walk[step] == 1;
}

/* Sets what the filter's trace has of an observation; unknown before the first step. filtered: the
 * filter's steps up to it. Returns 1 when the particles were resampled in that step. */
static int32_t read_trace(const group_record *r, const cairn_contour_file_picture *p, int32_t step,
                          int32_t filtered, double values[4])
{
    int mirrored = step >= r->mirrored_from;
    int32_t own = mirrored ? step - r->mirrored_from : filtered - 1;
    const cairn_contour_grouping_trace *t;

    values[0] = r->first[step + 1] - r->first[step];
    values[1] = values[2] = values[3] = (double)NAN;
    if (is_initial(r, step))
        return 0;
    t = &p->result->trace[mirrored][own];
    values[0] = (double)t->n_eff;
    values[1] = exp((double)t->log_likelihood);
    values[2] = (double)p->result->mode_counts[mirrored][own];
    values[3] = (double)t->followers;
    return t->resampled;
}

static cairn_status add_frame(cairn_report_player *player, const group_record *r,
                              const cairn_contour_file_picture *p, int32_t step, int32_t filtered,
                              frame_memory *memory)
{
    int mirrored = step >= r->mirrored_from;
    int32_t count = r->first[step + 1] - r->first[step], best = 0, resampled;
    const cairn_contour_grouping_particle *particles = &r->particles[r->first[step]];
    double values[4];
    cairn_report_frame frame = {.step = r->walks > 0 ? filtered : step + 1,
                                .pose = memory->pose,
                                .low_confidence = memory->low_confidence,
                                .value = values,
                                .hypothesis = memory->hypothesis,
                                .pose_count = count + 1};
    cairn_vec2 open_end[2];
    char label[96];

    resampled = read_trace(r, p, step, filtered, values);
    memset(&memory->pose[0], 0, sizeof memory->pose[0]);
    memory->low_confidence[0] = 0;
    for (int32_t i = 0; i < count; i++) {
        memory->pose[i + 1] = pose_of(p->model, &particles[i], mirrored);
        memory->low_confidence[i + 1] = particles[i].matched_sides == 0;
        best = particles[i].log_weight > particles[best].log_weight ? i : best;
    }
    if (r->walks > 0) {
        frame.hypothesis_count = add_walk(r, p, step, memory->hypothesis, open_end);
        frame.region = open_end;
        frame.region_count = frame.hypothesis_count > 0 ? 2 : 0;
        frame.hypothesis_count +=
            add_skeletons(r, step, &memory->hypothesis[frame.hypothesis_count]);
    }
    for (int32_t k = 1; k < MAX_SHOWN_MODELS && count > MAX_SHOWN_MODELS && r->walks == 0; k++)
        frame.hypothesis_count +=
            add_outline(p->model, &particles[k * (count / MAX_SHOWN_MODELS)], mirrored,
                        OTHER_STRENGTH, &memory->hypothesis[frame.hypothesis_count]);
    if (count > 0 && r->walks == 0)
        frame.hypothesis_count += add_outline(p->model, &particles[best], mirrored, BEST_STRENGTH,
                                              &memory->hypothesis[frame.hypothesis_count]);
    if (is_initial(r, step))
        (void)snprintf(label, sizeof label, "%d initial particles, at ends of strong chains",
                       (int)count);
    else if (r->walks > 0)
        (void)snprintf(
            label, sizeof label, "%d symmetric points, sample %d (largest weight); %d particles%s",
            (int)(r->walk[step + 1] - r->walk[step]), count > 0 ? (int)particles[best].sample : 0,
            (int)count, resampled ? ", resampled" : "");
    else
        (void)snprintf(label, sizeof label, "%s, sample %d%s",
                       mirrored ? "mirrored model" : "model",
                       count > 0 ? (int)particles[best].sample : 0, resampled ? ", resampled" : "");
    frame.label = label;
    return cairn_report_player_add_frame(player, &frame);
}

static cairn_status add_frames(cairn_report_player *player, const group_record *r,
                               const cairn_contour_file_picture *p, int32_t most)
{
    int32_t most_lines = 0, filtered = 0;
    frame_memory memory = {malloc(((size_t)most + 1) * sizeof *memory.pose),
                           malloc((size_t)most + 1), NULL};
    cairn_status status;

    for (int32_t step = 0; step < r->walks; step++) {
        int32_t lines =
            3 * (r->walk[step + 1] - r->walk[step]) + r->skeleton[step + 1] - r->skeleton[step];

        most_lines = lines > most_lines ? lines : most_lines;
    }
    memory.hypothesis =
        malloc(((size_t)MAX_SHOWN_MODELS * (size_t)p->model->outline_count + (size_t)most_lines) *
               sizeof *memory.hypothesis);
    status = memory.pose != NULL && memory.low_confidence != NULL && memory.hypothesis != NULL
                 ? CAIRN_OK
                 : CAIRN_NO_MEMORY;
    for (int32_t step = 0; step < r->steps && status == CAIRN_OK; step++) {
        filtered += !is_initial(r, step);
        status = add_frame(player, r, p, step, filtered, &memory);
    }
    /* Without particles the only frame shows the edges. */
    if (r->steps == 0 && status == CAIRN_OK) {
        cairn_report_frame frame = {
            .step = 1, .label = "no candidate for the model", .pose = memory.pose, .pose_count = 1};

        memset(memory.pose, 0, sizeof *memory.pose);
        status = cairn_report_player_add_frame(player, &frame);
    }
    free(memory.pose);
    free(memory.low_confidence);
    free(memory.hypothesis);
    return status;
}

/* Sets the searched image as the grid, bottom row first. */
static cairn_status set_grid(cairn_report_player *player, const cairn_contour_file_picture *p)
{
    int32_t w = p->tokens->width, h = p->tokens->height;
    uint8_t *pixel = malloc((size_t)w * (size_t)h);
    cairn_report_grid grid = {pixel, w, h, 1, {(cairn_real)-0.5, (cairn_real)(0.5 - h), 0}};
    cairn_status status = pixel != NULL ? CAIRN_OK : CAIRN_NO_MEMORY;

    /* The page draws black as walls and near white as free space, so the grey values are
     * compressed. */
    for (int32_t y = 0; y < h && pixel != NULL; y++)
        for (int32_t x = 0; x < w; x++)
            pixel[(h - 1 - y) * w + x] = (uint8_t)(90 + p->grey[y * w + x] / 2);
    if (status == CAIRN_OK)
        status = cairn_report_player_set_grid(player, &grid);
    free(pixel);
    return status;
}

static cairn_status record(cairn_report_player *player, const group_record *r,
                           const cairn_contour_file_picture *p)
{
    int32_t most = 0;
    cairn_status status;

    for (int32_t i = 0; i < r->steps; i++)
        most = r->first[i + 1] - r->first[i] > most ? r->first[i + 1] - r->first[i] : most;
    status = r->out_of_memory ? CAIRN_NO_MEMORY : add_scans(player, p->tokens, most);
    if (status == CAIRN_OK)
        status = add_frames(player, r, p, most);
    return status == CAIRN_OK && p->grey != NULL ? set_grid(player, p) : status;
}

cairn_status group_record_write(const group_record *r, const cairn_contour_file_picture *picture,
                                const char *path, cairn_file_error *error)
{
    static const cairn_report_curve curves[] = {
        {"N_eff", NULL, "effective sample size"},
        {"best likelihood", NULL, "mean over the steps"},
        {"modes", NULL, "modes of the particle set (as written: clusters of one start)"},
        {"followers", NULL, NULL},
    };
    cairn_report_player_params params = cairn_report_player_default();
    cairn_report_player *player;
    char subtitle[400];
    cairn_status status;

    (void)snprintf(subtitle, sizeof subtitle,
                   "%.120s: each robot is a particle on the axis of the object%s",
                   picture->model_name,
                   r->walks > 0 ? "; of the particle of largest weight: contour (thick dashes), "
                                  "skeleton (thin), look-ahead circles (regions of interest); "
                                  "skeletons of others (faint)"
                                : "");
    if (r->walks > 0)
        params.region_radius = (cairn_real)r->look_ahead;
    params.title = picture->image;
    params.subtitle = subtitle;
    params.curve = curves;
    params.curve_count = 4;
    params.image = (int32_t)picture->shrink;
    status = cairn_report_player_open(&player, &params);
    if (status == CAIRN_OK) {
        status = record(player, r, picture);
        if (status == CAIRN_OK)
            status = cairn_report_player_write(player, path, error);
        else
            (void)cairn_file_error_set(error, status, path, 0, "the page cannot be made: %s",
                                       cairn_status_text(status));
        cairn_report_player_free(player);
        return status;
    }
    return cairn_file_error_system(error, path, "write", ENOMEM);
}
