#!/bin/sh
# Test of tools/check-abi.sh: it must refuse what breaks a program that is linked with the last release, and nothing else.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
mkdir "$work/include"

# build HEADER SOURCE [STATE]: the library of a header and a source, with the fields of its opaque state
build()
{
    printf '%s\n' "$1" >"$work/include/thing.h"
    printf '%s\n' '#include "thing.h"' "struct state { ${3:-int hidden;} };" "$2" >"$work/thing.c"
    gcc -g -shared -fPIC -I"$work/include" "$work/thing.c" -o "$work/libcairn.so"
}

# expect STATUS WHAT PATTERN VERSION: the library, compared with release 1.2.0
expect()
{
    said=$(sh tools/check-abi.sh "$work/libcairn.so" "$4" "$work/libcairn-1.2.0.abi.gz" "$work/include" 2>&1)
    if [ $? -ne "$1" ] || ! echo "$said" | grep -q "$3"; then
        echo "FAILED tools/check-abi.sh: $2: expected status $1 and '$3', it said"
        echo "$said"
        failed=1
    fi
}

params='typedef struct params { int count; double width; } params;'
calls='struct state; params defaults(void); int run(struct state *state, const params *given);'
defaults='params defaults(void) { params p = {1, 2}; return p; }'
run='int run(struct state *state, const params *given) { return state->hidden + given->count; }'

build "$params $calls" "$defaults $run"
sh tools/abi.sh "$work/libcairn.so" "$work/include" >"$work/libcairn-1.2.0.abi.gz"
expect 0 "the same library" "has the binary interface" 1.2.0
build "$params $calls" "$defaults $run" 'double before; int hidden;'
expect 0 "another opaque state" "has the binary interface" 1.2.1
build "$params $calls int more(int);" "$defaults $run int more(int a) { return a; }"
expect 0 "an added function" "added: .*more" 1.2.1
build "$params params defaults(void);" "$defaults"
expect 1 "a removed function" "FAILED abi: 1.2.1 does not" 1.2.1
expect 0 "a removed function in the next minor version" "1 Removed" 1.3.0
expect 0 "a removed function in the next major version" "may differ" 2.2.0
build "$(echo "$params" | sed 's/int count/long count/') $calls" "$defaults $run"
expect 1 "a field of another type" "FAILED abi" 1.2.1
build "$(echo "$params" | sed 's/double width/double width; int more/') $calls" "$defaults $run"
expect 1 "an added field" "FAILED abi" 1.2.1
build "$(echo "$params" | sed 's/int count; double width/double width; int count/') $calls" "$defaults $run"
expect 1 "fields in another order" "FAILED abi" 1.2.1
build "$params $(echo "$calls" | sed 's/const params \*given/params given/')" \
    "$defaults $(echo "$run" | sed 's/const params \*given/params given/; s/given->/given./')"
expect 1 "another parameter" "FAILED abi" 1.2.1
echo "no library" >"$work/libcairn.so"
expect 1 "no library" "FAILED abi: abidw cannot" 1.2.0
[ $failed -eq 0 ] && echo "ok     tools/check-abi.sh refuses what it should and allows the rest"
exit $failed
