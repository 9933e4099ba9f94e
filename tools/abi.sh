#!/bin/sh
# The binary interface of a shared library, as public headers show it: tools/abi.sh LIBRARY [HEADERS] >RECORD.gz
#
# Written by abidw of libabigail: exported functions, and the layout of every type that the headers in HEADERS (include) define;
# what they only declare stays closed. Same library, same bytes. The library needs debug information (-g).
set -e
library=${1:?usage: tools/abi.sh LIBRARY [HEADERS] >RECORD.gz}
record=$(mktemp)
trap 'rm -f "$record"' EXIT
abidw --headers-dir "${2:-include}" --drop-private-types --drop-undefined-syms --exported-interfaces-only --no-show-locs \
    --no-corpus-path --no-comp-dir-path --no-parameter-names --no-elf-needed "$library" >"$record"
gzip -n -9 -c "$record"
