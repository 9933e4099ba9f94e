/* Functions that the evaluations of `cairn eval` share. */
#ifndef CAIRN_TOOLS_CAIRN_EVAL_H
#define CAIRN_TOOLS_CAIRN_EVAL_H

#include "cairn/pose_table.h"
#include "tools/cairn_tool.h"

/* argv[0] is the name of the evaluation. Exit codes of cairn_tool.h. */
int eval_map(int argc, char **argv);
int eval_poses(int argc, char **argv);
int eval_relations(int argc, char **argv);

/* Reads a table of poses sorted by index, every index once. TOOL_OK and rows for
 * cairn_pose_table_free, or another exit code after a line on standard error. */
int eval_read_poses(const char *program, const char *path, cairn_pose_table_row **row,
                    int32_t *count);

#endif
