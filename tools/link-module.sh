#!/bin/sh
# Links a firmware program of one module, WORK/MODULE.elf: tools/link-module.sh MODULE WORK
#
# From tools/MODULE_program.c and the amalgamation of that module alone, for a Cortex-M7 in float.
set -e
module=${1:?usage: tools/link-module.sh MODULE WORK} work=${2:?usage: tools/link-module.sh MODULE WORK}
sh tools/amalgamate.sh "$work/$module" "$module"
arm-none-eabi-gcc -std=c11 -DCAIRN_FLOAT -Os -Wall -Wextra -Werror -mthumb -mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -mfloat-abi=hard \
    -ffunction-sections -fdata-sections -fno-math-errno -ffp-contract=off -Iinclude "tools/${module}_program.c" "$work/$module/cairn.c" \
    -nostartfiles -Wl,--gc-sections -Wl,-e,main -lm -o "$work/$module.elf"
