#!/bin/sh
# Installs into a scratch directory and builds programs against it with pkg-config: tools/install-test.sh BUILD
cc=${CC:-cc}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
fail()
{
    echo "FAILED install: $*"
    failed=1
}

${MAKE:-make} -s BUILD="$1" DESTDIR="$work/root" PREFIX=/opt/cairn install >"$work/log" 2>&1 || {
    cat "$work/log"
    fail "make install"
}
lib=$work/root/opt/cairn/lib
export PKG_CONFIG_PATH="$lib/pkgconfig" PKG_CONFIG_SYSROOT_DIR="$work/root"

cat >"$work/program.c" <<'END'
#include <stdio.h>
#include <cairn/geometry.h>
#include <cairn/pool.h>
#include <cairn/version.h>

static _Alignas(CAIRN_ALIGN) unsigned char memory[256];

int main(void)
{
    cairn_pool pool;
    cairn_pose a = {1, 2, 3};

    if (cairn_pool_init(&pool, memory, sizeof memory) != CAIRN_OK)
        return 1;
    a = cairn_pose_compose(a, cairn_pose_inverse(a));
    printf("%s %d\n", cairn_version_text(), (int)sizeof(cairn_real));
    return !(cairn_abs(a.x) < CAIRN_REAL(1e-5));
}
END
version=$(pkg-config --modversion cairn) || fail "pkg-config does not find cairn"

# Shared, static and float. The flags are split into words on purpose.
# shellcheck disable=SC2046
$cc -std=c11 "$work/program.c" $(pkg-config --cflags --libs cairn) -o "$work/shared" || fail "shared"
said=$(LD_LIBRARY_PATH=$lib "$work/shared")
[ "$said" = "$version 8" ] || fail "the shared program said '$said'"
readelf -d "$work/shared" | grep -q "libcairn\.so\.${version%.*}\]" || fail "the program does not need its soname"
# shellcheck disable=SC2046
$cc -std=c11 "$work/program.c" $(pkg-config --cflags cairn) "$lib/libcairn.a" -lm -o "$work/static" || fail "static"
said=$("$work/static")
[ "$said" = "$version 8" ] || fail "the static program said '$said'"
# shellcheck disable=SC2046
$cc -std=c11 "$work/program.c" $(pkg-config --cflags --libs cairn-float) -o "$work/float" || fail "float"
said=$("$work/float")
[ "$said" = "$version float 4" ] || fail "the float program said '$said'"

# Mixes of double and float must not link.
# shellcheck disable=SC2046
if $cc -std=c11 "$work/program.c" $(pkg-config --cflags cairn-float) "$lib/libcairn.a" -lm -o "$work/mixed" 2>"$work/said" ||
    ! grep -q cairn_pool_init_float "$work/said"; then
    fail "a float program linked with the double library"
fi
# shellcheck disable=SC2046
if $cc -std=c11 "$work/program.c" $(pkg-config --cflags cairn) "$lib/libcairn-float.a" -lm -o "$work/mixed" 2>"$work/said"; then
    fail "a double program linked with the float library"
fi

if [ -f "$lib/libcairn-host.a" ] && ls src/host/*/*.c >/dev/null 2>&1; then
    echo '#include <cairn/version.h>' >"$work/host.c"
    awk '$1 ~ /^host/ { print "#include <cairn/" $2 ".h>" }' tools/modules.txt | while read -r line; do
        header=${line#*<}
        [ ! -f "$work/root/opt/cairn/include/${header%>}" ] || echo "$line"
    done >>"$work/host.c"
    echo 'int main(void) { return cairn_version() < 0; }' >>"$work/host.c"
    # shellcheck disable=SC2046
    $cc -std=c11 "$work/host.c" $(pkg-config --cflags --libs cairn-host) -o "$work/host" &&
        LD_LIBRARY_PATH=$lib "$work/host" || fail "host"
fi
for tool in cairn cairn-arena; do
    [ ! -f "$1/$tool" ] || [ -x "$work/root/opt/cairn/bin/$tool" ] || fail "$tool is not there"
done
# No file names the folder that it was built in.
named=$(grep -rlF "$PWD" "$work/root")
[ -z "$named" ] || fail "the folder of the sources is named in: $named"
# Another folder of libraries, without symbols.
STRIP=-s ${MAKE:-make} -s BUILD="$1" DESTDIR="$work/stripped" PREFIX=/opt/cairn LIBDIR=/opt/lib64 install >"$work/log" 2>&1 || {
    cat "$work/log"
    fail "make install with LIBDIR"
}
grep -qx 'libdir=/opt/lib64' "$work/stripped/opt/lib64/pkgconfig/cairn.pc" || fail "LIBDIR is not that of cairn.pc"
[ ! -e "$work/stripped/opt/cairn/lib" ] || fail "with LIBDIR there is lib"
readelf -S "$work/stripped/opt/cairn/bin/cairn" | grep -q '\.symtab' && fail "cairn has symbols"

[ ! -d "$1/man" ] || man -l "$work/root/opt/cairn/share/man/man1/cairn-map.1" 2>/dev/null | grep -q -- --window || fail "no page of cairn map"

# Removed is what was installed, and nothing else.
touch "$work/root/opt/cairn/lib/other"
${MAKE:-make} -s BUILD="$1" DESTDIR="$work/root" PREFIX=/opt/cairn uninstall >"$work/log" 2>&1 || {
    cat "$work/log"
    fail "make uninstall"
}
left=$(find "$work/root" ! -type d)
[ "$left" = "$work/root/opt/cairn/lib/other" ] || fail "after make uninstall there is: $left"
[ ! -d "$work/root/opt/cairn/include/cairn" ] || fail "after make uninstall there is include/cairn"

[ $failed -eq 0 ] && echo "ok     install: $version; shared, static, float; double and float do not mix; all is removed"
exit $failed
