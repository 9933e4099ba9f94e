#!/bin/sh
# A robot drives through a simulated apartment with drifting odometry; its log becomes a map: tools/demo.sh BUILD
set -e
build=$1
out=$build/demo

run() {
    echo "\$ $*"
    "$@"
    echo
}

run "$build/cairn-arena" apartment --seed 4 --drive 400 --fov 180 --beams 181 --movers 2 -o "$out"
run "$build/cairn" map "$out/scans.log" -o "$out/map"
echo "Look at $out/map/map.svg (before and after) and $out/arena.svg (the arena itself)."
