/* The list of the golden scenes. */
#include "tests/golden.h"

const golden_scene golden_scenes[] = {
    {"elementary_functions", golden_elementary_functions},
    {"random_numbers", golden_random_numbers},
    {"poses_and_segments", golden_poses_and_segments},
    {"small_matrices", golden_small_matrices},
    {"force_field", golden_force_field},
    {"scans_and_grid", golden_scans_and_grid},
    {"matches", golden_matches},
    {"links_and_cover", golden_links_and_cover},
    {"aligned", golden_aligned},
    {"pose_graphs", golden_pose_graphs},
    {"consensus", golden_consensus},
    {"lines_and_rectangles", golden_lines_and_rectangles},
    {"ellipses", golden_ellipses},
    {"particles", golden_particles},
    {"registered", golden_registered},
    {"hypotheses", golden_hypotheses},
    {"virtual_aligned", golden_virtual_aligned},
    {"mapped", golden_mapped},
    {"filtered", golden_filtered},
    {"places", golden_places},
    {"merged", golden_merged},
    {"contours", golden_contours},
    {"grouped", golden_grouped},
    {NULL, NULL},
};
