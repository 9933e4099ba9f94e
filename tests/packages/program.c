/* Ten lines that use cairn as another project would: a pose from the pool of a mapper. */
#include <stdio.h>
#include "cairn/mapper.h"
#include "cairn/version.h"

static _Alignas(CAIRN_ALIGN) unsigned char memory[2 << 20];

int main(void)
{
    cairn_mapper_params params = cairn_mapper_default_for(64, 181);
    cairn_mapper *mapper;
    cairn_pool pool;

    if (cairn_pool_init(&pool, memory, sizeof memory) != CAIRN_OK ||
        cairn_mapper_create(&mapper, &pool, &params) != CAIRN_OK)
        return 1;
    printf("%s, %d bytes a number\n", cairn_version_text(), (int)sizeof(cairn_real));
    return 0;
}
