#!/bin/sh
# Compiles the amalgamation alone, in double and float, into one program and runs it: tools/amalgamate-test.sh BUILD
#
# Without an optimizer; optimized it is compiled by tools/check-bits.sh.
# Also those of single modules, whose programs must fit into a Cortex-M7: the most bytes of code and constants stand here.
cc=${CC:-cc}
work=$1/amalgamation-test
mkdir -p "$work" && sh tools/amalgamate.sh "$work" || exit 1
cat >"$work/main.c" <<'END'
#include "cairn.c"

int main(void)
{
    static _Alignas(CAIRN_ALIGN) unsigned char memory[1024];
    cairn_pool pool;
    cairn_pose turn = {1, 2, CAIRN_PI / 2}, there_and_back;

    if (cairn_pool_init(&pool, memory, sizeof memory) != CAIRN_OK || cairn_pool_take(&pool, 10, 10) == NULL)
        return 1;
    there_and_back = cairn_pose_compose(turn, cairn_pose_inverse(turn));
    return !(cairn_abs(there_and_back.x) < CAIRN_REAL(1e-5) && there_and_back.theta == 0);
}
END
failed=0
strict="-std=c11 -Wall -Wextra -Werror"
{
    for define in -DCAIRN_DOUBLE -DCAIRN_FLOAT; do
        echo "$cc $strict $define $work/main.c -o $work/main$define -lm && $work/main$define"
    done
    # Each module alone compiles, with what it needs and no more.
    for module in icp mapper map_merge contour_grouping self_similarity; do
        echo "sh tools/amalgamate.sh $work/$module $module && $cc $strict -fsyntax-only $work/$module/cairn.c"
    done
} | xargs -P 2 -I '{}' sh -c '{} || { echo "FAILED amalgamation: {}"; exit 1; }' || failed=1

if grep -q cairn_mapper_create "$work/icp/cairn.h" || ! grep -q cairn_icp_create "$work/icp/cairn.h"; then
    echo "FAILED amalgamation of icp: expected icp without mapper"
    failed=1
fi
sh tools/amalgamate.sh "$work/none" icp no_module 2>"$work/said" && failed=1
grep -q "no module 'no_module', expected" "$work/said" && [ ! -f "$work/none/cairn.c" ] || {
    echo "FAILED amalgamation of a module that is not there: $(cat "$work/said")"
    failed=1
}

# fits MODULE BYTES
fits()
{
    text=$(sh tools/link-module.sh "$1" "$work" && arm-none-eabi-size "$work/$1.elf" | awk 'NR == 2 { print $1 }')
    [ "${text:-0}" -gt 1000 ] && [ "$text" -le "$2" ] || {
        echo "FAILED amalgamation of $1: a program of it takes ${text:-?} bytes, expected at most $2"
        failed=1
    }
    sizes="$sizes; $1 $text bytes"
}
sizes=
if command -v arm-none-eabi-gcc >/dev/null; then
    fits icp 13500
    fits mapper 122880 # 120 KB
else
    echo "skipped sizes of single modules: no arm-none-eabi-gcc" | tee -a "${SKIPPED:-/dev/null}"
fi
[ $failed -eq 0 ] && echo "ok     amalgamation: $(wc -l <"$work/cairn.c") + $(wc -l <"$work/cairn.h") lines, double and float$sizes"
exit $failed
