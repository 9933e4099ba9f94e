/* force_field: force field simulation (FFS): simultaneous rigid registration of all scans.
 *
 * Method. Every scan is a rigid body of point masses; points of different scans attract each other
 * (force_kernel). In every iteration each scan moves as a rigid body from rest in the time dt.
 * sigma, the width of the attraction, and dt decrease from iteration to iteration (annealing;
 * Adluru 2008, chapter 7, algorithm 1). Points near corners of the global map, the regions of
 * interest, have a higher mass in the forces. In the motion all points have mass 1.
 *
 * cairn_force_field_as_written() is chapter 7 as printed. Choices, where the text is silent or
 * misprinted:
 *
 * - Lengths are in cm there, so dt 5 ... 1 is 0.05 ... 0.01 s in m.
 * - |cos| replaces the cos of eq. 7.2, since directions are those of lines.
 * - Coinciding points exert no force.
 * - A point in a region of interest has 4 times its mass.
 * - A corner lies within 0.30 m of both segments.
 * - The centre of rotation becomes the sensor when sigma is below half of its start.
 * - The iteration stops when the mean relocation is below 0.1 mm (printed: "until > Threshold").
 * - Points farther apart than 4 sigma are left out, not only lines whose boxes, grown by 2 sigma,
 *   are disjoint.
 * - Points should be 0.10 m apart, as those of module scan are by default.
 *
 * Limits: steps are proportional to the density of points, and the force of eq. 7.1 does not vanish
 * towards distance 0. So scans at the optimum oscillate by about 1/2 a dt^2 instead of coming to
 * rest. P(g) at the end of a run compares with P(g) at its start only for the same sigma.
 *
 * Inputs (scans, fixing, restarts) take effect at the next commit point, the end of the current
 * iteration, or at once when none is in progress. Readers show the last commit point. The result is
 * a function of the inputs and of the commit points at which they took effect. */
#ifndef CAIRN_FORCE_FIELD_H
#define CAIRN_FORCE_FIELD_H

#include "cairn/corner.h"
#include "cairn/force_kernel.h"
#include "cairn/object.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Motion model of the scans. */
typedef int32_t cairn_force_field_mode;
enum {
    /* the motion of chapter 7: each scan on its own, with the accelerations of eqs. 7.6 and 7.7;
     * all of the chapter, regions and constants too: cairn_force_field_as_written() */
    CAIRN_FORCE_FIELD_GRADIENT = CAIRN_MODE_AS_WRITTEN,
    /* all scans jointly: each pair of points is a spring with the same force; scans move by
     * 1/2 dt^2 times the motion to the equilibrium of all springs */
    CAIRN_FORCE_FIELD_SPRINGS = 2
};

/* Regions of interest around corners: intersections of the lines of two segments at about a right
 * angle. ENDS: near an end of both segments. CROSSINGS: near both segments, anywhere along them (T
 * and X junctions too, as in the thesis). */
enum {
    /* no regions of interest */
    CAIRN_FORCE_FIELD_ROI_NONE = 0,
    /* about corners near the ends of both segments */
    CAIRN_FORCE_FIELD_ROI_ENDS = 1,
    /* about corners near both segments, T and X crossings included */
    CAIRN_FORCE_FIELD_ROI_CROSSINGS = 2
};

/* Parameters; defaults in brackets. Where the thesis has a value, it is the default. The thesis's
 * dt of 5 to 1 is 0.05 to 0.01 here: accelerations in m are 1e4 times those in cm. */
typedef struct cairn_force_field_params {
    /* any (CAIRN_FORCE_FIELD_GRADIENT): motion model */
    cairn_force_field_mode mode;
    /* 1 ... 2^20 (64): maximum number of scans */
    int32_t max_scans;
    /* 1 ... 2^24 (1024): capacity for segments of all scans */
    int32_t max_segments;
    /* 1 ... 2^24 (8192): capacity for points of all scans */
    int32_t max_points;
    /* 1 ... 2^24 (1024): maximum number of corners, the strongest; unused without roi */
    int32_t max_corners;
    /* m, > 0, <= 1e6 (0.15): sigma in the first iteration; 15 cm in the thesis */
    cairn_real sigma_start;
    /* m, > 0, <= sigma_start (0.04): minimum sigma; 4 cm in the thesis */
    cairn_real sigma_end;
    /* m, >= 0, <= 1e6 (0.0025): decrement of sigma per iteration; 0.25 cm in the thesis */
    cairn_real sigma_step;
    /* 0 ... 1 (1): factor of sigma per iteration, before the decrement */
    cairn_real sigma_factor;
    /* m, >= 0, <= 1e6 (0): at sigma up to this value directions are oriented: the two faces of a
     * wall do not attract each other, max(0, cos) replaces |cos| */
    cairn_real oriented_below;
    /* s, > 0, <= 1e6 (0.05): time step in the first iteration; 5 in the thesis */
    cairn_real dt_start;
    /* s, > 0, <= dt_start (0.01): minimum time step; 1 in the thesis */
    cairn_real dt_end;
    /* 0 ... 1 (0.96): factor of the time step per iteration */
    cairn_real dt_factor;
    /* sigma, > 0, <= 6 (4): cut-off distance of pairs. At 4 a force has fallen to 3e-4 of its
     * start; the thesis grows the boxes of segments by 2 sigma. */
    cairn_real reach;
    /* >= 0, <= 1e6 (0.5): the centre of rotation is the centre of mass while sigma >= sensor_below
     * * sigma_start, then the sensor; 0: always the centre of mass */
    cairn_real sensor_below;
    /* CAIRN_FORCE_FIELD_ROI_NONE ... CAIRN_FORCE_FIELD_ROI_CROSSINGS (CAIRN_FORCE_FIELD_ROI_ENDS):
     * kind of regions of interest */
    int32_t roi;
    /* m, > 0, <= 1e6 (0.05): radius of a region about its corner; 5 cm in the thesis */
    cairn_real roi_radius;
    /* > 0, <= 1e6 (4): factor of the mass of a point in a region */
    cairn_real roi_mass;
    /* m, > 0 (0.30): maximum distance of a corner from both segments or their ends (see roi) */
    cairn_real corner_distance;
    /* rad, > 0, <= corner_max_opening (80 degrees): minimum opening of a corner */
    cairn_real corner_min_opening;
    /* rad, >= corner_min_opening, < pi (100 degrees): maximum opening */
    cairn_real corner_max_opening;
    /* 0 or 1 (1): 1: P(g) is computed as well; always with alignment_torque */
    int32_t potential;
    /* >= 1 (50): maximum iterations of a run */
    int32_t max_steps;
    /* m, >= 0, <= 1e6 (0.0001): a run stops when the mean relocation of an iteration is below */
    cairn_real stop_relocation;
    /* m, >= 0, <= 1e6 (0): 0: the points of the scans are stored. > 0: they are generated from the
     * ends of their segments on demand, with the same results; see cairn_scan_set_params. */
    cairn_real spacing;
    /* 0 ... 2^24 (0): capacity for external points */
    int32_t max_extra;
    /* 0 ... 2^24 (0): capacity for bonds, pairs of scans near each other; further pairs are
     * ignored */
    int32_t max_bonds;
    /* 0 ... 1 (0.1): stiffness of a spring tangential to the lines of its points, relative to
     * normal */
    cairn_real tangential_stiffness;
    /* m, >= 0, <= 1e6 (0.35): a translation of a scan is damped by (sigma / damping_sigma)^3 times
     * its own stiffness, so headings settle first; 0: no damping */
    cairn_real damping_sigma;
    /* >= 0, <= 1e6 (0): strength of the alignment of directions: each pair of points exerts the
     * torque alignment_torque/2 erfc(r / (sigma sqrt 2)) sin cos^3 of the angle between the lines;
     * 0: none */
    cairn_real alignment_torque;
    /* m, > 0, <= 1e6 (0.3): maximum root mean square displacement of the points of a scan per
     * iteration */
    cairn_real max_relocation;
} cairn_force_field_params;

/* State of the simulation. */
typedef int32_t cairn_force_field_verdict;
enum {
    /* the run has not ended */
    CAIRN_FORCE_FIELD_RUNNING = 0,
    CAIRN_FORCE_FIELD_CONVERGED = 1,   /* mean relocation below stop_relocation */
    CAIRN_FORCE_FIELD_OUT_OF_STEPS = 2 /* max_steps iterations done */
};

/* Measurements. The first four fields count over the whole life of the object. The others are those
 * of the last committed iteration (0 before the first). */
typedef struct cairn_force_field_state {
    /* running, or how the run has ended */
    cairn_force_field_verdict verdict;
    /* iterations since creation or clear(), restarts included */
    int32_t iterations;
    /* work units charged by all steps */
    int64_t units;
    /* work units of the most expensive call of a step */
    int32_t max_step_units;
    /* iterations since the last start of the cooling */
    int32_t start_iterations;
    /* pairs of points within reach */
    int64_t pairs;
    /* pairs of colliding segments of different scans */
    int32_t segment_pairs;
    /* corners with a region of interest */
    int32_t corners;
    /* corners beyond max_corners */
    int32_t corners_dropped;
    /* pairs of scans joined by springs */
    int32_t bonds;
    /* pairs of lines ignored, beyond max_bonds */
    int32_t bonds_dropped;
    /* m, s: as used */
    cairn_real sigma, dt;
    /* P(g) at the poses from which the iteration started; 0 when not computed */
    cairn_real potential;
    /* m: mean over the free scans with points of the root mean square displacement of their
     * points */
    cairn_real mean_relocation;
} cairn_force_field_state;

/* Motion of a scan in an iteration. */
typedef struct cairn_force_field_motion {
    /* m: centre of rotation in the map, before the motion */
    cairn_vec2 centre;
    /* sum of the forces on the points, in the map: minus the gradient of P(g) with respect to a
     * translation */
    cairn_vec2 force;
    /* torque about the centre */
    cairn_real torque;
    /* m: root mean square displacement of the points to first order; 0 when fixed */
    cairn_real relocation;
} cairn_force_field_motion;

/* Force field simulation of scans. */
typedef struct cairn_force_field cairn_force_field;

/* Upper bounds of cairn_force_field_memory as constant expressions, without external points: with
 * the points of the scans stored ... */
#define CAIRN_FORCE_FIELD_BYTES(scans, points, segments, corners)                                  \
    (CAIRN_FORCE_FIELD_OTHER_BYTES(scans, points, segments, corners) +                             \
     CAIRN_SCAN_SET_BYTES(scans, points, segments) +                                               \
     CAIRN_ALLOCATION_BYTES(points, sizeof(cairn_vec2)) +                                          \
     CAIRN_ALLOCATION_BYTES(points, sizeof(cairn_real)))

/* ... generated from the segments ... */
#define CAIRN_FORCE_FIELD_PLACES_BYTES(scans, points, segments, corners)                           \
    (CAIRN_FORCE_FIELD_OTHER_BYTES(scans, points, segments, corners) +                             \
     CAIRN_SCAN_SET_BITS_BYTES(scans, points, segments) +                                          \
     CAIRN_ALLOCATION_BYTES((points) / 32 + 1, sizeof(uint32_t)))

/* ... in addition for external points ... */
#define CAIRN_FORCE_FIELD_EXTRA_BYTES(extra)                                                       \
    (2 * (2 * CAIRN_ALLOCATION_BYTES(extra, sizeof(cairn_vec2)) +                                  \
          CAIRN_ALLOCATION_BYTES(extra, sizeof(cairn_real)) +                                      \
          CAIRN_ALLOCATION_BYTES((extra) + 1, sizeof(int32_t))) +                                  \
     CAIRN_ALLOCATION_BYTES(extra, sizeof(cairn_box)) +                                            \
     CAIRN_ALLOCATION_BYTES(extra, sizeof(int32_t)))

/* ... in addition for springs ... */
#define CAIRN_FORCE_FIELD_BOND_BYTES(scans, bonds)                                                 \
    (CAIRN_ALLOCATION_BYTES(bonds, 16 + 9 * sizeof(cairn_real)) +                                  \
     CAIRN_ALLOCATION_BYTES(scans, 8 + 21 * sizeof(cairn_real)))

/* ... and the common part. */
#define CAIRN_FORCE_FIELD_OTHER_BYTES(scans, points, segments, corners)                            \
    (1408 + 512 * sizeof(cairn_real) + CAIRN_CORNER_BYTES(segments, corners) +                     \
     2 * CAIRN_ALLOCATION_BYTES(scans, sizeof(cairn_pose) + sizeof(cairn_force_field_motion)) +    \
     CAIRN_ALLOCATION_BYTES(scans, 40 + (13 * sizeof(cairn_real) + 7) / 8 * 8) +                   \
     CAIRN_ALLOCATION_BYTES(segments, sizeof(cairn_segment)) +                                     \
     CAIRN_ALLOCATION_BYTES(segments, sizeof(cairn_vec2)) +                                        \
     CAIRN_ALLOCATION_BYTES(segments, sizeof(cairn_box)) +                                         \
     CAIRN_ALLOCATION_BYTES((points) / 32 + 1, sizeof(uint32_t)) +                                 \
     CAIRN_ALLOCATION_BYTES(segments, sizeof(int32_t)) +                                           \
     CAIRN_ALLOCATION_BYTES(corners, sizeof(cairn_vec2)) +                                         \
     3 * CAIRN_ALLOCATION_BYTES(corners, sizeof(int32_t)))

/* Returns the default parameters. */
cairn_force_field_params cairn_force_field_default(void);

/* Returns force field simulation as written: the defaults, but corners are intersections near the
 * segments, anywhere along them (section 7.3.4, fig. 7.5), not only near their ends. 50 iterations
 * (figs 7.8, 7.9); the thesis has 150 for the apartment, 20 for the maze, 12 for three corners. */
cairn_force_field_params cairn_force_field_as_written(void);

/* Returns the defaults with dt_start and dt_end for points `spacing` m apart. Forces are
 * proportional to the density of points and steps to dt^2, so dt grows with the root of the
 * spacing. The defaults are those for 0.02.
 *
 * spacing: spacing of the points, m, > 0 */
cairn_force_field_params cairn_force_field_spaced(cairn_real spacing);

/* Returns params of mode SPRINGS, for maps that the defaults hardly improve: little overlap, large
 * heading errors, wrong loop closures. Differences from the thesis: the motion model; sigma falls
 * by a factor, to 0.03 m in `steps` iterations (>= 1); the first iterations overshoot, by 1/2 dt^2
 * from 5 down to 1 times the motion to equilibrium; directions are oriented at sigma up to 0.15 m;
 * reach 2.5 sigma; no regions of interest; alignment_torque 40, which follows from P(g), since that
 * depends on the angle between directions. sigma_start, m, > 0, should be about the error of the
 * points: 0.15 for nearly correct poses, as after a wrong loop closure, 0.8 for heading errors up
 * to 20 degrees. max_bonds suffices for max_scans scans that are all near each other.
 *
 * sigma_start: sigma in the first iteration, m, > 0
 * steps: iterations in which sigma falls, >= 1 */
cairn_force_field_params cairn_force_field_springs(cairn_real sigma_start, int32_t steps);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_force_field_check(const cairn_force_field_params *params,
                                                   cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_force_field_memory(const cairn_force_field_params *params);

/* Creates a force field in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params.
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_force_field_create(cairn_force_field **field, cairn_pool *pool,
                                                    const cairn_force_field_params *params);

/* Returns the index of the next scan added: that of a removed scan whose slot is free again, else
 * the number of indices used so far; -1: max_scans scans are present. A scan keeps its index. */
int32_t cairn_force_field_next(const cairn_force_field *field);

/* Adds a scan at the pose map_scan. View, mass, fault and statuses are as in cairn_scan_set_add;
 * mass: of the points in the forces outside regions of interest. CAIRN_BAD_ARGUMENT: also a pose
 * beyond 1e6 m. A scan without points has no effect. Adding does not change the cooling and does
 * not start a stopped simulation: restart() does. Linear in the scan.
 *
 * view: segments and points of the scan
 * mass: [point_count] masses of the points outside regions of interest; NULL: all 1 */
CAIRN_CHECKED cairn_status cairn_force_field_add_scan(cairn_force_field *field,
                                                      const cairn_scan_view *view,
                                                      const cairn_real *mass, cairn_pose map_scan,
                                                      cairn_fault *fault);

/* Fixes (yes not 0) or frees a scan. A fixed scan exerts forces but does not move. Pairs of fixed
 * scans are skipped, in the potential as well. CAIRN_BAD_ARGUMENT: no such scan. Constant time.
 *
 * scan: index of the scan
 * yes: 0: the scan is free */
CAIRN_CHECKED cairn_status cairn_force_field_fix(cairn_force_field *field, int32_t scan,
                                                 int32_t yes);

/* Sets the pose of a scan, as from another method. CAIRN_BAD_ARGUMENT: no such scan, an iteration
 * is in progress, or a pose beyond 1e6 m. CAIRN_NOT_FINITE. Constant time. */
CAIRN_CHECKED cairn_status cairn_force_field_place(cairn_force_field *field, int32_t scan,
                                                   cairn_pose map_scan);

/* Removes a scan. Its index is reused and its memory free when a later step has reached the next
 * iteration or has returned CAIRN_OK. CAIRN_BAD_ARGUMENT: no such scan. Constant time; the steps
 * are charged for compaction. */
CAIRN_CHECKED cairn_status cairn_force_field_remove(cairn_force_field *field, int32_t scan);

/* Replaces the external points: points in the map that exert forces on the scans but belong to
 * none, such as virtual scans (chapter 8). Pairs with them count in P(g). weights: [count], >= 0,
 * as masses. Regions of interest do not change them. They take effect at the next commit point. Few
 * different successive directions are fastest. CAIRN_FULL: count > max_extra. CAIRN_NOT_FINITE.
 * CAIRN_BAD_ARGUMENT: NULL, a coordinate beyond 1e6 m, a weight below 0 or beyond 1e6. Linear in
 * count.
 *
 * points: [count] points in the map */
CAIRN_CHECKED cairn_status cairn_force_field_set_extra(cairn_force_field *field,
                                                       const cairn_oriented_point *points,
                                                       const cairn_real *weights, int32_t count);

/* Restarts the cooling: sigma, dt and the count against max_steps. Constant time. */
void cairn_force_field_restart(cairn_force_field *field);

/* Removes all scans and external points at once; the field is as after its creation. Constant
 * time. */
void cairn_force_field_clear(cairn_force_field *field);

/* Continues the simulation. CAIRN_MORE: the budget is used up. CAIRN_OK: the simulation has
 * stopped, see the verdict. CAIRN_EMPTY: there are no scans. Never exceeds the budget: an item of
 * several units is charged first, over several calls if needed. Cost per iteration, about: six
 * units for each scan, three for each segment and one for two points; with regions of interest the
 * search for corners and three units for each point; the sweep over the segments; for each pair of
 * near segments eleven units, two more per 16 of their points, and for each point of the one a
 * unit, one more for eight points of the other when some may be within reach, and one for each pair
 * of points within reach. Scans that rested among resting scans cost two units for each segment. */
CAIRN_CHECKED cairn_status cairn_force_field_step(cairn_force_field *field, cairn_budget *budget);

/* As step(), but also returns CAIRN_OK at the next commit point, to inspect every iteration. */
CAIRN_CHECKED cairn_status cairn_force_field_iterate(cairn_force_field *field,
                                                     cairn_budget *budget);

/* Returns a counter that grows by 1 with every commit point that changed something: an iteration,
 * or a scan that took effect. */
uint32_t cairn_force_field_revision(const cairn_force_field *field);

/* Returns the bound of the indices of scans that have taken effect. */
int32_t cairn_force_field_pose_count(const cairn_force_field *field);

/* Returns 1 when the scan has taken effect and was not removed. */
int32_t cairn_force_field_has(const cairn_force_field *field, int32_t scan);

/* Returns map_scan of a scan, 0 <= scan < pose_count; the last pose of a removed one until its
 * index is reused.
 *
 * scan: index of the scan */
cairn_pose cairn_force_field_pose(const cairn_force_field *field, int32_t scan);

/* Returns the motion of a scan in the last iteration, 0 <= scan < pose_count; zeros before its
 * first.
 *
 * scan: index of the scan */
cairn_force_field_motion cairn_force_field_motion_of(const cairn_force_field *field, int32_t scan);

/* Returns the state after the last complete iteration. */
cairn_force_field_state cairn_force_field_read(const cairn_force_field *field);

/* Returns P(g) of the last committed iteration, as in the state. */
cairn_real cairn_force_field_potential(const cairn_force_field *field);

/* Returns segments and points of all scans in the frames of the scans; scans that have not taken
 * effect yet are last. */
const cairn_scan_set *cairn_force_field_scans(const cairn_force_field *field);

/* Computes the force on point `index` of a scan and the point's mass in the last iteration, in the
 * map before the motion. CAIRN_BAD_ARGUMENT: no such point. CAIRN_EMPTY: an iteration is in
 * progress, none included the scan, or scans have been removed since. For visualization: the force
 * is summed again, linear in the segments and the points within reach.
 *
 * scan: index of the scan
 * index: index of the point in the scan
 * force, mass: set to the force and to the mass */
CAIRN_CHECKED cairn_status cairn_force_field_point_force(const cairn_force_field *field,
                                                         int32_t scan, int32_t index,
                                                         cairn_vec2 *force, cairn_real *mass);

/* Returns the corners of the field's last search, strongest first. They belong to the poses before
 * the last motion, or to the current ones when the current iteration has found them already.
 * Segment indices count through all scans. None without roi.
 *
 * count: set to their number */
const cairn_corner *cairn_force_field_corners(const cairn_force_field *field, int32_t *count);

#ifdef __cplusplus
}
#endif

#endif
