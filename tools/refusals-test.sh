#!/bin/sh
# Tests that compilers' options which change results, and runs of the tools that cannot be right, are refused: tools/refusals-test.sh
failed=0

# refused MESSAGE COMMAND...: the command must fail and say so
refused()
{
    expected=$1
    shift
    said=$("$@" 2>&1)
    status=$?
    if [ $status -eq 0 ] || ! echo "$said" | grep -q -e "$expected"; then
        echo "FAILED refusals test: expected \"$expected\" with a failure of \"$*\", got exit $status: $said"
        failed=1
    fi
}

compile="gcc -std=c11 -I. -Iinclude -fsyntax-only src/base/real.c"
$compile || failed=1
for option in -ffast-math -ffinite-math-only -fassociative-math\ -fno-signed-zeros\ -fno-trapping-math -freciprocal-math -fno-signed-zeros; do
    # shellcheck disable=SC2086
    refused "cairn gives the same bits everywhere; $(echo "$option" | cut -d ' ' -f 1) does not" $compile $option
done
# Excess precision: x87, and gcc's for s390x and m68k.
refused "use -msse2 -mfpmath=sse" $compile -m32 -mfpmath=387
refused "use -fexcess-precision=fast" $compile -U__FLT_EVAL_METHOD__ -D__FLT_EVAL_METHOD__=1 -U__i386__ -U__x86_64__
refused "BUILD is \"/tmp/absolute\", expected a path from this folder" env BUILD=/tmp/absolute sh tools/mutate.sh 1 1 src/base/status.c
exit $failed
