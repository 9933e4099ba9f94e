#!/bin/sh
# The tests that do not need what is missing here: tools/free-tests.sh [sim] [host] [yaml] [png]
#
# sim: no Box2D; host: no zlib. A test is left out when one of the headers that it includes, directly or not, belongs to that
# layer, or runs the programs that are built with it. yaml, png: no libyaml, no libpng. A test is left out when it names the format.
pattern='no header'
program='no program'
format='no format'
for layer in "$@"; do
    case $layer in
    sim)
        pattern="$pattern|(^| )sim/[a-z_]*\.h|bench/bench_(endless|maps|merge)"
        program=cairn-arena
        ;;
    host)
        program=cairn-arena
        pattern="$pattern|tests/programs\.h|src/host/|bench/bench_endless|include/cairn/($(awk '$1 ~ /^host/ { printf "%s%s", sep, $2; sep = "|" }' tools/modules.txt))\\.h"
        ;;
    yaml | png)
        format="$format|$layer"
        ;;
    *)
        echo "tools/free-tests.sh: unknown layer '$layer', expected sim, host, yaml or png" >&2
        exit 2
        ;;
    esac
done
for test in tests/test_*.c; do
    ! grep -q "$program" "$test" && ! grep -qiE "$format" "$test" || continue
    "${CC:-cc}" -I. -Iinclude -MM -MG "$test" | tr -d '\\\n' | grep -qE "$pattern" || echo "$test"
done
