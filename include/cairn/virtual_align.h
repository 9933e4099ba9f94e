/* virtual_align: the aligner, and virtual scans for what it finds no place for.
 *
 *     add_scan ... -> begin -> step until CAIRN_OK -> read, pose_of
 *
 * Scans that share no surface with the others cannot be aligned by what they show alone; that walls
 * go on straight and rooms are rectangles tells where they belong. First the aligner brings
 * together what it can. Scans that it does not place then move in a force field of all scans and of
 * a virtual scan of those that stay (Adluru 2008, chapter 8, algorithm 2). From there the aligner
 * looks for them again; what it places then enters the map, and else only scans that share no
 * surface with its largest part stay where hypotheses have put them.
 *
 * Last, parts of the largest part that long walls alone hold are slid along these (wall_slide):
 * walls are as thick as elsewhere.
 *
 * So the influence of hypotheses is not set by hand: they propose, and how much better the map
 * explains itself decides. They never move what the scans themselves have settled, and are not made
 * for scans that they cannot help: those that show walls of one direction only, and those that may
 * slide. When the aligner finds no two scans that belong together, all move, and the virtual scan
 * is made anew every few iterations.
 *
 * Mode as written (cairn_virtual_align_as_written): algorithm 2, and nothing else: no aligner,
 * no slide. Force field simulation moves all scans, with the gradient of chapter 7; the first
 * iteration has no virtual scan; after every iteration one is made anew from the real scans as
 * they then lie, as written (virtual_scan.h). Real points weigh 1: no regions of interest. The
 * end is that of the force field. Choices: at most 100 iterations (fig. 8.12); sigma and dt are
 * those of section 7.4.2, as chapter 8 gives a sigma at the start alone, "in units of the data
 * set": for data whose unit is u m, sigma and dt are u times the thesis's numbers (section 7.4.2
 * has u = 0.01 m, and so have the defaults: sigma 15 to 4, dt 5 to 1). */
#ifndef CAIRN_VIRTUAL_ALIGN_H
#define CAIRN_VIRTUAL_ALIGN_H

#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/virtual_scan.h"
#include "cairn/wall_slide.h"

#ifdef __cplusplus
extern "C" {
#endif

/* In brackets the defaults. */
typedef struct cairn_virtual_align_params {
    /* its max_scans, max_segments and max_points hold for all parts */
    cairn_aligner_params aligner;
    /* its capacities are not read; springs, sigma from 0.9 m to 0.03 m in 15 steps, the two
     * faces of a wall apart from the start */
    cairn_force_field_params field;
    /* its max_scans, max_points and max_segments are not read */
    cairn_virtual_scan_params hypotheses;
    /* its max_scans is not read */
    cairn_wall_slide_params slide;
    /* >= 1: iterations of the field from one virtual scan to the next while the scans that it is
     * made of move (8) */
    int32_t every;
    /* >= 1: of the field, each followed by the aligner, as long as scans are without a place (2) */
    int32_t max_rounds;
    /* 0: without the aligner: all scans move from their initial poses, and none slides (1) */
    int32_t align;
    /* CAIRN_MODE_DEFAULT; CAIRN_MODE_AS_WRITTEN: every, max_rounds, align, slide,
     * hypotheses.mode and of the field mode, roi and sides_below are not read
     * (CAIRN_MODE_DEFAULT) */
    int32_t mode;
} cairn_virtual_align_params;

/* A scan in the result. */
typedef struct cairn_virtual_align_pose {
    /* by the aligner; map_scan as it stands now */
    cairn_aligner_pose aligned;
    /* 1: by the force field, with the virtual scan, or slid along the walls that it shows */
    int32_t moved;
} cairn_virtual_align_pose;

typedef struct cairn_virtual_align_result {
    cairn_aligner_result aligner;
    /* of the field */
    int32_t rounds;
    /* scans that the field moved in the last of them */
    int32_t moved;
    /* of the field */
    int32_t iterations;
    /* of these, with hypotheses of some weight */
    int32_t active;
    /* in the last virtual scan */
    int32_t hypotheses;
    /* of budget; the slide's are the hypotheses' */
    int64_t align_units, hypothesis_units, field_units;
    cairn_wall_slide_result slide;
} cairn_virtual_align_result;

typedef struct cairn_virtual_align cairn_virtual_align;

/* The defaults above. */
cairn_virtual_align_params cairn_virtual_align_default(void);

/* Mode as written: see above. */
cairn_virtual_align_params cairn_virtual_align_as_written(void);

/* For hypotheses.max_virtual and hypotheses.hough.distances as written, of maps of some 20 m: a
 * line reaches over all of the map. */
enum { CAIRN_VIRTUAL_ALIGN_WRITTEN_POINTS = 1 << 15, CAIRN_VIRTUAL_ALIGN_WRITTEN_DISTANCES = 512 };

/* 0 for params that create() would refuse. */
size_t cairn_virtual_align_memory(const cairn_virtual_align_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_virtual_align_create(cairn_virtual_align **align, cairn_pool *pool,
                                                      const cairn_virtual_align_params *params);

/* As cairn_aligner_add_scan, with its statuses. */
CAIRN_CHECKED cairn_status cairn_virtual_align_add_scan(cairn_virtual_align *align,
                                                        const cairn_scan_view *view,
                                                        cairn_pose map_scan, cairn_fault *fault);

/* Adds a kind of hypothesis, as cairn_virtual_scan_add_detector, with its statuses.
 * CAIRN_BAD_ARGUMENT: NULL. Its step() must not fail. */
CAIRN_CHECKED cairn_status cairn_virtual_align_add_detector(
    cairn_virtual_align *align, const cairn_hypothesis_detector *detector);

/* Forgets all scans. Constant time. */
void cairn_virtual_align_clear(cairn_virtual_align *align);

/* Starts from the initial poses. CAIRN_BAD_ARGUMENT: NULL. CAIRN_EMPTY: no scans. Linear in the
 * scans. */
CAIRN_CHECKED cairn_status cairn_virtual_align_begin(cairn_virtual_align *align);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: nothing left to do. */
CAIRN_CHECKED cairn_status cairn_virtual_align_step(cairn_virtual_align *align,
                                                    cairn_budget *budget);

/* As step(), but also returns CAIRN_OK when the aligner has ended and after every iteration of
 * the field, for watching. */
CAIRN_CHECKED cairn_status cairn_virtual_align_iterate(cairn_virtual_align *align,
                                                       cairn_budget *budget);

/* Whether step() has anything left to do. */
int32_t cairn_virtual_align_running(const cairn_virtual_align *align);

/* ---- The result ---- */

cairn_virtual_align_result cairn_virtual_align_read(const cairn_virtual_align *align);

/* All zero for a scan that is not there. While the field runs: as it stands at its last commit
 * point. */
cairn_virtual_align_pose cairn_virtual_align_pose_of(const cairn_virtual_align *align,
                                                     int32_t scan);

/* What is at work, for pictures and measurements. */
const cairn_aligner *cairn_virtual_align_aligner(const cairn_virtual_align *align);
const cairn_force_field *cairn_virtual_align_field(const cairn_virtual_align *align);
const cairn_virtual_scan *cairn_virtual_align_hypotheses(const cairn_virtual_align *align);

#ifdef __cplusplus
}
#endif

#endif
