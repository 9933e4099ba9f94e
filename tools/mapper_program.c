/* A firmware program that uses the mapper alone. What the linker keeps of the library for it is the
 * row "mapper alone" in docs/memory-and-time.md (tools/footprint.sh). It is linked, never run. */
#include "cairn/mapper.h"

enum { POOL_BYTES = 1200000, KEYFRAMES = 64, BEAMS = 181, UNITS_PER_TICK = 1000 };

static _Alignas(CAIRN_ALIGN) unsigned char memory[POOL_BYTES];
/* filled by the driver of the scanner */
static float range[BEAMS];
static cairn_scan_input scan = {.range = range, .count = BEAMS};
static volatile int32_t driving = 1;
static cairn_mapper_result result;

int main(void)
{
    cairn_mapper_params params = cairn_mapper_default_for(KEYFRAMES, BEAMS);
    cairn_mapper *mapper;
    cairn_pool pool;
    cairn_status status = cairn_pool_init(&pool, memory, sizeof memory);

    params.cull_keyframes = 1;
    if (status == CAIRN_OK)
        status = cairn_mapper_create(&mapper, &pool, &params);
    while (status == CAIRN_OK && driving) {
        status = cairn_mapper_add(mapper, &scan, NULL, NULL);
        while (status >= 0) {
            status = cairn_mapper_step(mapper, &(cairn_budget){.left = UNITS_PER_TICK});
            if (status != CAIRN_MORE)
                break;
        }
        if (status == CAIRN_OK)
            result = cairn_mapper_read(mapper);
    }
    if (status == CAIRN_OK)
        do {
            status = cairn_mapper_settle(mapper, &(cairn_budget){.left = UNITS_PER_TICK});
        } while (status == CAIRN_MORE);
    return status;
}
