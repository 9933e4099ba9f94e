#!/bin/sh
# Tests that the check for circles rejects them: tools/check-circles-test.sh
. "$(dirname "$0")/expect-library.sh"
name=circles

compile()
{
    $cc -std=c11 -O0 -w -c "$1" -o "$2"
}

check()
{
    sh tools/check-circles.sh "$1/lib.a"
}

# Shared parts, a recursion within a file, and a call back by a pointer are no circles.
expect "" <<'END'
int cairn_two(int), cairn_three(int);
int cairn_one(int i) { return cairn_two(i) + cairn_three(i); }
----
int cairn_four(int (*f)(int), int i);
static int back(int i) { return i < 1 ? 0 : back(i - 1); }
int cairn_two(int i) { return cairn_four(back, i) + cairn_two(i - 1); }
----
int cairn_four(int (*f)(int), int i);
int cairn_three(int i) { return cairn_four(0, i); }
----
int cairn_four(int (*f)(int), int i) { return f ? f(i) : 0; }
END
cp "$work/o/lib.a" "$work/good.a"
expect "    1.c needs cairn_two of 2.c" <<'END'
int cairn_two(int);
int cairn_one(int i) { return cairn_two(i); }
----
int cairn_one(int);
int cairn_two(int i) { return i < 1 ? 0 : cairn_one(i - 1); }
END
# By a table; behind a file that only leads to it, and before one that it leads to.
expect "    4.c needs cairn_table of 2.c" <<'END'
int cairn_two(int);
int cairn_one(int i) { return cairn_two(i); }
----
int cairn_three(int);
const int cairn_table[2] = {1, 2};
int cairn_two(int i) { return cairn_three(i); }
----
int cairn_four(int), cairn_five(int);
int cairn_three(int i) { return cairn_four(i) + cairn_five(i); }
----
extern const int cairn_table[2];
int cairn_four(int i) { return cairn_table[i & 1]; }
----
int cairn_five(int i) { return i; }
END
said=$(sh tools/check-circles.sh "$work/o/lib.a")
[ "$(echo "$said" | grep -c needs)" -eq 3 ] && ! echo "$said" | grep -q "1.c\|5.c" || {
    echo "FAILED circles test: expected the circle of 2.c, 3.c and 4.c alone: $said"
    failed=1
}
for libraries in "$work/good.a $work/o/lib.a" "$work/o/lib.a $work/good.a"; do
    # shellcheck disable=SC2086
    said=$(sh tools/check-circles.sh $libraries)
    [ $? -eq 1 ] && echo "$said" | grep -q "^ok" && echo "$said" | grep -q "4.c needs cairn_table of 2.c" || {
        echo "FAILED circles test: expected a circle of one library of two: $said"
        failed=1
    }
done
sh tools/check-circles.sh "$work/none.a" >"$work/said" 2>&1 && {
    echo "FAILED circles test: a library that is missing was accepted"
    failed=1
}
[ $failed -eq 0 ] && echo "ok     the check for circles rejects them"
exit $failed
