#!/bin/sh
# Compares docs/thesis.md with the code: tools/check-thesis.sh BUILD [DOCUMENT] [EXPERIMENTS]
#
# Every function that it names (cairn_...()) is declared in a header; every command in backticks and every experiment is accepted
# by the parser of its program's options; every row has eight cells, a state that the document explains, and an item of its own;
# every experiment has its row, and its cell there is not empty.
build=${1:?usage: tools/check-thesis.sh BUILD [DOCUMENT] [EXPERIMENTS]}
document=${2:-docs/thesis.md}
experiments=${3:-tools/thesis.txt}
failed=0

refuse()
{
    echo "$1"
    failed=1
}

for name in $(grep -o 'cairn_[a-z0-9_]*()' "$document" | sed 's/()//' | sort -u); do
    grep -qw "$name(" include/cairn/*.h || grep -qE "\\b$name\\(" include/cairn/*.h || refuse "$document: no function $name() in include/cairn"
done

# The command, from the folder of the build, with --help appended: all arguments before it are parsed first.
accepted()
{
    words=$(printf '%s\n' "$1" | sed "s|^build/|$build/|; s|^bench/|$build/bench/|; s|^cairn|$build/cairn|")
    # shellcheck disable=SC2086
    said=$($words --help 2>&1 >/dev/null </dev/null) || refuse "$2: \`$1\`: $(echo "$said" | tail -1)"
}

grep -oE '`((build/)?bench/[a-z]+|(build/)?cairn(-arena)?) [^`]*`|`(build/)?bench/[a-z]+`' "$document" | tr -d '`' | sort -u >"$build/thesis-commands"
while read -r command; do
    accepted "$command" "$document"
done <"$build/thesis-commands"
grep -v '^#\|^$' "$experiments" >"$build/thesis-experiments"
while IFS='|' read -r item column command _; do
    item=$(echo $item) column=$(echo $column)
    grep -q "^| $item |" "$document" || refuse "$experiments: $item has no row in $document"
    case $column in as_written | default) ;; *) refuse "$experiments: $item: column '$column', expected as_written or default" ;; esac
    awk -F '|' -v item="$item" -v cell="$([ "$column" = default ] && echo 9 || echo 8)" '
        $2 == " " item " " && $cell ~ /^ *$/ { empty = 1 }
        END { exit empty }' "$document" || refuse "$document: $item: column $column is empty, expected what \`$(echo $command)\` gives (make thesis)"
    accepted "$(echo $command)" "$experiments"
done <"$build/thesis-experiments"

awk -F '|' -v document="$document" '
    function refuse(text) { print document ":" FNR ": " text; bad = 1 }
    /^\| [0-9A]+\// {
        rows++
        item = $2
        state = $5
        if (NF != 10) refuse("a row of " NF - 2 " cells, expected 8")
        if (seen[item]++) refuse("item" item "stands twice")
        if (state !~ /^ (as written|deviates|left out|not possible)/) refuse("state" state "is none of those that stand above")
        if (state ~ /^ (deviates|left out|not possible)/ && state !~ /:/) refuse("state" state "does not say how or why")
    }
    END { if (!rows) refuse("no rows"); exit bad }' "$document" || failed=1
[ $failed -ne 0 ] || echo "ok     docs/thesis.md: $(grep -c '^| [0-9A]*/' "$document") items, $(wc -l <"$build/thesis-commands") commands, $(wc -l <"$build/thesis-experiments") experiments"
exit $failed
