#!/bin/sh
# Installs the library (make install): tools/install.sh BUILD DESTDIR PREFIX LIBDIR VERSION SOVERSION HOST_LIBS
#
# PREFIX, LIBDIR: installed locations, copied below DESTDIR, which may be empty; HOST_LIBS: what the host library needs (-lz ...). The
# environment variable STRIP=-s: programs and shared libraries without symbols.
set -e
build=$1 to=$2$3 lib=$2$4 prefix=$3 libdir=$4 version=$5 soversion=$6 host_libs=$7
mkdir -p "$to/include/cairn" "$lib/pkgconfig" "$to/bin"

for header in include/cairn/*.h; do
    # Headers of the host library are installed only with it.
    module=${header##*/}
    if [ -f "$build/libcairn-host.a" ] || ! grep -q "^host/[a-z]* ${module%.h}\$" tools/modules.txt; then
        install -m 644 "$header" "$to/include/cairn/"
    fi
done
install -m 644 "$build/libcairn.a" "$build/libcairn-float.a" "$lib/"
# shellcheck disable=SC2086
install $STRIP -m 755 "$build/libcairn.so.$soversion" "$lib/"
ln -sf "libcairn.so.$soversion" "$lib/libcairn.so"
[ ! -f "$build/libcairn-vision.so" ] || install $STRIP -m 755 "$build/libcairn-vision.so" "$lib/"
[ ! -f "$build/libcairn-appearance.so" ] || install $STRIP -m 755 "$build/libcairn-appearance.so" "$lib/"
for tool in cairn cairn-float cairn-arena cairn-scene; do
    [ ! -f "$build/$tool" ] || install $STRIP -m 755 "$build/$tool" "$to/bin/"
done

# Manual pages, and what shells complete: the folders of their packages.
if [ -d "$build/man" ]; then
    mkdir -p "$to/share/man/man1" "$to/share/bash-completion/completions" "$to/share/zsh/site-functions" "$to/share/fish/vendor_completions.d"
    install -m 644 "$build"/man/*.1 "$to/share/man/man1/"
    install -m 644 "$build/completion/cairn.bash" "$to/share/bash-completion/completions/cairn"
    install -m 644 "$build/completion/_cairn" "$to/share/zsh/site-functions/"
    install -m 644 "$build/completion/cairn.fish" "$to/share/fish/vendor_completions.d/"
    # bash and fish look for a file of the program's name.
    for tool in cairn-float cairn-arena cairn-scene; do
        ln -sf cairn "$to/share/bash-completion/completions/$tool"
        ln -sf cairn.fish "$to/share/fish/vendor_completions.d/$tool.fish"
    done
fi

# package name description
package()
{
    echo "prefix=$prefix"
    echo 'includedir=${prefix}/include'
    echo "libdir=$libdir"
    echo
    echo "Name: $1"
    echo "Description: $2"
    echo "Version: $version"
}
{
    package cairn "maps from range scans, objects from contours: freestanding C"
    echo 'Cflags: -I${includedir}'
    echo 'Libs: -L${libdir} -lcairn -lm'
} >"$lib/pkgconfig/cairn.pc"
{
    package cairn-float "cairn computing in float"
    echo 'Cflags: -I${includedir} -DCAIRN_FLOAT'
    echo 'Libs: -L${libdir} -lcairn-float -lm'
} >"$lib/pkgconfig/cairn-float.pc"
if [ -f "$build/libcairn-host.a" ]; then
    install -m 644 "$build/libcairn-host.a" "$lib/"
    {
        package cairn-host "files, pictures and solvers for cairn on an operating system"
        echo 'Requires: cairn'
        # The library is static only, so each program links its dependencies.
        echo "Libs: -L\${libdir} -lcairn-host $host_libs"
    } >"$lib/pkgconfig/cairn-host.pc"
fi
echo "cairn $version: installed in $to"
