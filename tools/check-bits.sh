#!/bin/sh
# Checks that every compiler and option gives the same bits: tools/check-bits.sh BUILD [rest]
#
# Builds the library with tests/golden*.c with many compilers and options, in double and in float, and compares their output with each other
# and with tests/golden-double.txt and tests/golden-float.txt, which an intended change of results must update. The options
# do not contain -ffp-contract=off: src/base/build.h alone must ensure it. -std=c11 -O2 is what tests/test_golden.c is built with.
# What is compiled is the amalgamation, which takes less time than the files and must give the same bits; gcc's warnings of it are errors.
# Missing compilers are skipped with a message; aarch64 runs under qemu-user. Bare Cortex-M, -Os:
# tools/firmware-test.sh. rest: the variants of tools/check-long.sh.
work=$1/bits${2:+-$2}
rm -rf "$work"
mkdir -p "$work" && sh tools/amalgamate.sh "$work" || exit 1
scenes="firmware/board_host.c $(ls tests/golden*.c | tr '\n' ' ')"

variants="gcc -std=gnu11 -O3 -march=native
aarch64-linux-gnu-gcc -std=gnu11 -O1 -static
clang -std=gnu11 -O0"
[ "$2" != rest ] || variants="gcc -std=gnu11 -Os -fno-inline
clang -std=gnu11 -O3 -march=native
gcc -std=gnu11 -O0
aarch64-linux-gnu-gcc -std=gnu11 -O3 -static
aarch64-linux-gnu-gcc -std=gnu11 -O0 -static"
number=0
echo "$variants" | while read -r compiler options; do
    command -v "$compiler" >/dev/null 2>&1 || {
        echo "skipped same bits of $compiler $options: no $compiler" | tee -a "${SKIPPED:-/dev/null}" >&2
        continue
    }
    number=$((number + 1))
    warnings=-w
    [ "$compiler" != gcc ] || warnings="-Wall -Wextra -Werror"
    sources="-I. -Iinclude $scenes $work/cairn.c"
    echo "$compiler $options $warnings $sources -o $work/double-$number -lm"
    echo "$compiler $options $warnings -DCAIRN_FLOAT $sources -o $work/float-$number -lm"
    echo "$compiler $options" >"$work/options-$number"
done | xargs -P 2 -I '{}' sh -c '{} || exit 255' || {
    echo "FAILED same bits: a variant does not compile"
    exit 1
}

# Two at a time, the longest ones first; a program that fails has no output.
for program in "$work"/double-? "$work"/float-?; do
    case $(cat "$work/options-${program##*-}") in
    aarch64*) echo "qemu-aarch64 $program >$program.txt || rm -f $program.txt" ;;
    *) echo "$program >$program.txt || rm -f $program.txt" ;;
    esac
done | sort -r | xargs -P 2 -I '{}' sh -c '{}'
failed=0
for real in double float; do
    for program in "$work/$real"-?; do
        cmp -s "$program.txt" "$work/$real-1.txt" || {
            failed=1
            echo "FAILED same bits in $real: $(cat "$work/options-${program##*-}") differs from $(cat "$work/options-1"):"
            diff "$work/$real-1.txt" "$program.txt"
        }
    done
done
for real in double float; do
    diff "tests/golden-$real.txt" "$work/$real-1.txt" >"$work/changed" || {
        failed=1
        echo "FAILED same bits in $real: not those of tests/golden-$real.txt (if that is meant: make golden):"
        cat "$work/changed"
    }
done
# Equal results of double and float mean that the build ignored CAIRN_FLOAT.
cmp -s "$work/double-1.txt" "$work/float-1.txt" && failed=1
[ $failed -eq 0 ] && echo "ok     same bits: $(wc -l <"$work/double-1.txt") scenes, $(ls "$work"/options-* | wc -l) variants, double and float"
exit $failed
