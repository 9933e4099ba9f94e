#!/bin/sh
# The inputs under data/, made by cairn's own programs: tools/data.sh BUILD FOLDER
# Compares two such folders byte by byte:               tools/data.sh --compare MADE KEPT
# Runs the commands of data/README.md:                  tools/data.sh --try BUILD
set -e
if [ "$1" = --try ]; then
    build=${2:?usage: tools/data.sh --try BUILD}
    sed -n 's/.*`build\/\(cairn [^`]*\)`.*/\1/p' data/README.md | sed "s|build/try|$build/try|g" >"$build/try.txt"
    while read -r command; do
        # The words of the command are separate arguments on purpose.
        # shellcheck disable=SC2086
        "$build"/$command </dev/null >"$build/try.log" 2>&1 || {
            cat "$build/try.log"
            echo "FAILED data: $command (data/README.md)"
            exit 1
        }
    done <"$build/try.txt"
    echo "ok     data: $(wc -l <"$build/try.txt") commands of data/README.md run"
    exit 0
fi
if [ "$1" = --compare ]; then
    made=${2:?usage: tools/data.sh --compare MADE KEPT}
    kept=${3:?usage: tools/data.sh --compare MADE KEPT}
    files=$(cd "$made" && find . -type f | sort)
    failed=0
    for file in $files; do
        cmp -s "$made/$file" "$kept/$file" || {
            echo "FAILED data: $kept/$file differs from what the programs make, or is missing (tools/data.sh BUILD data writes it)"
            failed=1
        }
    done
    [ $failed = 0 ] && echo "ok     data: $(echo "$files" | wc -l) files made again, the same bytes"
    exit $failed
fi
build=${1:?usage: tools/data.sh BUILD FOLDER}
out=${2:?usage: tools/data.sh BUILD FOLDER}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# arena NAME OPTION...: the log of a simulated robot with its truth
arena()
{
    name=$1
    shift
    "$build/cairn-arena" "$@" -o "$work/$name" >/dev/null
    mkdir -p "$out/logs"
    cp "$work/$name/scans.log" "$out/logs/$name.log"
    cp "$work/$name/truth.csv" "$out/logs/$name.truth.csv"
}

arena rescue rescue --seed 4 --places 10 --disturb 0.3,20
arena apartment apartment --seed 4 --drive 150 --fov 180 --beams 181
arena office office --seed 12 --drive 400 --fov 180 --beams 181
arena people apartment --seed 11 --drive 120 --fov 180 --beams 181 --movers 3

# The maps of three robots, each in its own frame: three parts of the drive through the office, the poses of each turned and moved.
# robot NUMBER FIRST LAST X Y TURN: of scans FIRST to LAST, whose odometry is rotated by TURN (rad) and moved by X, Y (m)
mkdir -p "$out/maps"
robot()
{
    awk -v first="$2" -v last="$3" -v x="$4" -v y="$5" -v turn="$6" '
        function move(i,    u, v)
        {
            u = $i
            v = $(i + 1)
            $i = sprintf("%.6f", x + cos(turn) * u - sin(turn) * v)
            $(i + 1) = sprintf("%.6f", y + sin(turn) * u + cos(turn) * v)
            $(i + 2) = sprintf("%.6f", $(i + 2) + turn)
        }
        /^FLASER/ {
            if (++n < first || n > last) next
            move($2 + 3)
            move($2 + 6)
        }
        /^ODOM/ { move(2) }
        { print }' "$out/logs/office.log" >"$work/robot$1.log"
    "$build/cairn" map --quiet "$work/robot$1.log" -o "$work/robot$1"
    sed "s/^image: .*/image: robot$1.pgm/" "$work/robot$1/map.yaml" >"$out/maps/robot$1.yaml"
    cp "$work/robot$1/map.pgm" "$out/maps/robot$1.pgm"
}
robot 1 1 180 0 0 0.6
robot 2 120 290 -3 4 -1.2
robot 3 230 400 5 1 2.4

# A pose graph: that of the drive through the apartment.
mkdir -p "$out/graphs"
"$build/cairn" map --quiet "$out/logs/apartment.log" -o "$work/apartment-map"
cp "$work/apartment-map/graph.g2o" "$out/graphs/apartment.g2o"

# Known objects: silhouettes, drawings of their outlines, models; images of them in clutter with their truth.
mkdir -p "$out/shapes" "$out/images"
for object in apple bottle giraffe lizard mug swan; do
    "$build/cairn-scene" $object --seed 3 -o "$work/$object"
    cp "$work/$object/silhouette.pgm" "$out/shapes/$object-silhouette.pgm"
    cp "$work/$object/drawing.pgm" "$out/shapes/$object-drawing.pgm"
    "$build/cairn" model --quiet "$out/shapes/$object-drawing.pgm" -o "$out/shapes/$object.shape"
done
image()
{
    "$build/cairn-scene" "$2" --seed "$3" --clutter "$4" --noise "$5" -o "$work/image"
    cp "$work/image/scene.pgm" "$out/images/$1.pgm"
    cp "$work/image/truth.json" "$out/images/$1.json"
}
image swan swan 3 8 8
image mug mug 3 8 8
image noisy giraffe 5 20 20

# The recording of a flight of firmware/mission_maze.c, as its flight recorder writes it.
mkdir -p "$out/flights"
RECORDING=$out/flights/maze.rec "$build/firmware/host/maze" >/dev/null
