/* A firmware program that uses icp alone. What the linker keeps of the library for it is the row
 * "icp alone" in docs/memory-and-time.md (tools/footprint.sh). It is linked, never run. */
#include "cairn/icp.h"

enum { POOL_BYTES = 1 << 16, MAX_POINTS = 256, UNITS_PER_TICK = 1000 };

static _Alignas(CAIRN_ALIGN) unsigned char memory[POOL_BYTES];
/* filled by the driver of the scanner */
static cairn_oriented_point target[MAX_POINTS], query[MAX_POINTS];
static volatile int32_t point_count;
static cairn_icp_result result;

int main(void)
{
    cairn_icp_params params = cairn_icp_default();
    cairn_pool pool;
    cairn_icp *icp;
    cairn_status status = cairn_pool_init(&pool, memory, sizeof memory);

    params.max_target = MAX_POINTS;
    if (status == CAIRN_OK)
        status = cairn_icp_create(&icp, &pool, &params);
    while (status == CAIRN_OK) {
        cairn_icp_clear_target(icp);
        status = cairn_icp_add_target(icp, target, point_count, cairn_pose_identity(), NULL);
        if (status == CAIRN_OK)
            status = cairn_icp_begin(icp, query, point_count, result.target_query, NULL, NULL);
        if (status == CAIRN_OK)
            do {
                status = cairn_icp_step(icp, &(cairn_budget){.left = UNITS_PER_TICK});
            } while (status == CAIRN_MORE);
        result = cairn_icp_read(icp);
    }
    return status;
}
