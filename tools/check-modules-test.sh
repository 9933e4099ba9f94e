#!/bin/sh
# Tests that the check of the module order rejects violations: tools/check-modules-test.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

# A source tree of four modules in valid order; file $1 is replaced by standard input (none: -).
house()
{
    rm -rf "${work:?}/house"
    for folder in src/core src/contour src/mapping src/host include/cairn tests tools; do
        mkdir -p "$work/house/$folder"
    done
    printf 'core base\ncore top\ncontour edge\nmapping map\nhost file\n' >"$work/house/tools/modules.txt"
    : >"$work/house/src/core/build.h"
    for module in core/base core/top contour/edge mapping/map host/file; do
        name=${module#*/}
        printf '#include "src/core/build.h"\n#include "cairn/%s.h"\n' "$name" >"$work/house/src/$module.c"
        printf '#include <stdint.h>\n' >"$work/house/include/cairn/$name.h"
        : >"$work/house/tests/test_$name.c"
    done
    [ "$1" = - ] || cat >"$work/house/$1"
}

# expect MESSAGE: the message that the check must print, or "" when the tree is valid
expect()
{
    said=$(sh tools/check-modules.sh "$work/house")
    status=$?
    if [ -z "$1" ] && [ $status -ne 0 ]; then
        echo "FAILED module order test: a valid tree was rejected: $said"
        failed=1
    elif [ -n "$1" ] && { [ $status -eq 0 ] || ! echo "$said" | grep -q "$1"; }; then
        echo "FAILED module order test: expected \"$1\" with a failure, got exit $status: $said"
        failed=1
    fi
}

house -
expect ""
echo '#include "cairn/base.h"' | house include/cairn/map.h
expect ""
echo '#include <stdio.h>' | house src/host/file.c
expect ""
echo '#include "cairn/top.h"' | house include/cairn/base.h
expect "include/cairn/base.h:1: base may not know top"
echo '#include "cairn/file.h"' | house src/core/top.c
expect "src/core/top.c:1: top may not know file"
echo '#include "cairn/edge.h"' | house src/mapping/map.c
expect "contour and mapping may not know each other"
echo '#include "cairn/map.h"' | house src/contour/edge.c
expect "edge may not know map"
printf '#include "cairn/top.h"\n#include "src/core/build.h"\n' | house src/core/top.c
expect "src/core/top.c:1: expected #include .src/core/build.h. first"
echo '#include <stdlib.h>' | house src/core/top.c
expect "<stdlib.h> is not for the freestanding library"
echo '#include "base.h"' | house src/core/top.c
expect 'expected "cairn/'
echo | house src/core/extra.c
expect "does not list the module extra"
echo | house include/cairn/extra.h
expect "does not list the module extra"
echo '#include "src/core/build.h"' | house src/core/top_part.c
expect ""
printf '#include "src/core/build.h"\n#include "cairn/top.h"\n' | house src/core/base_part.c
expect "src/core/base_part.c:2: base may not know top"
house -
rm "$work/house/src/core/top.c"
expect "module top: no src/core/top.c"
house -
rm "$work/house/include/cairn/top.h"
expect "module top: no header"
house -
rm "$work/house/tests/test_map.c"
expect "module map: no tests/test_map.c"
house -
awk 'BEGIN { for (i = 0; i < 501; i++) print "" }' >"$work/house/src/core/top.c"
sh tools/check-modules.sh "$work/house" | grep -q "src/core/top.c has 501 lines" || {
    echo "FAILED module order test: 501 lines were not reported"
    failed=1
}
[ $failed -eq 0 ] && echo "ok     the check of the module order rejects violations"
exit $failed
