#!/bin/sh
# Checks of a release in addition to .ci/run, too slow for every change: tools/check-long.sh BUILD
#
# All steps run; each prints its minutes, and the exit status is 1 when one failed.
build=${1:?usage: tools/check-long.sh BUILD}
make=${MAKE:-make}
unset MAKEFLAGS MFLAGS MAKELEVEL
SKIPPED=$(mktemp)
export SKIPPED
trap 'rm -f "$SKIPPED"' EXIT
start=$(date +%s)
failures=

step()
{
    name=$1
    shift
    begin=$(date +%s)
    echo "== $name"
    "$@" || failures="$failures, $name"
    awk -v name="$name" -v s=$(($(date +%s) - begin)) 'BEGIN { printf "== %s took %.1f min\n", name, s / 60 }'
}

# .ci/run looks for wrong addresses in double, and for undefined behaviour by traps that do not say what they found.
step "tests with the sanitizers of addresses and of undefined behaviour, double and float" \
    $make -j2 BUILD="$build/sanitized" SANITIZE=1 test
sh tools/deps.sh windows || true # what is missing is skipped, with the reason
step "cairn map for Windows" $make -j2 BUILD="$build" windows-test
step "firmware on both boards, double in software, too" $make -j2 BUILD="$build" SOFT_DOUBLE=1 firmware-test
step "Python package" $make -j2 BUILD="$build" python-test
step "Python package, with the sanitizer of addresses" $make -j2 BUILD="$build/asan" SANITIZE=address OPT=-O1 PRECISIONS=double \
    PYTHON_TESTS=python/tests/test_package.py python-test
step "Python package, node of ROS 2" $make -j2 BUILD="$build" python-ros
step "Python package, ruff and mypy" $make BUILD="$build" python-check
step "Python package, sdist and wheel" $make BUILD="$build" python-wheel
sh tools/deps.sh packages || skipped "packages of CMake: no cmake"
sh tools/venv.sh "$build/conan" 'conan>=2,<3' || true # what is missing is skipped, with the reason
step "packages of CMake, pkg-config and Conan" env CONAN="$PWD/$build/conan/bin/conan" $make -j2 BUILD="$build" packages-test
step "release from the tarball" $make -j2 BUILD="$build/release" release-check
for name in clang bits cppcheck tidy warnings_rest analyzer_rest tidy_rest cppcheck_rest bits_rest bags_rest; do
    step "check $name" sh tools/check.sh "$build" $name
done
total=$(awk -v s=$(($(date +%s) - start)) 'BEGIN { printf "%.1f min", s / 60 }')
skipped=$(wc -l <"$SKIPPED")
[ -z "$failures" ] || {
    echo "make check-long: failed: ${failures#, }; $total, $skipped steps skipped"
    exit 1
}
echo "make check-long: all passed in $total, $skipped steps skipped"
