/* cairn_match_picture: pictures of a match. */
#ifndef CAIRN_TOOLS_CAIRN_MATCH_PICTURE_H
#define CAIRN_TOOLS_CAIRN_MATCH_PICTURE_H

#include "tools/cairn_match.h"

/* A and B before the match (at the start pose, or as they come) and after it. */
CAIRN_CHECKED cairn_status match_draw_overlay(const match_record *record, const char *path, cairn_file_error *error);

/* The walls of B and the directions of its points in their order (Adluru 2008, fig. 6.1). */
CAIRN_CHECKED cairn_status match_draw_tangents(const match_record *record, const char *path, cairn_file_error *error);

#endif
