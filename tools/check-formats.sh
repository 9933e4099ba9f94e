#!/bin/sh
# The examples of docs/formats.md are read by the commands that it names: tools/check-formats.sh PROGRAMS
#
# Bags and recordings are binary: those of the tests and data/flights/maze.rec stand for them. Each section of a format that is read
# must be tried here.
programs=${1:?usage: tools/check-formats.sh PROGRAMS}
PATH=$(cd "$programs" && pwd):$PATH
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
tried=

# example SECTION [N]: the lines of its N-th example, those that are indented by four
example()
{
    awk -v section="## $1" -v wanted="${2:-1}" '
        /^## / { inside = $0 == section; next }
        !inside { next }
        /^    / { if (!block) { block = 1; number++ } if (number == wanted) print substr($0, 5); next }
        { block = 0 }' docs/formats.md
}

# reads SECTION TEXT COMMAND...: the command succeeds and prints TEXT
reads()
{
    section=$1 text=$2
    shift 2
    tried="$tried|$section"
    if ! "$@" >"$work/said" 2>&1 || ! grep -qF -- "$text" "$work/said"; then
        echo "FAILED docs/formats.md, $section: '$*' does not print '$text':"
        sed 's/^/    /' "$work/said" | head -5
        failed=1
    fi
}
# same SECTION EXAMPLE FILE: they are the same
same()
{
    diff "$2" "$3" >"$work/said" || {
        echo "FAILED docs/formats.md, $1:"
        sed 's/^/    /' "$work/said"
        failed=1
    }
}
# refused SECTION TEXT COMMAND...: the command fails and prints TEXT
refused()
{
    section=$1 text=$2
    shift 2
    tried="$tried|$section"
    if "$@" >"$work/said" 2>&1 || ! grep -qF -- "$text" "$work/said"; then
        echo "FAILED docs/formats.md, $section: '$*' is not refused with '$text'"
        failed=1
    fi
}

example 'CARMEN logs' >"$work/carmen.log"
reads 'CARMEN logs' '"kind": "carmen"' cairn info "$work/carmen.log" --json
example 'Tables of ranges' >"$work/table.csv"
reads 'Tables of ranges' '"scans": 2' cairn info "$work/table.csv" --json
# "...": the number before it again, up to the ranges and up to the end of the line
example 'URG logs' | awk '
    { for (i = 1; i <= NF; i++) if ($i == "...") { limit = limit ? 707 : 25; while (count < limit) number[count++] = last } else number[count++] = last = $i }
    END { for (i = 0; i < count; i++) printf "%s ", number[i]; print "" }' >"$work/urg.log"
reads 'URG logs' '"kind": "urg", "taken": null, "sources": null, "scans": 1,' cairn info "$work/urg.log" --json
example 'Scans of CSM' >"$work/csm.json"
reads 'Scans of CSM' '"kind": "csm"' cairn info "$work/csm.json" --json
example 'Streams' >"$work/stream"
reads 'Streams' '{"scan":0,"stamp_ns":1147713122541201000,' sh -c 'cairn map - --live <"$1"' stream "$work/stream"
example 'poses.csv' >"$work/poses.csv"
reads 'poses.csv' '"poses": 2' cairn eval poses "$work/poses.csv" "$work/poses.csv" --json
example 'Relations' >"$work/some.relations"
reads 'Relations' '"relations": 2, "left_out": 0' cairn eval relations "$work/poses.csv" "$work/some.relations" --json
example 'Pose graphs' >"$work/graph.g2o"
reads 'Pose graphs' '"verdict": "converged"' cairn graph "$work/graph.g2o" --json
cp data/maps/robot1.pgm "$work/map.pgm"
example 'Maps' >"$work/map.yaml"
reads 'Maps' '"cells": ' cairn eval map data/logs/people.log --map "$work/map.yaml" --json
example 'Transforms of merged maps' >"$work/transforms.csv"
reads 'Transforms of merged maps' '"verdict": "placed"' \
    cairn merge data/maps/robot1.yaml data/maps/robot3.yaml --start "$work/transforms.csv" -o "$work/merged" --json
example 'Images' >"$work/edges.pgm"
reads 'Images' '"objects": []' cairn group "$work/edges.pgm" --edges "$work/edges.pgm" --model data/shapes/mug.shape -o "$work/group" --json
example 'Models of shapes' | sed '/^\.\.\.$/,$d' >"$work/model"
head -n "$(wc -l <"$work/model")" data/shapes/mug.shape >"$work/head"
same 'Models of shapes' "$work/model" "$work/head"
reads 'Models of shapes' '"picture": null' cairn model data/shapes/mug.shape -o "$work/mug.shape" --json
example 'Fragments given by hand' >"$work/cuts"
reads 'Fragments given by hand' 'paths' cairn model data/shapes/mug.shape -o "$work/mug.shape" --parts "$work/parts.svg" --cuts "$work/cuts"
example 'Boxes' >"$work/boxes.csv"
tried="$tried|Boxes"
if [ -f "$programs/libcairn-vision.so" ]; then
    reads 'Boxes' '1 detection' cairn detect data/images/swan.pgm --model data/shapes/swan.shape --truth "$work/boxes.csv" --curves "$work/curve" \
        --detections "$work/found.csv" -o "$work/found"
    same 'Boxes' "$work/boxes.csv" "$work/found.csv"
    example 'Curves' >"$work/wanted.csv"
    same 'Curves' "$work/wanted.csv" "$work/curve.csv"
else
    echo "skipped the example of boxes: no OpenCV"
fi
example 'Appearance models' >"$work/look"
refused 'Appearance models' "$work/look:" cairn detect data/images/swan.pgm --model data/shapes/swan.shape --appearance "$work/look" -o "$work/found"
reads 'Recordings' 'the same run' cairn replay data/flights/maze.rec
# The examples of bags are run by tests/test_cairn_tool.c, which writes the bags.
tried="$tried|Bags of ROS"
# The sections whose first line says that the format is read.
awk '/^## / { section = substr($0, 4); next } section != "" && /Read by|Read and|, read by/ { print section } /./ { section = "" }' \
    docs/formats.md | while IFS= read -r section; do
    case "$tried|" in *"|$section|"*) ;; *) echo "FAILED docs/formats.md, $section: not tried by tools/check-formats.sh" ;; esac
done >"$work/untried"
[ ! -s "$work/untried" ] || { cat "$work/untried"; failed=1; }
[ $failed -ne 0 ] || echo "ok     docs/formats.md: the examples are read"
exit $failed
