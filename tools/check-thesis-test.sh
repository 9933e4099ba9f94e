#!/bin/sh
# Tests that tools/check-thesis.sh reports faults: tools/check-thesis-test.sh BUILD
build=${1:?usage: tools/check-thesis-test.sh BUILD}
work=$build/check-thesis
mkdir -p "$work"
row='| 2/1 | a | cairn_pool_init() | as written | `cairn map --no-odometry` | 1 | 2 | 3 |'
printf '%s\n' "$row" >"$work/good.md"
printf '2/1 | default | build/cairn map --no-odometry | {x}\n' >"$work/good.txt"
failed=0

sh tools/check-thesis.sh "$build" "$work/good.md" "$work/good.txt" >"$work/said" || { cat "$work/said"; failed=1; }

# refused DOCUMENT EXPERIMENTS WORDS
refused()
{
    printf '%s\n' "$1" >"$work/bad.md"
    printf '%s\n' "$2" >"$work/bad.txt"
    if sh tools/check-thesis.sh "$build" "$work/bad.md" "$work/bad.txt" >"$work/said" || ! grep -q "$3" "$work/said"; then
        echo "check-thesis.sh passes over: $3"
        failed=1
    fi
}
refused "$(echo "$row" | sed 's/pool_init/pool_empty_out/')" '' 'no function'
refused "$(echo "$row" | sed 's/no-odometry/no-moons/')" '' 'unknown option'
refused "$(echo "$row" | sed 's/| 3 |/|/')" '' 'cells'
refused "$(echo "$row" | sed 's|cairn map --no-odometry|bench/graph --no-moons|')" '' 'unknown option'
refused "$(echo "$row" | sed 's|cairn map --no-odometry|build/bench/graph --no-moons|')" '' 'unknown option'
refused "$(echo "$row" | sed 's/as written/well/')" '' 'none of those'
refused "$(echo "$row" | sed 's/as written/left out/')" '' 'does not say'
refused "$row
$row" '' 'twice'
refused "$(echo "$row" | sed 's/| 3 |/| |/')" '2/1 | default | build/cairn map --no-odometry | {x}' 'column default is empty'
refused "$(echo "$row" | sed 's/| 2 |/|  |/')" '2/1 | as_written | build/cairn map --no-odometry | {x}' 'column as_written is empty'
refused "$row" '2/2 | default | build/cairn map | {x}' 'no row'
refused "$row" '2/1 | first | build/cairn map | {x}' 'column'
refused "$row" '2/1 | default | build/cairn map --no-moons | {x}' 'unknown option'
exit $failed
