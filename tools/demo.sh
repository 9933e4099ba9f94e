#!/bin/sh
# Runs cairn map and cairn align on simulated logs: tools/demo.sh BUILD
#
# A robot drives through an apartment with drifting odometry; its log becomes a map. A rescue arena is scanned from 15
# places, in four directions each, with pose errors of up to 0.3 m and 20 degrees; the scans are aligned.
set -e
build=$1
out=$build/demo

run() {
    echo "\$ $*"
    "$@"
    echo
}

run "$build/cairn-arena" apartment --seed 4 --drive 400 --fov 180 --beams 181 --movers 2 -o "$out"
run "$build/cairn" map "$out/scans.log" -o "$out/map" --report "$out/map/map.html"
run "$build/cairn-arena" rescue --seed 4 --disturb 0.3,20 -o "$out/rescue"
run "$build/cairn" align "$out/rescue/scans.log" -o "$out/align" --report "$out/align/align.html"
echo "Look at $out/map/map.svg and $out/align/map.svg (before and after), at $out/map/map.html and"
echo "$out/align/align.html in a browser (every step), and at $out/arena.svg and $out/rescue/arena.svg (the arenas)."
