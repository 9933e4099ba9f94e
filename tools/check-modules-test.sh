#!/bin/sh
# Tests that the check of the module order rejects violations: tools/check-modules-test.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

# A small source tree in valid order; file $1 is replaced by standard input (none: -).
house()
{
    rm -rf "${work:?}/house"
    for folder in src/base src/containers src/numerics src/edges src/maps src/host/files src/host/pictures include/cairn tests tools; do
        mkdir -p "$work/house/$folder"
    done
    printf 'apart edges\napart maps\nbase base\ncontainers list\nnumerics top\nedges edge\nmaps map\nhost/files file\nhost/pictures picture\n' >"$work/house/tools/modules.txt"
    : >"$work/house/src/base/build.h"
    for module in base/base numerics/top edges/edge maps/map host/files/file host/pictures/picture; do
        name=${module##*/}
        printf '#include "src/base/build.h"\n#include "cairn/%s.h"\n' "$name" >"$work/house/src/$module.c"
        printf '#include <stdint.h>\n' >"$work/house/include/cairn/$name.h"
        : >"$work/house/tests/test_$name.c"
    done
    printf '#include <stdint.h>\n' >"$work/house/src/containers/list.h"
    : >"$work/house/tests/test_list.c"
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
echo '#include <stdio.h>' | house src/host/files/file.c
expect ""
echo '#include "cairn/top.h"' | house include/cairn/base.h
expect "include/cairn/base.h:1: base may not know top"
echo '#include "cairn/file.h"' | house src/numerics/top.c
expect "src/numerics/top.c:1: top may not know file"
echo '#include "cairn/edge.h"' | house src/maps/map.c
expect "maps and edges may not know each other"
echo '#include "cairn/map.h"' | house src/edges/edge.c
expect "edge may not know map"
printf '#include "cairn/top.h"\n#include "src/base/build.h"\n' | house src/numerics/top.c
expect "src/numerics/top.c:1: expected #include .src/base/build.h. first"
echo '#include <stdlib.h>' | house src/numerics/top.c
expect "<stdlib.h> is not for the freestanding library"
printf '#include "src/base/build.h"\n#include "src/edges/edge_work.h"\n' | house src/numerics/top.c
expect "src/numerics/top.c:2: src/edges/edge_work.h is private to edges"
printf '#include "src/base/build.h"\n#include "src/base/base_part.h"\n#include "src/containers/list.h"\n' | house src/maps/map_part.c
expect ""
printf '#include "src/base/build.h"\n#include "src/containers/list.h"\n' | house src/base/base.c
expect "src/base/base.c:2: base may not know list"
echo '#include "cairn/top.h"' | house src/containers/list.h
expect "src/containers/list.h:1: list may not know top"
echo '#include "src/host/files/file_work.h"' | house src/host/pictures/picture.c
expect ""
printf '#include "src/base/build.h"\nCAIRN_OBJECT(top, top, build);\n' | house src/numerics/top.c
expect "src/numerics/top.c:2: tools/pool_objects.c does not list the object top"
printf '#include "src/base/build.h"\nCAIRN_OBJECT_OF(top_part, top, build, top);\n' | house src/numerics/top.c
expect "src/numerics/top.c:2: tools/pool_objects.c does not list the object top_part"
echo '#include "base.h"' | house src/numerics/top.c
expect 'expected "cairn/'
echo | house src/numerics/extra.c
expect "does not list the module extra"
echo | house include/cairn/extra.h
expect "does not list the module extra"
echo | house src/containers/extra.h
expect "does not list the module extra"
echo | house src/containers/list_part.h
expect ""
echo '#include "src/base/build.h"' | house src/numerics/top_part.c
expect ""
printf '#include "src/base/build.h"\n#include "cairn/top.h"\n' | house src/base/base_part.c
expect "src/base/base_part.c:2: base may not know top"
house -
rm "$work/house/src/numerics/top.c"
expect "module top: no src/numerics/top.c"
house -
rm "$work/house/include/cairn/top.h"
expect "module top: no header"
house -
rm "$work/house/tests/test_map.c"
expect "module map: no tests/test_map.c"
house -
rm "$work/house/tests/test_list.c"
expect "module list: no tests/test_list.c"
house -
for i in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30; do
    echo '#include "src/base/build.h"' >"$work/house/src/maps/map_part$i.c"
done
expect "src/maps has more than 30 files"
house -
awk 'BEGIN { for (i = 0; i < 501; i++) print "" }' >"$work/house/src/numerics/top.c"
sh tools/check-modules.sh "$work/house" | grep -q "src/numerics/top.c has 501 lines" || {
    echo "FAILED module order test: 501 lines were not reported"
    failed=1
}
awk 'BEGIN { print "#include \"src/base/build.h\""; for (i = 0; i < 699; i++) print "" }' | house src/numerics/top.c
expect ""
awk 'BEGIN { print "#include \"src/base/build.h\""; for (i = 0; i < 700; i++) print "" }' | house src/numerics/top.c
expect "src/numerics/top.c:701: 701 lines, expected at most 700"
[ $failed -eq 0 ] && echo "ok     the check of the module order rejects violations"
exit $failed
