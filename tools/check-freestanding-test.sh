#!/bin/sh
# Tests that the freestanding check and the stack bound reject violations: tools/check-freestanding-test.sh
. "$(dirname "$0")/expect-library.sh"
name=freestanding

compile()
{
    $cc -std=gnu11 -O1 -fno-inline -fno-optimize-sibling-calls -fno-math-errno -fPIC -fstack-usage \
        -fcallgraph-info=su -w -c "$1" -o "$2"
}

check()
{
    sh tools/check-freestanding.sh "$1/lib.a" && sh tools/check-stack.sh "$1"
}

expect "" <<'END'
#include <math.h>
#include <string.h>
#include <stddef.h>
static const char *const WORDS[] = {"a", "b"};
static double helper(double x) { return sqrt(x) + floor(x); }
double cairn_good(double x, char *to, const char *from) { memcpy(to, from, 100); return helper(x); }
const char *cairn_word(int i) { return WORDS[i & 1]; }
END
expect "needs malloc" <<'END'
#include <stdlib.h>
void *cairn_core_room(size_t bytes) { return malloc(bytes); }
END
expect "needs sin" <<'END'
#include <math.h>
double cairn_sine(double x) { return sin(x); }
END
expect "needs printf" <<'END'
#include <stdio.h>
void cairn_say(int i) { printf("%d\n", i); }
END
expect "needs __errno_location" <<'END'
#include <errno.h>
int cairn_error(void) { return errno; }
END
expect "writable data in .bss" <<'END'
static int calls;
int cairn_count(void) { return ++calls; }
END
expect "writable data in .data" <<'END'
int cairn_seed = 5;
END
expect "writable data in .tbss" <<'END'
static _Thread_local int calls;
int cairn_count(void) { return ++calls; }
END
expect "lacks the prefix" <<'END'
int helper(int i) { return i + 1; }
END
expect "recursion: cairn_tree calls itself" <<'END'
int cairn_tree(int i) { return i < 2 ? 1 : cairn_tree(i - 1) * cairn_tree(i - 2) + 1; }
END
expect "recursion" <<'END'
int cairn_odd(int);
int cairn_even(int i) { return i == 0 ? 1 : cairn_odd(i - 1) + 0; }
----
int cairn_even(int);
int cairn_odd(int i) { return i == 0 ? 0 : cairn_even(i - 1) + 0; }
END
expect "unbounded stack: cairn_copy" <<'END'
void cairn_fill(int *, int);
int cairn_copy(int n) { int a[n]; cairn_fill(a, n); return a[0]; }
----
void cairn_fill(int *a, int n) { for (int i = 0; i < n; i++) a[i] = i; }
END
calls=$(printf %s "int cairn_apply(int (*f)(int), int i) { return f(i) + 1; }" >"$work/back.c" &&
    $cc -O1 -fstack-usage -fcallgraph-info=su -c "$work/back.c" -o "$work/o/back.o" && sh tools/check-stack.sh "$work/o")
echo "$calls" | grep -q "calls back.*: cairn_apply" || {
    echo "FAILED freestanding test: a callback was not listed: $calls"
    failed=1
}
[ $failed -eq 0 ] && echo "ok     the freestanding check rejects violations"
exit $failed
