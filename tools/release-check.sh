#!/bin/sh
# A tarball of make dist alone builds, passes its tests, makes its data again and installs: tools/release-check.sh TARBALL NAME
#
# The tarball is made once more and must be the same bytes.
set -e
tarball=${1:?usage: tools/release-check.sh TARBALL NAME}
name=${2:?usage: tools/release-check.sh TARBALL NAME}
make=${MAKE:-make}
unset MAKEFLAGS MFLAGS MAKELEVEL
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cp "$tarball" "$folder/first.tar.gz"
$make BUILD="$(dirname "$tarball")" dist >/dev/null
cmp "$folder/first.tar.gz" "$tarball" || {
    echo "FAILED release: make dist made other bytes the second time"
    exit 1
}
tar -xzf "$tarball" -C "$folder"
cd "$folder/$name"
[ ! -e .git ]
$make -j2 test
$make -j2 data
$make install DESTDIR="$folder/installed" PREFIX=/usr
for file in bin/cairn lib/libcairn.a lib/pkgconfig/cairn.pc include/cairn/mapper.h; do
    [ -e "$folder/installed/usr/$file" ] || {
        echo "FAILED release: make install left no $file"
        exit 1
    }
done
echo "ok     release: $name builds, passes its tests and installs without git"
