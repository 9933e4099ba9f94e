#!/bin/sh
# Installs the dependencies of cairn on Debian: tools/deps.sh [build|bags|test|solver|vision|appearance|firmware|check|measure|packages|python|aarch64|docs|windows]...   (default: build)
#
# Prints nothing and exits with 0 when all are installed. As root it installs with apt-get; otherwise it prompts on a
# terminal and installs with sudo after a yes. When it cannot install, it prints the command and exits with 3.

# use  package  evidence that the package is installed: a command, or a header below an include directory
table='
build    gcc                     cc
build    g++                     c++
build    make                    make
build    libbox2d-dev            box2d/box2d.h
build    libyaml-dev             yaml.h
build    zlib1g-dev              zlib.h
build    libpng-dev              png.h
build    libjpeg62-turbo-dev     jpeglib.h
build    libtiff-dev             tiffio.h
build    pkg-config              pkg-config
bags     libsqlite3-dev          sqlite3.h
bags     liblz4-dev              lz4frame.h
bags     libbz2-dev              bzlib.h
bags     libzstd-dev             zstd.h
test     libcmocka-dev           cmocka.h
solver   libsuitesparse-dev      suitesparse/ldl.h
vision   libopencv-core-dev      opencv4/opencv2/core.hpp
vision   libopencv-imgproc-dev   opencv4/opencv2/imgproc.hpp
vision   libopencv-imgcodecs-dev opencv4/opencv2/imgcodecs.hpp
appearance libopencv-core-dev       opencv4/opencv2/core.hpp
appearance libopencv-features2d-dev opencv4/opencv2/features2d.hpp
appearance libopencv-ml-dev         opencv4/opencv2/ml.hpp
firmware gcc-arm-none-eabi       arm-none-eabi-gcc
firmware libnewlib-arm-none-eabi /usr/include/newlib/newlib.h
firmware qemu-system-arm         qemu-system-arm
check    clang                   clang
check    clang-tidy              clang-tidy
check    clang-format            clang-format
check    cppcheck                cppcheck
measure  lcov                    lcov
measure  valgrind                valgrind
check    gcc-aarch64-linux-gnu   aarch64-linux-gnu-gcc
check    libc6-dev-arm64-cross   /usr/aarch64-linux-gnu/include/stdio.h
check    qemu-user               qemu-aarch64
packages cmake                   cmake
python   python3                 python3
python   python3-venv            /usr/lib/python3.11/ensurepip
aarch64  gcc-aarch64-linux-gnu   aarch64-linux-gnu-gcc
aarch64  g++-aarch64-linux-gnu   aarch64-linux-gnu-g++
aarch64  libc6-dev-arm64-cross   /usr/aarch64-linux-gnu/include/stdio.h
aarch64  qemu-user               qemu-aarch64
docs     doxygen                 doxygen
check    man-db                  man
check    abigail-tools           abidiff
windows  gcc-mingw-w64-x86-64    x86_64-w64-mingw32-gcc
windows  g++-mingw-w64-x86-64    x86_64-w64-mingw32-g++
windows  libz-mingw-w64-dev      /usr/x86_64-w64-mingw32/include/zlib.h
windows  wine64                  wine|wine-stable|wine64
windows  wine                    wine|wine-stable|wine64
'

# True when one of the alternatives, separated by |, exists.
found()
{
    old_ifs=$IFS
    IFS='|'
    for proof in $1; do
        case $proof in
        /*) [ -e "$proof" ] ;;
        *.h | *.hpp) [ -e "/usr/include/$proof" ] || [ -e "/usr/local/include/$proof" ] || [ -e "/usr/include/$(cc -print-multiarch 2>/dev/null)/$proof" ] ;;
        *) command -v "$proof" >/dev/null 2>&1 ;;
        esac && IFS=$old_ifs && return 0
    done
    IFS=$old_ifs
    return 1
}

installed()
{
    dpkg-query -W -f '${Status}' "$1" 2>/dev/null | grep -q ' installed$'
}

[ $# -gt 0 ] || set -- build
for use in "$@"; do
    case $use in
    build | bags | test | solver | vision | appearance | firmware | check | measure | packages | python | aarch64 | docs | windows) ;;
    *)
        echo "tools/deps.sh: unknown use '$use', expected build, bags, test, solver, vision, appearance, firmware, check, measure, packages, python, aarch64, docs or windows" >&2
        exit 2
        ;;
    esac
done

missing=
while read -r use package proof; do
    case " $* " in
    *" $use "*) found "$proof" || installed "$package" || missing="$missing $package" ;;
    esac
done <<END
$(echo "$table" | grep .)
END
[ -n "$missing" ] || exit 0

if ! command -v apt-get >/dev/null 2>&1; then
    echo "cairn ($*) needs what Debian packages as:$missing" >&2
    echo "Please install it with the tools of this system; headers are looked for in /usr/include and /usr/local/include." >&2
    exit 3
fi

sudo=
install="apt-get install -y --no-install-recommends$missing"
if [ "$(id -u)" -ne 0 ]; then
    sudo=sudo
    if [ -t 0 ] && [ -t 2 ] && command -v sudo >/dev/null 2>&1; then
        printf 'cairn (%s) needs:%s\nInstall with sudo apt-get? [y/N] ' "$*" "$missing" >&2
        read -r answer
    else
        answer=no
    fi
    case $answer in
    y | Y | yes | Yes) ;;
    *)
        echo "cairn ($*) needs:$missing" >&2
        echo "Please run: sudo apt-get update && sudo $install" >&2
        exit 3
        ;;
    esac
fi

echo "cairn ($*): installing$missing" >&2
# Both commands are split into words on purpose.
# shellcheck disable=SC2086
if $sudo env DEBIAN_FRONTEND=noninteractive apt-get update -qq >&2 &&
    $sudo env DEBIAN_FRONTEND=noninteractive $install -qq >&2; then
    exit 0
fi
echo "cairn: the installation failed. Please run: ${sudo:+$sudo }apt-get update && ${sudo:+$sudo }$install" >&2
exit 3
