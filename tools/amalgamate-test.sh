#!/bin/sh
# Compiles the amalgamation alone, in double and float, into one program and runs it: tools/amalgamate-test.sh BUILD
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
for real in double float; do
    define=
    [ $real = double ] || define=-DCAIRN_FLOAT
    $cc -std=c11 -Wall -Wextra -Werror $define "$work/main.c" -o "$work/main-$real" -lm && "$work/main-$real" &&
        $cc -std=c11 -Wall -Wextra -Werror -O2 $define -c "$work/cairn.c" -o "$work/cairn-$real.o" || {
        echo "FAILED amalgamation in $real"
        failed=1
    }
done
[ $failed -eq 0 ] && echo "ok     amalgamation: $(wc -l <"$work/cairn.c") + $(wc -l <"$work/cairn.h") lines, double and float"
exit $failed
