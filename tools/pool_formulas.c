/* What objects take of a pool, as a formula of their capacities: rows for docs/memory-and-time.md, written by tools/footprint.sh.
 *
 * A formula is fitted to _memory() with all its capacities at 1024 and one of them at 2048; capacities that it does not name
 * are the default. Where memory grows in powers of two (hash grids) or with pairs, it holds between these. */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "cairn/aligner.h"
#include "cairn/edge_chain.h"
#include "cairn/edge_segment.h"
#include "cairn/lum.h"
#include "cairn/mapper.h"
#include "cairn/occupancy_grid.h"
#include "cairn/polyline.h"
#include "cairn/pose_consensus.h"
#include "cairn/pose_graph.h"
#include "cairn/scan_cover.h"
#include "cairn/scan_match.h"
#include "cairn/sequence.h"
#include "cairn/symmetric_point.h"

enum { FIRST = 1024, SECOND = 2048, CAPACITIES = 6 };

typedef struct capacity {
    const char *name;
    size_t offset; /* of an int32_t in the params */
} capacity;

typedef struct object {
    const char *name;
    void (*set_default)(void *params);
    size_t (*memory)(const void *params);
    capacity capacities[CAPACITIES]; /* up to the first without a name */
} object;

typedef union any_params {
    cairn_scan_params scan;
    cairn_scan_set_params scan_set;
    cairn_scan_cover_params scan_cover;
    cairn_polyline_params polyline;
    cairn_sequence_params sequence;
    cairn_icp_params icp;
    cairn_scan_match_params scan_match;
    cairn_corner_params corner;
    cairn_pose_graph_params pose_graph;
    cairn_lum_params lum;
    cairn_pose_consensus_params pose_consensus;
    cairn_force_field_params force_field;
    cairn_aligner_params aligner;
    cairn_occupancy_grid_params occupancy_grid;
    cairn_mapper_params mapper;
    cairn_edge_chain_params edge_chain;
    cairn_edge_segment_params edge_segment;
    cairn_symmetric_point_params symmetric_point;
} any_params;

#define ROOM(room)                                                                                                     \
    static void room##_set_default(void *params)                                                                       \
    {                                                                                                                  \
        *(cairn_##room##_params *)params = cairn_##room##_default();                                                   \
    }                                                                                                                  \
    static size_t room##_memory(const void *params)                                                                    \
    {                                                                                                                  \
        return cairn_##room##_memory(params);                                                                          \
    }

ROOM(scan)
ROOM(scan_cover)
ROOM(polyline)
ROOM(sequence)
ROOM(icp)
ROOM(scan_match)
ROOM(corner)
ROOM(lum)
ROOM(pose_consensus)
ROOM(force_field)
ROOM(aligner)
ROOM(mapper)
ROOM(edge_chain)
ROOM(edge_segment)
ROOM(symmetric_point)

static void scan_set_set_default(void *params)
{
    memset(params, 0, sizeof(cairn_scan_set_params));
}

static size_t scan_set_memory(const void *params)
{
    return cairn_scan_set_memory(params);
}

static void pose_graph_set_default(void *params)
{
    *(cairn_pose_graph_params *)params = cairn_pose_graph_default();
}

static size_t pose_graph_memory(const void *params)
{
    return cairn_pose_graph_memory(params, NULL);
}

/* One row of cells. */
static void occupancy_grid_set_default(void *params)
{
    cairn_occupancy_grid_params grid = cairn_occupancy_grid_default();

    grid.height = 1;
    *(cairn_occupancy_grid_params *)params = grid;
}

static size_t occupancy_grid_memory(const void *params)
{
    return cairn_occupancy_grid_memory(params);
}

#define OBJECT(room)    .name = #room, .set_default = room##_set_default, .memory = room##_memory
#define OF(room, field) offsetof(cairn_##room##_params, field)

static const object objects[] = {
    {OBJECT(scan),
     {{"beam", OF(scan, max_beams)}, {"segment", OF(scan, max_segments)}, {"point", OF(scan, max_points)}}},
    {OBJECT(scan_set),
     {{"scan", OF(scan_set, max_scans)}, {"segment", OF(scan_set, max_segments)}, {"point", OF(scan_set, max_points)}}},
    {OBJECT(scan_cover), {{"scan", OF(scan_cover, max_scans)}, {"point", OF(scan_cover, max_points)}}},
    {OBJECT(polyline), {{"point", OF(polyline, max_points)}, {"segment", OF(polyline, max_segments)}}},
    {OBJECT(sequence),
     {{"element of the first", OF(sequence, max_first)}, {"element of the second", OF(sequence, max_second)}}},
    {OBJECT(icp), {{"point of the target", OF(icp, max_target)}}},
    {OBJECT(scan_match), {{"point of the target", OF(scan_match, max_target)}}},
    {OBJECT(corner), {{"segment", OF(corner, max_segments)}, {"corner", OF(corner, max_corners)}}},
    {OBJECT(pose_graph),
     {{"pose", OF(pose_graph, max_poses)},
      {"link", OF(pose_graph, max_links)},
      {"block of fill", OF(pose_graph, max_fill)}}},
    {OBJECT(lum),
     {{"scan", OF(lum, max_scans)},
      {"point", OF(lum, max_points)},
      {"link", OF(lum, max_links)},
      {"block of fill", OF(lum, max_fill)}}},
    {OBJECT(pose_consensus),
     {{"node", OF(pose_consensus, max_nodes)}, {"hypothesis", OF(pose_consensus, max_hypotheses)}}},
    {OBJECT(force_field),
     {{"scan", OF(force_field, max_scans)},
      {"segment", OF(force_field, max_segments)},
      {"point", OF(force_field, max_points)},
      {"corner", OF(force_field, max_corners)}}},
    {OBJECT(aligner),
     {{"scan", OF(aligner, max_scans)},
      {"segment", OF(aligner, max_segments)},
      {"point", OF(aligner, max_points)},
      {"hypothesis", OF(aligner, max_hypotheses)},
      {"block of fill", OF(aligner, max_fill)}}},
    {OBJECT(occupancy_grid), {{"cell", OF(occupancy_grid, width)}}},
    {OBJECT(mapper),
     {{"key scan", OF(mapper, max_keys)},
      {"key segment", OF(mapper, max_key_segments)},
      {"key point", OF(mapper, max_key_points)}}},
    {OBJECT(edge_chain), {{"edge pixel", OF(edge_chain, max_edges)}, {"chain", OF(edge_chain, max_chains)}}},
    {OBJECT(edge_segment), {{"line", OF(edge_segment, max_lines)}, {"segment", OF(edge_segment, max_segments)}}},
    {OBJECT(symmetric_point),
     {{"segment", OF(symmetric_point, max_segments)}, {"point", OF(symmetric_point, max_points)}}},
};

/* Bytes with all capacities of the object at FIRST, but for `other`, which has SECOND; -1: none. */
static double bytes_with(const object *o, int other)
{
    any_params params;
    size_t bytes;

    memset(&params, 0, sizeof params);
    o->set_default(&params);
    for (int k = 0; k < CAPACITIES && o->capacities[k].name != NULL; k++) {
        int32_t value = k == other ? SECOND : FIRST;

        memcpy((char *)&params + o->capacities[k].offset, &value, sizeof value);
    }
    bytes = o->memory(&params);
    if (bytes == 0)
        fprintf(stderr, "pool_formulas: %s refuses capacities of %d and %d\n", o->name, FIRST, SECOND);
    return (double)bytes;
}

static int print_formula(const object *o)
{
    double base = bytes_with(o, -1), fixed = base;
    double each[CAPACITIES];
    int good = base > 0, count = 0;

    for (; count < CAPACITIES && o->capacities[count].name != NULL; count++) {
        double more = bytes_with(o, count);

        good = good && more > 0;
        each[count] = (more - base) / (SECOND - FIRST);
        fixed -= each[count] * FIRST;
    }
    printf("| `%s`: fixed | %.0f |\n", o->name, fixed);
    for (int k = 0; k < count; k++)
        printf("| `%s`: each %s | %.1f |\n", o->name, o->capacities[k].name, each[k]);
    return good;
}

int main(void)
{
    int good = 1;

    for (size_t i = 0; i < sizeof objects / sizeof *objects; i++)
        good = print_formula(&objects[i]) && good;
    return good ? 0 : 1;
}
