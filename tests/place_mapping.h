/* Shared by the tests of both modes of place_map: fitted scans, and a hash of the poses. */
#ifndef CAIRN_TESTS_PLACE_MAPPING_H
#define CAIRN_TESTS_PLACE_MAPPING_H

#include "tests/test.h"

#include "cairn/place_map.h"

/* The view is valid until the next one. */
static inline cairn_scan_view view_of(cairn_scan *scan, const cairn_scan_input *input)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_scan_begin(scan, input, NULL));
    assert_ok(cairn_scan_step(scan, &budget));
    return cairn_scan_read(scan);
}

/* Of the poses of the first `scans` scans. */
static inline uint64_t hash_of(const cairn_place_map *map, int32_t scans)
{
    uint64_t hash = TEST_HASH_START;

    for (int32_t k = 0; k < scans; k++) {
        cairn_pose pose = cairn_place_map_scan_pose(map, k);

        hash = test_hash(hash, &pose, sizeof pose);
    }
    return hash;
}

static inline cairn_status create(void *context, cairn_pool *pool)
{
    cairn_place_map *map;

    return cairn_place_map_create(&map, pool, context);
}

#endif
