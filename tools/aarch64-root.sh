#!/bin/sh
# Fetches what the Python package is cross-built with and tried on: tools/aarch64-root.sh FOLDER
#
#   FOLDER/root    Python and the libraries of Debian for arm64, unpacked; the packages of the system are left alone
#   FOLDER/site    numpy and cffi for it, from PyPI
#   FOLDER/toolchain.cmake
#
# PIP names pip. What is there is not fetched again. Exits with 1 when the packages cannot be had.
set -e
mkdir -p "$1"
folder=$(cd "$1" && pwd)
root=$folder/root
[ -f "$folder/complete" ] && exit 0
rm -rf "$root" "$folder/apt" "$folder/debs" "$folder/wheels" "$folder/site"
mkdir -p "$root" "$folder/apt/lists/partial" "$folder/apt/archives/partial" "$folder/debs" "$folder/site"

# apt_get ARGUMENT...: of arm64, with lists of its own
apt_get()
{
    apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o APT::Sandbox::User=root -o Dir::State="$folder/apt" \
        -o Dir::State::lists="$folder/apt/lists" -o Dir::State::status=/dev/null -o Dir::Cache="$folder/apt" \
        -o Dir::Cache::archives="$folder/apt/archives" "$@"
}

apt_get update
(cd "$folder/debs" && apt_get download \
    libc6 libgcc-s1 libstdc++6 libexpat1 libffi8 libssl3 liblzma5 libuuid1 \
    libpython3.11-dev libpython3.11-minimal libpython3.11-stdlib python3.11-minimal \
    libbox2d-dev libbox2d2 libbz2-1.0 libbz2-dev libjpeg62-turbo libjpeg62-turbo-dev liblz4-1 liblz4-dev libpng-dev libpng16-16 \
    libsqlite3-0 libsqlite3-dev libyaml-0-2 libyaml-dev libzstd-dev libzstd1 zlib1g zlib1g-dev)
for package in "$folder"/debs/*.deb; do
    dpkg-deb -x "$package" "$root"
done
# /lib is a part of /usr, as on a system; links lead into the root.
cp -a "$root/lib/." "$root/usr/lib/"
rm -r "$root/lib"
ln -s usr/lib "$root/lib"
find "$root/usr/lib" -lname '/*' | while read -r link; do
    ln -sf "$root$(readlink "$link")" "$link"
done

"$PIP" download -q --disable-pip-version-check --only-binary=:all: --python-version 3.11 --implementation cp --abi cp311 --abi abi3 --abi none \
    --platform manylinux2014_aarch64 --platform manylinux_2_17_aarch64 --platform manylinux_2_28_aarch64 -d "$folder/wheels" numpy cffi
for wheel in "$folder"/wheels/*.whl; do
    python3 -m zipfile -e "$wheel" "$folder/site"
done

include="-isystem $root/usr/include -isystem $root/usr/include/aarch64-linux-gnu"
cat >"$folder/toolchain.cmake" <<EOF
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_C_FLAGS_INIT "$include")
set(CMAKE_CXX_FLAGS_INIT "$include")
set(CMAKE_MODULE_LINKER_FLAGS_INIT "-L$root/usr/lib/aarch64-linux-gnu -Wl,-rpath-link,$root/usr/lib/aarch64-linux-gnu")
set(CMAKE_FIND_ROOT_PATH $root)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
EOF
rm -rf "$folder/apt" "$folder/debs" "$folder/wheels"
: >"$folder/complete"
