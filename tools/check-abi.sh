#!/bin/sh
# Compares the binary interface of a shared library with the record of a release: tools/check-abi.sh LIBRARY VERSION RECORD.gz [HEADERS]
#
# RECORD.gz is libcairn-MAJOR.MINOR.PATCH.abi.gz, written by tools/abi.sh. VERSION is that of the library. Within one MAJOR.MINOR,
# functions may be added, and are listed; a function that was removed, or whose parameters, result or types changed, is a
# failure. With another MAJOR.MINOR, which is then in development, changes are allowed and counted (docs/versions.md).
usage='usage: tools/check-abi.sh LIBRARY VERSION RECORD.gz [HEADERS]'
library=${1:?$usage} version=${2:?$usage} record=${3:?$usage} headers=${4:-include}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
released=${record##*/libcairn-}
released=${released%.abi.gz}
gzip -dc "$record" >"$work/released.abi" || exit 1
sh tools/abi.sh "$library" "$headers" 2>"$work/said" | gzip -dc >"$work/current.abi" 2>/dev/null
[ -s "$work/current.abi" ] || {
    cat "$work/said"
    echo "FAILED abi: abidw cannot read $library"
    exit 1
}

# compare OPTION...: abidiff of both records. The result has the bits 1 error, 2 usage, 4 change, 8 incompatible.
compare()
{
    abidiff --no-show-locs "$@" "$work/released.abi" "$work/current.abi" >"$work/said" 2>&1
    status=$?
    [ $((status & 3)) -eq 0 ] || {
        cat "$work/said"
        echo "FAILED abi: abidiff could not compare $library with $record"
        exit 1
    }
    return $status
}

if [ "${version%.*}" != "${released%.*}" ]; then
    compare
    sed -n 's/^\(Functions\|Variables\) changes summary: /       \1: /p' "$work/said"
    echo "ok     abi: $version may differ from the release $released"
    exit 0
fi
compare --no-added-syms --ignore-soname || {
    cat "$work/said"
    echo "FAILED abi: $version does not have the binary interface of the release $released: keep it, or change MINOR (docs/versions.md)"
    exit 1
}
compare --ignore-soname
sed -n "s/^ *\[A\] '\(.*\)' *{.*/       added: \1/p" "$work/said"
echo "ok     abi: $version has the binary interface of the release $released"
