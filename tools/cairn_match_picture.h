/* cairn_match_picture: pictures of a match. */
#ifndef CAIRN_TOOLS_CAIRN_MATCH_PICTURE_H
#define CAIRN_TOOLS_CAIRN_MATCH_PICTURE_H

#include "cairn/report.h"
#include "tools/cairn_match.h"

#define COLOUR_A    "#1e293b"
#define COLOUR_B    "#f97316"
#define COLOUR_PAIR "#2563eb"

/* Draws A and B before the match (at the start pose, or each in its own frame) and after it. */
CAIRN_CHECKED cairn_status match_draw_overlay(const match_record *record, const char *path,
                                              cairn_file_error *error);

/* Draws the walls of B and the tangent directions of its points in scan order (Adluru 2008, fig.
 * 6.1). */
CAIRN_CHECKED cairn_status match_draw_tangents(const match_record *record, const char *path,
                                               cairn_file_error *error);

/* Matched by shape: draw the angular histogram of the point of B with the most occupied bins (fig.
 * 6.2); all correspondences of the common subsequence (fig. 6.4); the correspondences after each
 * filter, and B aligned (fig. 6.5). B is drawn at the start pose. */
CAIRN_CHECKED cairn_status match_draw_histogram(const match_record *record, const char *path,
                                                cairn_file_error *error);
CAIRN_CHECKED cairn_status match_draw_pairs(const match_record *record, const char *path,
                                            cairn_file_error *error);
CAIRN_CHECKED cairn_status match_draw_filters(const match_record *record, const char *path,
                                              cairn_file_error *error);

/* ---- Shared by the pictures ---- */

cairn_report_layer match_layer(const char *name, const char *colour, cairn_report_mark mark,
                               double width, double opacity);

/* The evenly spaced points of a side, mapped, from the heap; NULL: no memory. */
cairn_vec2 *match_points(const match_side *side, cairn_pose map_side);

cairn_status match_no_memory(const char *path, cairn_file_error *error);

/* "a.log:3 and b.log:4". */
void match_names(const match_record *record, char *title, size_t size);

#endif
