#!/bin/sh
# Builds and runs small programs with cairn as a package, as other projects do: tools/packages-test.sh BUILD
#
# By find_package and FetchContent of CMake, by pkg-config, by Conan (the command $CONAN or conan; without it that is skipped; with
# QUICK set left out), and by stand-ins for Zephyr, ESP-IDF and Arduino, which call their files as those do. BUILD holds what `make` builds; the libraries of
# CMake must have the same symbols. Nothing is written into the source tree. All is built without optimization.
build=$(cd "${1:?usage: tools/packages-test.sh BUILD}" && pwd)
source=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
fail()
{
    echo "FAILED packages: $*"
    failed=1
}
skipped()
{
    echo "skipped $*" | tee -a "${SKIPPED:-/dev/null}"
}

# run NAME COMMAND...: its output is shown when it fails.
run()
{
    what=$1
    shift
    "$@" >"$work/log" 2>&1 && return 0
    cat "$work/log"
    fail "$what"
    return 1
}

version=$(awk '/define CAIRN_VERSION_STRING/ { gsub(/"/, "", $3); print $3 }' include/cairn/version.h)
# runs WHAT PROGRAM TEXT: what the program prints
runs()
{
    said=$("$2" data/logs/rescue.log 2>&1)
    [ "$said" = "$3" ] || fail "$1: $(basename "$2") printed '$said', expected '$3'"
}
programs()
{
    runs "$1" "$2/robot-cairn" "$version, 8 bytes a number"
    runs "$1" "$2/robot-float" "$version float, 4 bytes a number"
}
scans=$(grep -c '^\(FLASER\|ROBOTLASER1\) ' data/logs/rescue.log)
cp -r tests/packages "$work/packages"

with_cmake()
{
    command -v cmake >/dev/null || {
        skipped "packages of CMake: no cmake"
        return 0
    }
    run "cmake: configuration" cmake -S . -B "$work/cmake" -DCMAKE_INSTALL_PREFIX="$work/installed" -DCMAKE_BUILD_TYPE=Debug &&
        run "cmake: build" cmake --build "$work/cmake" -j 2 && run "cmake: installation" cmake --install "$work/cmake" || return
    # The same functions as the Makefile's libraries, by name.
    for library in cairn cairn-float cairn-host; do
        [ -f "$build/lib$library.a" ] || continue
        for folder in "$build" "$work/cmake"; do
            nm -g --defined-only "$folder/lib$library.a" 2>/dev/null | awk 'NF == 3 { print $2, $3 }' | sort
        done | sort | uniq -u >"$work/differ"
        [ ! -s "$work/differ" ] || fail "lib$library.a of cmake and make differ: $(head -3 "$work/differ")"
    done
    run "find_package: configuration" cmake -S "$work/packages/find_package" -B "$work/found" -DCMAKE_PREFIX_PATH="$work/installed" &&
        run "find_package: build" cmake --build "$work/found" -j 2 && {
        programs find_package "$work/found"
        [ ! -f "$build/libcairn-host.a" ] || runs find_package "$work/found/robot-host" "$scans scans"
    }
    # Another minor version is not taken.
    sed 's/find_package(cairn [0-9.]*/find_package(cairn 99.1/' tests/packages/find_package/CMakeLists.txt >"$work/packages/find_package/CMakeLists.txt"
    if cmake -S "$work/packages/find_package" -B "$work/refused" -DCMAKE_PREFIX_PATH="$work/installed" >/dev/null 2>&1; then
        fail "find_package takes cairn $version for 99.1"
    fi
    run "FetchContent: configuration" cmake -S "$work/packages/fetch" -B "$work/fetched" -DCAIRN_SOURCE="$source" -DCAIRN_HOST=OFF -DCMAKE_BUILD_TYPE=Debug &&
        run "FetchContent: build" cmake --build "$work/fetched" -j 2 --target robot-cairn &&
        runs FetchContent "$work/fetched/robot-cairn" "$version, 8 bytes a number"
}

with_pkg_config()
{
    run "make install" "${MAKE:-make}" -s BUILD="$build" PREFIX="$work/prefix" install || return
    export PKG_CONFIG_PATH="$work/prefix/lib/pkgconfig"
    mkdir -p "$work/configured"
    # The flags are split into words on purpose.
    # shellcheck disable=SC2046
    run "pkg-config: build" ${CC:-cc} -std=c11 tests/packages/program.c $(pkg-config --cflags --libs cairn) -Wl,-rpath,"$work/prefix/lib" \
        -o "$work/configured/robot-cairn" &&
        run "pkg-config: build in float" ${CC:-cc} -std=c11 tests/packages/program.c $(pkg-config --cflags --libs cairn-float) \
            -o "$work/configured/robot-float" && programs pkg-config "$work/configured"
    [ -f "$build/libcairn-host.a" ] || return 0
    run "pkg-config: build with host" ${CC:-cc} -std=c11 tests/packages/program_host.c $(pkg-config --cflags --libs cairn-host) \
        -Wl,-rpath,"$work/prefix/lib" -o "$work/configured/robot-host" && runs pkg-config "$work/configured/robot-host" "$scans scans"
}

with_conan()
{
    [ -z "$QUICK" ] || return 0
    conan=${CONAN:-conan}
    command -v "$conan" >/dev/null || {
        skipped "package of Conan: no conan"
        return 0
    }
    export CONAN_HOME="$work/conan"
    run "conan profile" "$conan" profile detect &&
        run "conan create" "$conan" create . --no-remote --settings build_type=Debug --test-folder "$work/packages/conan" || return
    for expected in "$version, 8 bytes a number" "$version float, 4 bytes a number"; do
        grep -q "$expected\$" "$work/log" || fail "conan: no program printed '$expected'"
    done
}

# What the files for Zephyr and ESP-IDF do where their functions are called.
with_stand_ins()
{
    command -v cmake >/dev/null || return 0
    for system in zephyr esp-idf; do
        run "$system: configuration" cmake -S "$work/packages/$system" -B "$work/$system" -DCAIRN_SOURCE="$source" -DCMAKE_BUILD_TYPE=Debug &&
            run "$system: build" cmake --build "$work/$system" -j 2 &&
            runs "$system" "$work/$system/robot-float" "$version float, 4 bytes a number"
    done
    # ESP-IDF first reads the file of a component as a script.
    printf 'set(ESP_PLATFORM 1)\nmacro(idf_component_register)\nreturn()\nendmacro()\ninclude(%s/CMakeLists.txt)\n' "$source" >"$work/script.cmake"
    run "esp-idf: as a script" cmake -P "$work/script.cmake"
}

# A library of Arduino: C without options, used from C++.
with_arduino()
{
    run "arduino: library" sh tools/arduino.sh "$work/arduino/cairn" mapper version || return
    sed 's/#include "cairn\/mapper.h"/#include <cairn.h>/; /version.h/d; s/static _Alignas(\(.*\)) /alignas(\1) static /' tests/packages/program.c >"$work/arduino/sketch.cpp"
    run "arduino: build" ${CC:-cc} -c "$work/arduino/cairn/src/cairn.c" -o "$work/arduino/cairn.o" &&
        run "arduino: sketch" ${CXX:-c++} -I"$work/arduino/cairn/src" "$work/arduino/sketch.cpp" "$work/arduino/cairn.o" -lm -o "$work/arduino/robot-float" &&
        runs arduino "$work/arduino/robot-float" "$version float, 4 bytes a number"
}

with_cmake
with_pkg_config
with_conan
with_stand_ins
with_arduino
[ $failed -eq 0 ] && echo "ok     packages: programs built with CMake, pkg-config$([ -n "$QUICK" ] || echo ", Conan"); stand-ins for Zephyr, ESP-IDF, Arduino"
exit $failed
