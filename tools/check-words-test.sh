#!/bin/sh
# Tests that the check of words finds private words and honours exceptions: tools/check-words-test.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
mkdir -p "$work/tools" "$work/src/base" "$work/docs"

list='key scans? | keyframe
twins? | reference implementation
at hand | current
allow twin engines? | src/base/[a-z]+\.c | ordinary English'

# expect LIST TEXT MESSAGE: what the check must print of src/base/part.c with TEXT, or "" when it must pass
expect()
{
    printf '%s\n' "$1" >"$work/tools/words.txt"
    printf '%s\n' "$2" >"$work/src/base/part.c"
    said=$(sh tools/check-words.sh -C "$work")
    status=$?
    if [ -z "$3" ] && [ $status -ne 0 ]; then
        echo "FAILED word test: \"$2\" was rejected: $said"
        failed=1
    elif [ -n "$3" ] && { [ $status -ne 1 ] || ! echo "$said" | grep -qF "$3"; }; then
        echo "FAILED word test: expected \"$3\" with exit 1, got exit $status: $said"
        failed=1
    fi
}

used='/* The twin engine. */'
expect "$list" "$used" ""
expect "$list" "$used
/* Monkey scan, twinned. */" ""
expect "$list" "$used
/* The Key-scan. */" 'src/base/part.c:2: "key scan": expected keyframe'
expect "$list" "$used
int32_t key_scans;" 'src/base/part.c:2: "key_scans": expected keyframe'
expect "$list" "$used
static int slow_twin(void);" 'src/base/part.c:2: "twin": expected reference implementation'
expect "$list" "$used
/* The scan at
 * hand. */" 'src/base/part.c:3: "at hand": expected current'
expect "$list" "$used
/* The twin engine has a twin. */" 'src/base/part.c:2: "twin": expected reference implementation'
expect "$list" "" 'tools/words.txt:4: the exception has no words in any file'
expect "$list
twins" "$used" 'tools/words.txt:5: expected: PATTERN | term'
expect "$list
allow twin | src/.*" "$used" 'tools/words.txt:5: expected: allow PATTERN | FILE | reason'

# Each word is reported once, an exception holds in its files only, and documents that quote old names are not read.
printf '%s\n' "$list" >"$work/tools/words.txt"
printf '%s\n' "$used" >"$work/src/base/part.c"
printf 'A twin.\nMore.\n' >"$work/docs/part.md"
printf 'A twin.\n' >"$work/docs/renamed.md"
[ "$(sh tools/check-words.sh -C "$work")" = 'docs/part.md:1: "twin": expected reference implementation' ] || {
    echo "FAILED word test: a document"
    failed=1
}
printf 'A twin engine.\n' >"$work/docs/part.md"
sh tools/check-words.sh -C "$work" docs/part.md | grep -q '"twin"' || {
    echo "FAILED word test: the exception of other files was taken"
    failed=1
}
printf 'Nothing.\n' >"$work/docs/part.md"
for file in python/package/part.py packaging/part.json zephyr/Kconfig tools/part.awk docs/part.ipynb package.json; do
    mkdir -p "$(dirname "$work/$file")"
    printf 'a twin\n' >"$work/$file"
    sh tools/check-words.sh -C "$work" | grep -qF "$file:1: \"twin\"" || {
        echo "FAILED word test: $file is not read"
        failed=1
    }
    rm "$work/$file"
done
[ $failed -eq 0 ] && echo "ok     the check of words finds private words and honours exceptions"
exit $failed
