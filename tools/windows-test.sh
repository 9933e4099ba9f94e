#!/bin/sh
# cairn map for Windows, run under wine, writes the bytes that it writes here: tools/windows-test.sh BUILD
#
# BUILD holds the programs of this machine; those for Windows are built below it. Skipped, with the reason, where the compilers
# of mingw-w64 or wine are missing.
build=${1:?usage: tools/windows-test.sh BUILD}
make=${MAKE:-make}
unset MAKEFLAGS MFLAGS MAKELEVEL
work=$build/windows-test
failed=0

skipped()
{
    echo "skipped cairn map for Windows: $*" | tee -a "${SKIPPED:-/dev/null}"
    exit 0
}

fail()
{
    echo "FAILED windows: $*"
    failed=1
}

for tool in x86_64-w64-mingw32-gcc x86_64-w64-mingw32-g++ wine; do
    command -v $tool >/dev/null || skipped "no $tool (tools/deps.sh windows)"
done
[ -e /usr/x86_64-w64-mingw32/include/zlib.h ] || skipped "no zlib of mingw-w64 (tools/deps.sh windows)"
rm -rf "$work"
mkdir -p "$work"
$make -s -j2 CROSS=x86_64-w64-mingw32- BUILD="$build/windows" all >"$work/log" 2>&1 || {
    cat "$work/log"
    echo "FAILED windows: the programs do not build"
    exit 1
}
export WINEPREFIX="$(cd "$work" && pwd)/wine" WINEDEBUG=-all

# twice FOLDER WORD...: a command of cairn that writes into a folder, here and under wine; standard output without its times
twice()
{
    folder=$1
    shift
    "$build/cairn" "$@" -o "$work/here/$folder" </dev/null >"$work/here.txt" || fail "cairn $* here"
    wine "$build/windows/cairn.exe" "$@" -o "$work/wine/$folder" </dev/null >"$work/wine.txt" 2>"$work/wine.log" || {
        cat "$work/wine.log"
        fail "cairn $* under wine"
    }
    grep -v seconds "$work/here.txt" >"$work/expected.txt"
    grep -v seconds "$work/wine.txt" | cmp - "$work/expected.txt" || fail "cairn $*: standard output"
}

mkdir "$work/here" "$work/wine"
gzip -n -c data/logs/apartment.log >"$work/apartment.log.gz"
# The second run replaces the files of the first. map.svg holds a PNG image, which is packed differently without libpng.
twice map map data/logs/apartment.log
twice map map "$work/apartment.log.gz"
for file in poses.csv poses.tum map.pgm map.yaml graph.g2o; do
    cmp "$work/here/map/$file" "$work/wine/map/$file" || fail "$file"
done
[ -s "$work/wine/map/map.svg" ] || fail "no map.svg"
[ "$(ls -A "$work/here/map")" = "$(ls -A "$work/wine/map")" ] || fail "other files than here: $(ls -A "$work/wine/map")"
twice align align data/logs/rescue.log
cmp "$work/here/align/poses.csv" "$work/wine/align/poses.csv" || fail "poses.csv of cairn align"
wine "$build/windows/cairn.exe" replay data/flights/maze.rec >"$work/wine.txt" 2>"$work/wine.log" ||
    fail "cairn replay, which runs cairn-float.exe: $(cat "$work/wine.log")"

# What is missing is refused, with the reason, and exit code 2. Debian has neither library for Windows.
refused()
{
    pattern=$1
    shift
    wine "$build/windows/cairn.exe" "$@" >"$work/wine.txt" 2>"$work/wine.log"
    code=$?
    [ $code -eq 2 ] && grep -q "$pattern" "$work/wine.log" || fail "cairn $*: code $code, $(cat "$work/wine.log")"
}
refused "robot1.yaml: map files cannot be read: .* without libyaml" merge data/maps/robot1.yaml data/maps/robot2.yaml -o "$work/wine/merge"
printf '\211PNG\r\n\032\n\000\000\000\rIHDR\000\000\000\003\000\000\000\002\010\000\000\000\000....\000\000\000\000IEND....' >"$work/shape.png"
refused "shape.png: is a PNG image: .* without libpng" symmetry "$work/shape.png" -o "$work/wine/symmetry"
refused "nowhere.log: cannot open: No such file" map nowhere.log -o "$work/wine/nowhere"
[ $failed -eq 0 ] && echo "ok     windows: cairn.exe map writes the same poses, map and graph under wine as cairn here"
exit $failed
