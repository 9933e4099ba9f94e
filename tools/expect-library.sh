# Sourced by tests of checks that read libraries: expect(), with a folder $work of their own.
# The test defines compile "file.c" "file.o", check "folder of the objects and their lib.a", and
# $name, as messages call it. $failed is 1 after a failure; $said is what the check said last.
cc=${GCC:-gcc}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

# expect "what must be said with a failure" (or "" when the code must pass)
#     <code on standard input, files 1.c, 2.c ... divided by ---- lines>
expect()
{
    rm -rf "$work/o"
    mkdir "$work/o"
    awk -v folder="$work/o/" 'BEGIN { n = 1 } /^----$/ { n++; next } { print > (folder n ".c") }'
    for file in "$work"/o/*.c; do
        compile "$file" "$file.o" || failed=1
    done
    ar rcs "$work/o/lib.a" "$work"/o/*.o
    said=$(check "$work/o")
    status=$?
    if [ -z "$1" ] && [ $status -ne 0 ]; then
        echo "FAILED $name test: good code was refused: $said"
        failed=1
    elif [ -n "$1" ] && { [ $status -ne 1 ] || ! echo "$said" | grep -q "$1"; }; then
        echo "FAILED $name test: expected \"$1\" with a failure, got exit $status: $said"
        failed=1
    fi
}
