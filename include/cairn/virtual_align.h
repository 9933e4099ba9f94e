/* virtual_align: alignment of scans with little overlap by the aligner and virtual scans.
 *
 *     add_scan ... -> begin -> step until CAIRN_OK -> read, pose_of
 *
 * Scans that share no surface with others cannot be aligned by overlap. Structural priors help:
 * walls continue straight and rooms are rectangles.
 *
 * Method.
 *
 * 1. The aligner aligns the scans that overlap: they are anchored (cairn_aligner_pose).
 * 2. The others move in a force field of all scans and of a virtual scan made from the anchored ones
 *    (Adluru 2008, chapter 8, algorithm 2).
 * 3. From these poses the aligner searches for them again. Scans that it anchors then enter the map.
 *    Otherwise only scans that share no surface with the largest connected component keep the poses
 *    of the force field.
 * 4. Submaps of the largest component that only long parallel walls hold are translated along these
 *    (weak_direction), so that walls get the thickness of others.
 *
 * The influence of hypotheses needs no manual setting: they propose poses, and the consistency of
 * the map decides. They never move scans that the aligner has anchored. They are not made for scans
 * that they cannot help: those with walls of one direction only, and those with an unobservable
 * translation. When the aligner matches no two scans, all scans move, and the virtual scan is
 * rebuilt every few iterations.
 *
 * Mode as written (cairn_virtual_align_as_written): algorithm 2 alone, without aligner and
 * translation of submaps. Force field simulation moves all scans, with the gradient of chapter 7.
 * The first iteration has no virtual scan; after every iteration one is built from the current
 * poses of the real scans, as written (virtual_scan.h). Real points have weight 1: no regions of
 * interest. The run ends with that of the force field. Choices: at most 100 iterations (fig. 8.12).
 * sigma and dt are those of section 7.4.2, since chapter 8 gives an initial sigma alone, "in units
 * of the data set": for data of unit u m, sigma and dt are u times the thesis's numbers. Section
 * 7.4.2 has u = 0.01 m, and so have the defaults: sigma 15 to 4, dt 5 to 1. */
#ifndef CAIRN_VIRTUAL_ALIGN_H
#define CAIRN_VIRTUAL_ALIGN_H

#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/object.h"
#include "cairn/virtual_scan.h"
#include "cairn/weak_direction.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_virtual_align_params {
    /* its max_scans, max_segments and max_points apply to all modules */
    cairn_aligner_params aligner;
    /* its capacities are ignored; mode SPRINGS, sigma from 0.9 m to 0.03 m in 15 steps, oriented
     * directions from the start */
    cairn_force_field_params field;
    /* its max_scans, max_points and max_segments are ignored */
    cairn_virtual_scan_params hypotheses;
    /* its max_scans is ignored */
    cairn_weak_direction_params weak_direction;
    /* >= 1 (8): iterations of the field between two virtual scans while their source scans move */
    int32_t rebuild_interval;
    /* >= 1 (2): maximum runs of the field, each followed by the aligner, while scans are
     * not anchored */
    int32_t max_rounds;
    /* 0 or 1 (1): 0: no aligner: all scans move from their initial poses, and none is translated
     * along walls */
    int32_t use_aligner;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written,
     * rebuild_interval, max_rounds, use_aligner, weak_direction, hypotheses.mode, and the field's
     * mode, roi and oriented_below are ignored */
    int32_t mode;
} cairn_virtual_align_params;

/* A scan in the result. */
typedef struct cairn_virtual_align_pose {
    /* result of the aligner; map_scan is the current pose */
    cairn_aligner_pose aligned;
    /* 1: moved by the force field with the virtual scan, or translated along its walls */
    int32_t moved;
} cairn_virtual_align_pose;

/* Result of an alignment: that of the aligner and that of the translations. */
typedef struct cairn_virtual_align_result {
    /* result of the last run of the aligner */
    cairn_aligner_result aligner;
    /* runs of the field */
    int32_t rounds;
    /* scans that the field moved in the last run */
    int32_t moved_scans;
    /* iterations of the field */
    int32_t iterations;
    /* of which with hypotheses of positive weight */
    int32_t active_iterations;
    /* hypotheses in the last virtual scan */
    int32_t hypotheses;
    /* work units; those of the translation count as hypothesis_units */
    int64_t align_units, hypothesis_units, field_units;
    /* translations along weakly observable directions */
    cairn_weak_direction_result weak_direction;
} cairn_virtual_align_result;

/* Joint alignment of scans by force field, virtual scans and aligner. */
typedef struct cairn_virtual_align cairn_virtual_align;

/* Returns the default parameters. */
cairn_virtual_align_params cairn_virtual_align_default(void);

/* Returns the params of the mode as written, see above. Memory for lines, rectangles and hypotheses
 * is larger than by default. max_virtual is the default and distances that of hough as written: the
 * caller sets both by the enumeration below, or larger. */
cairn_virtual_align_params cairn_virtual_align_as_written(void);

/* Values of hypotheses.max_virtual and hypotheses.hough.distances as written, for maps of about 20
 * m: a line extends over the whole map. */
enum {
    /* points of the virtual scan */
    CAIRN_VIRTUAL_ALIGN_WRITTEN_POINTS = 1 << 15,
    /* bins of the distance of a line */
    CAIRN_VIRTUAL_ALIGN_WRITTEN_DISTANCES = 512
};

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_virtual_align_check(const cairn_virtual_align_params *params,
                                                     cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_virtual_align_memory(const cairn_virtual_align_params *params);

/* Creates an object in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_virtual_align_create(cairn_virtual_align **align, cairn_pool *pool,
                                                      const cairn_virtual_align_params *params);

/* Adds a scan as cairn_aligner_add_scan, with its statuses.
 *
 * view: scan with its segments, points and beams */
CAIRN_CHECKED cairn_status cairn_virtual_align_add_scan(cairn_virtual_align *align,
                                                        const cairn_scan_view *view,
                                                        cairn_pose map_scan, cairn_fault *fault);

/* Adds a kind of hypothesis as cairn_virtual_scan_add_detector, with its statuses.
 * CAIRN_BAD_ARGUMENT: NULL. Its step() must not fail.
 *
 * detector: callbacks, which are copied */
CAIRN_CHECKED cairn_status cairn_virtual_align_add_detector(
    cairn_virtual_align *align, const cairn_virtual_scan_hypothesis_detector *detector);

/* Removes all scans. Constant time. */
void cairn_virtual_align_clear(cairn_virtual_align *align);

/* Starts from the initial poses. CAIRN_BAD_ARGUMENT: NULL. CAIRN_EMPTY: no scans. Linear in the
 * scans. */
CAIRN_CHECKED cairn_status cairn_virtual_align_begin(cairn_virtual_align *align);

/* Continues the alignment. CAIRN_MORE: the budget is used up. CAIRN_OK: nothing left to do. */
CAIRN_CHECKED cairn_status cairn_virtual_align_step(cairn_virtual_align *align,
                                                    cairn_budget *budget);

/* As step(), but also returns CAIRN_OK when the aligner has ended and after every iteration of the
 * field, for visualization. */
CAIRN_CHECKED cairn_status cairn_virtual_align_iterate(cairn_virtual_align *align,
                                                       cairn_budget *budget);

/* Returns 1 when step() has anything left to do. */
int32_t cairn_virtual_align_running(const cairn_virtual_align *align);

/* ---- The result ---- */

/* Returns the result; valid when step() has returned CAIRN_OK. */
cairn_virtual_align_result cairn_virtual_align_read(const cairn_virtual_align *align);

/* Returns the result of a scan; all zero for an unknown scan. While the field runs: its pose at the
 * last commit point. */
cairn_virtual_align_pose cairn_virtual_align_pose_of(const cairn_virtual_align *align,
                                                     int32_t scan);

/* Returns the objects inside, for visualization and measurements. */
const cairn_aligner *cairn_virtual_align_aligner(const cairn_virtual_align *align);
const cairn_force_field *cairn_virtual_align_field(const cairn_virtual_align *align);
const cairn_virtual_scan *cairn_virtual_align_hypotheses(const cairn_virtual_align *align);

#ifdef __cplusplus
}
#endif

#endif
