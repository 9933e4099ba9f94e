/* force_field: force field simulation (FFS): aligns all scans at once.
 *
 * Every scan is a rigid body of point masses; points of different scans attract each other
 * (force_kernel), and in every iteration each scan moves as a rigid body from rest would in the
 * time dt. sigma, the reach of the attraction, and dt shrink from iteration to iteration (Adluru
 * 2008, chapter 7, algorithm 1). Points near corners of the global map, the regions of interest,
 * have a higher mass in the forces; in the motion all points have mass 1.
 *
 * cairn_force_field_as_written() is chapter 7 as it is printed. Choices, where the text is silent
 * or misprinted: lengths are in cm there, so dt 5 ... 1 is 0.05 ... 0.01 s in m; |cos| for the cos
 * of eq. 7.2, as directions are those of lines; points that coincide exert no force; a point in a
 * region has 4 times its mass; a corner lies within 0.30 m of both segments; the centre of rotation
 * becomes the sensor when sigma is below half of its start; it stops when the mean relocation is
 * below 0.1 mm (printed: "until > Threshold"); points farther apart than 4 sigma are left out, not
 * only the lines whose boxes, grown by 2 sigma, are apart. Points are to be 0.10 m apart, as scan's
 * are by default.
 *
 * What to expect: steps are proportional to the density of points, and the force of eq. 7.1 does
 * not fade towards distance 0, so that scans at their goal swing by about 1/2 a dt^2 rather than
 * come to rest. P(g) at the end of a run compares with P(g) at its start only for the same sigma.
 *
 * Scans, fixing and restarts are inputs: they take effect at the next commit point, which is the
 * end of the iteration under way, or at once when none is. Readers show the last commit point.
 * The result is a function of the inputs and of the commit points at which they took effect. */
#ifndef CAIRN_FORCE_FIELD_H
#define CAIRN_FORCE_FIELD_H

#include "cairn/corner.h"
#include "cairn/force_kernel.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How scans are moved. */
typedef int32_t cairn_force_field_mode;
enum {
    /* As in the thesis: each scan on its own, with the accelerations of eqs. 7.6 and 7.7. */
    CAIRN_FORCE_FIELD_GRADIENT = CAIRN_MODE_AS_WRITTEN,
    CAIRN_FORCE_FIELD_SPRINGS =
        2 /* all scans together, each pair of points as a spring that pulls as the force does: by
                                       1/2 dt^2 times the motion that brings all springs to rest */
};

/* Regions of interest: about intersections of the lines of two segments at about a right angle,
 * near an end of both (ENDS), or near both segments, wherever along them (CROSSINGS: T and X,
 * too, as in the thesis). */
enum {
    CAIRN_FORCE_FIELD_ROI_NONE = 0,
    CAIRN_FORCE_FIELD_ROI_ENDS = 1,
    CAIRN_FORCE_FIELD_ROI_CROSSINGS = 2
};

/* In brackets the defaults; where the thesis has a value it is the default, in its cm for
 * comparison. The thesis's dt of 5 to 1 is 0.05 to 0.01 here: accelerations in m are 1e4 times
 * those in cm. */
typedef struct cairn_force_field_params {
    /* (CAIRN_FORCE_FIELD_GRADIENT) */
    cairn_force_field_mode mode;
    /* 1 ... 2^20 (64) */
    int32_t max_scans;
    /* of all scans, 1 ... 2^24 (1024) */
    int32_t max_segments;
    /* of all scans, 1 ... 2^24 (8192) */
    int32_t max_points;
    /* 1 ... 2^24 (1024); of more than these the strongest are kept. Unused without roi */
    int32_t max_corners;
    /* m, > 0: sigma in the first iteration (0.15; thesis 15 cm) */
    cairn_real sigma_start;
    /* m, > 0, <= sigma_start: least sigma (0.04; 4 cm) */
    cairn_real sigma_end;
    /* m, >= 0: less in every iteration (0.0025; 0.25 cm) */
    cairn_real sigma_step;
    /* 0 ... 1: times that in every iteration, before sigma_step (1) */
    cairn_real sigma_factor;
    /* m, >= 0: from this sigma down the two faces of a wall do not attract each other: cos of
     * directions where it is positive in place of |cos| (0) */
    cairn_real sides_below;
    /* > 0: step width in the first iteration (0.05; 5) */
    cairn_real dt_start;
    /* > 0, <= dt_start: least step width (0.01; 1) */
    cairn_real dt_end;
    /* 0 ... 1: times that in every iteration (0.96) */
    cairn_real dt_factor;
    /* in sigma, > 0, <= 6: pairs farther apart exert no force (4, where a force has fallen to
     * 3e-4 of its start: the thesis grows the boxes of segments by 2 sigma) */
    cairn_real reach;
    /* the centre of rotation is the centre of mass while sigma >= sensor_below * sigma_start,
     * then the sensor; 0: always the centre of mass (0.5) */
    cairn_real sensor_below;
    /* regions of interest (CAIRN_FORCE_FIELD_ROI_ENDS) */
    int32_t roi;
    /* m, > 0: about each corner (0.05; 5 cm) */
    cairn_real roi_radius;
    /* > 0: what the mass of a point in a region is multiplied by (4) */
    cairn_real roi_mass;
    /* m, > 0: of a corner from both segments or their ends (see roi), at most (0.30) */
    cairn_real corner_distance;
    /* rad, > 0 (80 degrees) */
    cairn_real corner_min_opening;
    /* rad, >= corner_min_opening, < pi (100 degrees) */
    cairn_real corner_max_opening;
    /* not 0: P(g) is computed, too (1); always with twist */
    int32_t potential;
    /* >= 1: iterations from a start to the stop (50) */
    int32_t max_steps;
    /* m, >= 0: stops when the scans moved less than this in the mean (0.0001) */
    cairn_real stop_relocation;
    /* 0: the points of the scans are kept. > 0, m: they are made from the ends of their segments
     * when they are needed, with the same results; see cairn_scan_set_params (0) */
    cairn_real spacing;
    /* points from outside, 0 ... 2^24 (0) */
    int32_t max_extra;

    /* For SPRINGS alone. */
    /* 0 ... 2^24, pairs of scans near each other; those beyond do not count (0) */
    int32_t max_bonds;
    /* 0 ... 1: stiffness of a spring along the lines of its points, of that across (0.1) */
    cairn_real slide;
    /* m, >= 0: a shift of a scan is held back by (sigma / grip)^3 times its own stiffness, so
     * that headings settle first; 0: it is not (0.35) */
    cairn_real grip;
    /* >= 0: how much lines turn each other parallel, each pair of points with the torque twist/2
     * erfc(r / (sigma sqrt 2)) sin cos^3 of the angle between the lines; 0: not at all (0) */
    cairn_real twist;
    /* m, > 0: root mean square way of the points of a scan in an iteration (0.3) */
    cairn_real max_relocation;
} cairn_force_field_params;

/* Whether and why the simulation stands. */
typedef int32_t cairn_force_field_verdict;
enum {
    CAIRN_FORCE_FIELD_RUNNING = 0,
    CAIRN_FORCE_FIELD_CONVERGED = 1,   /* mean relocation below stop_relocation */
    CAIRN_FORCE_FIELD_OUT_OF_STEPS = 2 /* max_steps iterations done */
};

/* Measurements. The first four fields are counts of the whole life of the object, the others
 * those of the last iteration that was committed (0 before the first). */
typedef struct cairn_force_field_state {
    cairn_force_field_verdict verdict;
    /* since the creation or clear(), restarts included */
    int32_t iterations;
    /* of budget, by all steps */
    int64_t units;
    /* units of the dearest call of a step */
    int32_t worst_step;
    /* since the last start of the cooling */
    int32_t start_iterations;
    /* pairs of points within reach */
    int64_t pairs;
    /* pairs of colliding segments of different scans */
    int32_t segment_pairs;
    /* regions of interest */
    int32_t corners;
    /* beyond max_corners */
    int32_t corners_dropped;
    /* pairs of scans joined by springs */
    int32_t bonds;
    /* pairs of lines left out, beyond max_bonds */
    int32_t bonds_dropped;
    /* as used */
    cairn_real sigma, dt;
    /* P(g) of the poses from which the iteration started; 0 when it was not asked for */
    cairn_real potential;
    /* m: mean over the free scans with points of the root mean square way of their points */
    cairn_real mean_relocation;
} cairn_force_field_state;

/* What an iteration did to a scan. */
typedef struct cairn_force_field_motion {
    /* of the rotation, in the map, before the motion */
    cairn_vec2 centre;
    /* sum over the points, in the map: minus the gradient of P(g) with respect to a shift */
    cairn_vec2 force;
    /* about the centre */
    cairn_real torque;
    /* m, root mean square way of the points to first order; 0 when fixed */
    cairn_real relocation;
} cairn_force_field_motion;

typedef struct cairn_force_field cairn_force_field;

/* Upper bounds of cairn_force_field_memory as constant expressions, without points from outside:
 * with the points of the scans kept ... */
#define CAIRN_FORCE_FIELD_BYTES(scans, points, segments, corners)                                  \
    (CAIRN_FORCE_FIELD_OTHER_BYTES(scans, points, segments, corners) +                             \
     CAIRN_SCAN_SET_BYTES(scans, points, segments) +                                               \
     CAIRN_PIECE_BYTES(points, sizeof(cairn_vec2)) +                                               \
     CAIRN_PIECE_BYTES(points, sizeof(cairn_real)))

/* ... made from the segments ... */
#define CAIRN_FORCE_FIELD_PLACES_BYTES(scans, points, segments, corners)                           \
    (CAIRN_FORCE_FIELD_OTHER_BYTES(scans, points, segments, corners) +                             \
     CAIRN_SCAN_SET_PLACES_BYTES(scans, points, segments) +                                        \
     CAIRN_PIECE_BYTES((points) / 32 + 1, sizeof(uint32_t)))

/* ... more for points from outside ... */
#define CAIRN_FORCE_FIELD_EXTRA_BYTES(extra)                                                       \
    (2 * (2 * CAIRN_PIECE_BYTES(extra, sizeof(cairn_vec2)) +                                       \
          CAIRN_PIECE_BYTES(extra, sizeof(cairn_real)) +                                           \
          CAIRN_PIECE_BYTES((extra) + 1, sizeof(int32_t))) +                                       \
     CAIRN_PIECE_BYTES(extra, sizeof(cairn_box)) + CAIRN_PIECE_BYTES(extra, sizeof(int32_t)))

/* ... more for springs ... */
#define CAIRN_FORCE_FIELD_BOND_BYTES(scans, bonds)                                                 \
    (CAIRN_PIECE_BYTES(bonds, 16 + 9 * sizeof(cairn_real)) +                                       \
     CAIRN_PIECE_BYTES(scans, 8 + 21 * sizeof(cairn_real)))

/* ... and what all have in common. */
#define CAIRN_FORCE_FIELD_OTHER_BYTES(scans, points, segments, corners)                            \
    (1408 + 512 * sizeof(cairn_real) + CAIRN_CORNER_BYTES(segments, corners) +                     \
     2 * CAIRN_PIECE_BYTES(scans, sizeof(cairn_pose) + sizeof(cairn_force_field_motion)) +         \
     CAIRN_PIECE_BYTES(scans, 40 + (13 * sizeof(cairn_real) + 7) / 8 * 8) +                        \
     CAIRN_PIECE_BYTES(segments, sizeof(cairn_segment)) +                                          \
     CAIRN_PIECE_BYTES(segments, sizeof(cairn_vec2)) +                                             \
     CAIRN_PIECE_BYTES(segments, sizeof(cairn_box)) +                                              \
     CAIRN_PIECE_BYTES((points) / 32 + 1, sizeof(uint32_t)) +                                      \
     CAIRN_PIECE_BYTES(segments, sizeof(int32_t)) +                                                \
     CAIRN_PIECE_BYTES(corners, sizeof(cairn_vec2)) +                                              \
     3 * CAIRN_PIECE_BYTES(corners, sizeof(int32_t)))

/* The defaults above. */
cairn_force_field_params cairn_force_field_default(void);

/* Force field simulation as it is written: the defaults, but corners are intersections near the
 * segments, wherever along them (section 7.3.4, fig. 7.5), not only near their ends. 50
 * iterations (figs 7.8, 7.9); the thesis has 150 for the apartment, 20 for the maze, 12 for
 * three corners. */
cairn_force_field_params cairn_force_field_as_written(void);

/* The defaults with dt_start and dt_end for points that are `spacing` m apart: forces are
 * proportional to the density of the points and steps to dt^2, so dt grows with the root of the
 * spacing. The defaults are those for 0.02. */
cairn_force_field_params cairn_force_field_spaced(cairn_real spacing);

/* SPRINGS, for maps that the defaults hardly improve: scans that share little, headings far off,
 * loops closed wrongly. What differs from the thesis: the motion (see the mode); sigma falls by
 * a factor, to 0.03 m in `steps` iterations (>= 1); the first iterations overshoot, by 1/2 dt^2
 * from 5 down to 1 times the way to rest; faces of opposite sides attract only while sigma is
 * above 0.15 m; reach 2.5 sigma; no regions of interest; lines turn each other parallel (twist
 * 40), as P(g) asks for, which falls with the angle between directions, too. sigma_start, m, >
 * 0, is to be about the distance by which points are off: 0.15 for poses that are nearly right,
 * as after a wrong loop closure, 0.8 for headings up to 20 degrees off. max_bonds is that of
 * max_scans scans that are all near each other. */
cairn_force_field_params cairn_force_field_springs(cairn_real sigma_start, int32_t steps);

/* 0 for params that create() would refuse. */
size_t cairn_force_field_memory(const cairn_force_field_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_force_field_create(cairn_force_field **field, cairn_pool *pool,
                                                    const cairn_force_field_params *params);

/* The index that the next scan added will have: that of a scan that was released and whose slot
 * is free again, else the number of indices given so far; -1: there are max_scans scans. A scan
 * keeps its index. */
int32_t cairn_force_field_next(const cairn_force_field *field);

/* Adds a scan at the pose map_scan. View, mass, fault and statuses are as in cairn_scan_set_add;
 * mass: of the points in the forces outside of regions of interest. A pose beyond 1e6 m is
 * CAIRN_BAD_ARGUMENT. A scan without points takes no part. The scan does not change the cooling
 * and does not set a field going that has stopped: restart() does. Linear in the scan. */
CAIRN_CHECKED cairn_status cairn_force_field_add_scan(cairn_force_field *field,
                                                      const cairn_scan_view *view,
                                                      const cairn_real *mass, cairn_pose map_scan,
                                                      cairn_fault *fault);

/* A fixed scan (yes not 0) exerts forces but does not move. Pairs of fixed scans are skipped, in
 * the potential, too. CAIRN_BAD_ARGUMENT: no such scan. Constant time. */
CAIRN_CHECKED cairn_status cairn_force_field_fix(cairn_force_field *field, int32_t scan,
                                                 int32_t yes);

/* Puts a scan elsewhere, as when another method has found it. CAIRN_BAD_ARGUMENT: no such scan,
 * an iteration is under way, or a pose beyond 1e6 m. CAIRN_NOT_FINITE. Constant time. */
CAIRN_CHECKED cairn_status cairn_force_field_place(cairn_force_field *field, int32_t scan,
                                                   cairn_pose map_scan);

/* Takes a scan out of the field. Its index is used again and its room is free when a later step
 * has gone as far as the next iteration or has returned CAIRN_OK. CAIRN_BAD_ARGUMENT: no such
 * scan. Constant time; the steps pay for closing the gap. */
CAIRN_CHECKED cairn_status cairn_force_field_release(cairn_force_field *field, int32_t scan);

/* Points in the map that exert forces on the scans and belong to none, such as those of
 * hypotheses about the world (chapter 8), in place of those set before. Pairs with them count in
 * P(g). weights: [count], >= 0, as masses. Regions of interest do not change them. They take
 * effect at the next commit point. The fewer different directions lie side by side, the faster.
 * CAIRN_FULL: count > max_extra. CAIRN_NOT_FINITE; CAIRN_BAD_ARGUMENT: NULL, a coordinate beyond
 * 1e6 m, a weight below 0 or beyond 1e6. Linear in count. */
CAIRN_CHECKED cairn_status cairn_force_field_set_extra(cairn_force_field *field,
                                                       const cairn_oriented_point *points,
                                                       const cairn_real *weights, int32_t count);

/* Starts the cooling anew: sigma, dt and the count against max_steps. Constant time. */
void cairn_force_field_restart(cairn_force_field *field);

/* Forgets all scans and points from outside, at once; the field is as after its creation.
 * Constant time. */
void cairn_force_field_clear(cairn_force_field *field);

/* Goes on with the simulation. CAIRN_MORE: the budget is used up. CAIRN_OK: the simulation has
 * stopped, see the verdict. CAIRN_EMPTY: there are no scans. Never uses more than the budget:
 * what costs several units is paid first, over several calls if need be. Costs per iteration
 * about: six units for each scan, three for each segment and one for two points; with regions of
 * interest the search for corners and three units for each point; the sweep over the segments;
 * for each pair of near segments eleven units, of 16 of their points two more, and for each
 * point of the one a unit, one more for eight of the points of the other when some may be within
 * reach, and one for each pair of points within reach. Scans that stood still among scans that
 * stood still cost two units for each segment. */
CAIRN_CHECKED cairn_status cairn_force_field_step(cairn_force_field *field, cairn_budget *budget);

/* As step(), but also returns CAIRN_OK at the next commit point, so that every iteration can be
 * looked at. */
CAIRN_CHECKED cairn_status cairn_force_field_iterate(cairn_force_field *field,
                                                     cairn_budget *budget);

/* Grows by 1 with every commit point that changed something: an iteration, or a scan that took
 * effect. */
uint32_t cairn_force_field_revision(const cairn_force_field *field);

/* Indices of scans that have taken effect are below. */
int32_t cairn_force_field_pose_count(const cairn_force_field *field);

/* 1 when the scan has taken effect and was not released. */
int32_t cairn_force_field_has(const cairn_force_field *field, int32_t scan);

/* map_scan of a scan, 0 <= scan < pose_count; of one that was released the last, as long as its
 * index is not used again. */
cairn_pose cairn_force_field_pose(const cairn_force_field *field, int32_t scan);

/* What the last iteration did to a scan, 0 <= scan < pose_count; zeros before the scan's first. */
cairn_force_field_motion cairn_force_field_motion_of(const cairn_force_field *field, int32_t scan);

cairn_force_field_state cairn_force_field_read(const cairn_force_field *field);

/* P(g) of the last committed iteration, as in the state. */
cairn_real cairn_force_field_potential(const cairn_force_field *field);

/* The segments and points of all scans in the frames of the scans, those of scans that have not
 * yet taken effect last. */
const cairn_scan_set *cairn_force_field_scans(const cairn_force_field *field);

/* The force on point `index` of a scan and the mass of the point in the last iteration, in the
 * map before the motion. CAIRN_BAD_ARGUMENT: no such point. CAIRN_EMPTY: an iteration is under
 * way, none has seen the scan, or scans have been released since. For pictures: sums the force
 * up again, linear in the segments and the points within reach. */
CAIRN_CHECKED cairn_status cairn_force_field_point_force(const cairn_force_field *field,
                                                         int32_t scan, int32_t index,
                                                         cairn_vec2 *force, cairn_real *mass);

/* The corners by the last search of the field, which belong to the poses before the last motion,
 * or to those now when the iteration under way has found them already. The strongest first;
 * segment indices count through all scans. None without roi. */
const cairn_corner *cairn_force_field_corners(const cairn_force_field *field, int32_t *count);

#ifdef __cplusplus
}
#endif

#endif
