#!/bin/sh
# All steps of `make check`: tools/check.sh BUILD [--quick | --slow | STEP...]
#
# --quick are the steps of .ci/run. tools/check-long.sh has the others, --slow, and the steps whose names end in _rest.
# A step prints a line "ok ..." or its faults; all steps run, and the exit status is 1 when one failed. Skipped steps are
# reported, also in the file $SKIPPED.
build=${1:?usage: tools/check.sh BUILD [--quick | --slow | STEP...]}
shift
out=$build/check
mkdir -p "$out"
make=${MAKE:-make}
export LC_ALL=C
unset MAKEFLAGS MFLAGS MAKELEVEL

library=$(ls src/*/*.c)
c_files=$(ls src/*/*.c src/host/*/*.c tools/*.c tests/*.c bench/*.c firmware/*.c 2>/dev/null)
cpp_files=$(ls sim/*.cpp src/host/*/*.cpp 2>/dev/null)
headers=$(ls src/*/*.h src/host/*/*.h include/cairn/*.h sim/*.h tools/*.h tests/*.h bench/*.h firmware/*.h 2>/dev/null)

# said NAME STATUS LOG: prints the line of a step, with the output of its tools when it failed.
said()
{
    if [ "$2" -eq 0 ]; then
        echo "ok     $1"
    else
        cat "$3"
        echo "FAILED $1"
    fi
    return "$2"
}

skipped()
{
    echo "skipped $*" | tee -a "${SKIPPED:-/dev/null}"
}

# The gcc build: its objects are also the input of the freestanding check.
gcc_build()
{
    $make -s -j2 BUILD="$out/gcc" CC=gcc CXX=g++ WERROR=-Werror \
        CFLAGS='-fstack-usage -fcallgraph-info=su -fno-stack-protector -U_FORTIFY_SOURCE' "$@"
}

# Its warnings do not depend on the optimizer.
clang_syntax()
{
    $make -s -j2 BUILD="$out/clang" CC=clang CXX=clang++ WERROR=-Werror ASSERTIONS=1 OPT=-O0 CFLAGS=-fsyntax-only "$@"
}

# What is used compiles without a warning. Those of tests are errors in .ci/run, whose `make test` has WERROR=-Werror; in check-long
# all is compiled, by gcc and by clang, also benches in float.
step_warnings()
{
    gcc_build code-objects all >"$out/warnings.log" 2>&1
    said "warnings: gcc, double and float" $? "$out/warnings.log"
}

step_clang()
{
    clang_syntax code-objects >"$out/clang.log" 2>&1
    said "warnings: clang, of the code that is built, double and float" $? "$out/clang.log"
}

step_warnings_rest()
{
    {
        gcc_build TEST_OPT= objects && clang_syntax unused-objects
    } >"$out/warnings_rest.log" 2>&1
    said "warnings: gcc, all with its optimizer, and clang, tests and benches" $? "$out/warnings_rest.log"
}

step_format()
{
    # shellcheck disable=SC2086
    clang-format --dry-run -Werror $c_files $cpp_files $headers >"$out/format.log" 2>&1
    said "format" $? "$out/format.log"
}

# lint NAME LIBRARY_CHECKS FILE...: tests and benches may call the shell, count in reals, compare bytes and include a tool's source;
# their bad reads are found by the sanitizers.
lint()
{
    log=$out/$1.log
    export LIBRARY=$2
    shift 2
    export FLAGS="-std=c11 -D_POSIX_C_SOURCE=200809L -D_DEFAULT_SOURCE -I. -Iinclude -I$out/gcc"
    export TEST_CHECKS='-cert-*,-clang-analyzer-*,-misc-no-recursion,-bugprone-not-null-terminated-result,-bugprone-suspicious-memory-comparison,-bugprone-suspicious-include'
    export OPENCV="$opencv"
    printf '%s\n' "$@" | xargs -P 2 -n 1 sh -c '
        case $1 in
        */vision_shim.cpp | */appearance_shim.cpp) clang-tidy --quiet "$1" -- -std=c++17 -I. -Iinclude -isystem "$OPENCV" ;;
        *.cpp) clang-tidy --quiet "$1" -- -std=c++17 -I. -Iinclude ;;
        tests/* | bench/*) clang-tidy --quiet --checks="$TEST_CHECKS" "$1" -- $FLAGS ;;
        src/host/* | tools/* | firmware/*) clang-tidy --quiet "$1" -- $FLAGS ;;
        *) clang-tidy --quiet --checks="$LIBRARY" "$1" -- $FLAGS ;;
        esac || exit 1' tidy >"$log" 2>&1
    status=$?
    sed -i '/^[0-9]* warnings\{0,1\} generated\.$/d' "$log" # and left out, for they are those of the system's headers
    return $status
}

# The library and the host library. In check-long all code, and the paths through the library by the analyzers of gcc and clang.
step_tidy()
{
    # shellcheck disable=SC2046,SC2086
    lint tidy '-clang-analyzer-*' $library $(ls src/host/*/*.c)
    said "clang-tidy: src and include" $? "$out/tidy.log"
}

# The most expensive files, those of sim, come first, so that both processes end together.
step_tidy_rest()
{
    # The files of the board, of its compiler and of generated scans are compiled for another target; test_layout and test_comments include
    # what the build makes.
    other_files=$(echo "$c_files" | grep -v '^src/\|^tests/test_layout\|^tests/test_comments\|^firmware/\(board_cortex_m\|soft_double\|mission_\|survey_\)')
    # Without OpenCV its headers are missing.
    opencv=$(ls -d /usr/include/opencv4 /usr/local/include/opencv4 2>/dev/null | head -1)
    files=$cpp_files
    [ -n "$opencv" ] || {
        skipped "clang-tidy of vision_shim.cpp: no OpenCV"
        files=$(echo "$files" | grep -v /vision_shim)
    }
    [ -f "$opencv/opencv2/features2d.hpp" ] && [ -f "$opencv/opencv2/ml.hpp" ] || {
        skipped "clang-tidy of appearance_shim.cpp: no features2d or ml of OpenCV"
        files=$(echo "$files" | grep -v /appearance_shim)
    }
    gcc_build "$out/gcc/tests/layout.h" # which tests/test_layout.c includes
    # shellcheck disable=SC2086
    lint tidy_rest '' $files $other_files $library
    said "clang-tidy: sim, tools, tests, bench, firmware, and the library with clang's analyzer" $? "$out/tidy_rest.log"
}

# analyze NAME STANDARD REAL FILE...: in the configuration that is compiled, not in all configurations of the system headers.
analyze()
{
    log=$out/$1.log options="--std=$2 -D$3"
    shift 3
    # shellcheck disable=SC2086
    [ $# -eq 0 ] || cppcheck --quiet -j 2 --enable=warning,performance,portability --error-exitcode=1 -I. -Iinclude \
        -D__GNUC__=12 -D__unix__ $options "$@" >>"$log" 2>&1
}

# Everything in double; in float the code that differs there, and in check-long everything again.
step_cppcheck()
{
    failed=0
    : >"$out/cppcheck.log"
    # shellcheck disable=SC2046,SC2086
    {
        analyze cppcheck c11 CAIRN_DOUBLE src tools bench firmware || failed=1
        analyze cppcheck c11 CAIRN_FLOAT $(grep -l CAIRN_FLOAT $(echo "$c_files" | grep -v ^tests/)) || failed=1
        analyze cppcheck c++17 CAIRN_DOUBLE $(ls -d sim 2>/dev/null) || failed=1
    }
    said "cppcheck" $failed "$out/cppcheck.log"
}

step_cppcheck_rest()
{
    : >"$out/cppcheck_rest.log"
    analyze cppcheck_rest c11 CAIRN_FLOAT src tools bench firmware
    said "cppcheck in float" $? "$out/cppcheck_rest.log"
}

# C and the library only: gcc's analyzer does not support C++, and has false positives on stdio.
step_analyzer_rest()
{
    echo "$library" | xargs -P 2 -n 1 sh -c 'gcc -std=c11 -O0 -I. -Iinclude -DCAIRN_ANALYZER -fanalyzer -Werror -c "$1" -o /dev/null || exit 1' \
        analyzer >"$out/analyzer_rest.log" 2>&1
    said "gcc -fanalyzer" $? "$out/analyzer_rest.log"
}

step_freestanding()
{
    sh tools/check-freestanding-test.sh && sh tools/refusals-test.sh || return 1
    gcc_build "$out/gcc/libcairn.a" "$out/gcc/libcairn-float.a" >"$out/freestanding.log" 2>&1 || {
        said "freestanding: the library does not build" 1 "$out/freestanding.log"
        return 1
    }
    sh tools/check-freestanding.sh "$out/gcc/libcairn.a" "$out/gcc/libcairn-float.a" || return 1
    for real in double float; do
        rm -rf "$out/graphs"
        mkdir "$out/graphs"
        for source in $library; do
            cp "$out/gcc/$real/$source.ci" "$out/graphs/$(echo "$source" | tr / -).ci" || return 1
        done
        echo "stack in $real:"
        sh tools/check-stack.sh "$out/graphs" || return 1
    done
}

step_modules()
{
    sh tools/check-modules-test.sh && sh tools/check-modules.sh && sh tools/header-list.sh --check
}

step_budgets()
{
    sh tools/check-budgets-test.sh && sh tools/check-budgets.sh
}

step_circles()
{
    sh tools/check-circles-test.sh || return 1
    gcc_build "$out/gcc/libcairn.a" "$out/gcc/libcairn-host.a" >"$out/circles.log" 2>&1 || {
        said "circles: the libraries do not build" 1 "$out/circles.log"
        return 1
    }
    sh tools/check-circles.sh "$out/gcc/libcairn.a" "$out/gcc/libcairn-host.a"
}

step_words()
{
    sh tools/check-words-test.sh && sh tools/check-words.sh
}

# Each public header alone, as C and as C++, in double and float.
step_headers()
{
    ls include/cairn/*.h | xargs -P 2 -n 1 sh -c '
        for real in CAIRN_DOUBLE CAIRN_FLOAT; do
            for language in "c -std=c11" "c++ -std=c++17"; do
                echo "#include \"${1#include/}\"" |
                    gcc -x $language -Iinclude -D$real -Wall -Wextra -Wpedantic -Werror -fsyntax-only - || exit 1
            done
        done' headers >"$out/headers.log" 2>&1
    said "headers alone, C11 and C++17" $? "$out/headers.log"
}

# The API reference: a public symbol without documentation, or with a default that is not so, is an error.
step_docs()
{
    command -v doxygen >/dev/null 2>&1 || {
        skipped "API reference: no doxygen"
        return 0
    }
    gcc_build run-docs-test
}

step_bits()
{
    sh tools/check-bits.sh "$out"
}

step_bits_rest()
{
    sh tools/check-bits.sh "$out" rest
}

step_amalgamation()
{
    sh tools/amalgamate-test.sh "$out"
}

step_readme()
{
    gcc_build "$out/gcc/libcairn.a" >"$out/readme.log" 2>&1 && sh tools/check-readme.sh "$out/gcc/libcairn.a" >>"$out/readme.log" 2>&1 &&
        sh tools/reliability.sh "$out/reliability.svg" >>"$out/readme.log" 2>&1 && cmp "$out/reliability.svg" docs/reliability.svg >>"$out/readme.log" 2>&1
    said "README: the example compiles and runs, the figures of documents are those that were measured" $? "$out/readme.log"
}

step_formats()
{
    gcc_build all >"$out/formats.log" 2>&1 && sh tools/check-formats.sh "$out/gcc" >>"$out/formats.log" 2>&1
    said "docs/formats.md: the examples are read" $? "$out/formats.log"
}

step_thesis()
{
    gcc_build run-bench >"$out/thesis.log" 2>&1 &&
        sh tools/check-thesis-test.sh "$out/gcc" >>"$out/thesis.log" 2>&1 && sh tools/check-thesis.sh "$out/gcc" >>"$out/thesis.log" 2>&1
    said "docs/thesis.md: functions, commands, experiments" $? "$out/thesis.log"
}

# Manual pages and completions: of all commands, with all options.
step_pages()
{
    command -v man >/dev/null || {
        skipped "manual pages: no man"
        return 0
    }
    gcc_build man completion >"$out/pages.log" 2>&1 || {
        said "manual pages are not made" 1 "$out/pages.log"
        return 1
    }
    bash tools/pages-test.sh "$out/gcc"
}

# Of the build systems whose tools are not tried.
step_manifests()
{
    command -v python3 >/dev/null || {
        skipped "manifests of other build systems: no python3"
        return 0
    }
    sh tools/manifests-test.sh
}

# What commands print with --json, compared with docs/schemas by a package of PyPI.
step_json()
{
    why=$(sh tools/venv.sh "$build/python" 'jsonschema>=4,<5') || {
        skipped "--json and its schemas: $why"
        return 0
    }
    gcc_build all >"$out/json.log" 2>&1 || {
        said "--json: the programs do not build" 1 "$out/json.log"
        return 1
    }
    sh tools/json-test.sh "$out/gcc" "$build/python/bin/python" && "$build/python/bin/python" tools/check-json.py "$out/gcc" tools/json.txt
}

# Bags that the package rosbags of PyPI writes are read as it reads them.
step_bags_rest()
{
    why=$(sh tools/deps.sh bags 2>&1 && sh tools/venv.sh "$build/rosbags" 'rosbags>=0.11,<0.12') || {
        skipped "bags compared with rosbags: $why"
        return 0
    }
    rm -rf "$out/bags"
    mkdir "$out/bags"
    gcc_build "$out/gcc/tests/test_scan_log" >"$out/bags_rest.log" 2>&1 &&
        "$build/rosbags/bin/python" tests/compare_bags.py "$out/gcc/tests/test_scan_log" "$out/bags" >>"$out/bags_rest.log" 2>&1
    status=$?
    [ $status -ne 0 ] || grep "the same$" "$out/bags_rest.log"
    said "bags are read as rosbags reads them" $status "$out/bags_rest.log"
}

step_install()
{
    sh tools/install-test.sh "$out/gcc"
}

# The record is of this compiler's debug information and of this machine's layout.
step_abi()
{
    [ "$(uname -m)" = x86_64 ] || {
        skipped "binary interface: its record is of x86_64"
        return 0
    }
    command -v abidiff >/dev/null || {
        skipped "binary interface: no abidiff"
        return 0
    }
    version=$(awk '/define CAIRN_VERSION_STRING/ { gsub(/"/, "", $3); print $3 }' include/cairn/version.h)
    shared=$out/gcc/libcairn.so.${version%.*}
    gcc_build "$shared" >"$out/abi.log" 2>&1 || {
        said "binary interface: the library does not build" 1 "$out/abi.log"
        return 1
    }
    sh tools/check-abi-test.sh && sh tools/check-abi.sh "$shared" "$version" tools/libcairn-*.abi.gz
}

quick="modules budgets words headers format warnings docs freestanding circles abi amalgamation readme formats thesis manifests pages json install"
slow="clang bits cppcheck tidy"
case ${1-} in
'') set -- $quick $slow ;;
--quick) set -- $quick ;;
--slow) set -- $slow ;;
esac
failures=
for step in "$@"; do
    start=$(date +%s)
    "step_$step" || failures="$failures $step"
    echo "       $step: $(($(date +%s) - start)) s"
done
if [ -n "$failures" ]; then
    echo "make check: failed:$failures"
    exit 1
fi
echo "make check: all passed"
