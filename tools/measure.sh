#!/bin/sh
# Runs experiments and writes their results into the tables of a document:
#
#   tools/measure.sh NAME BUILD DATA [ITEM]...     tools/NAME.txt into docs/NAME.md (thesis, accuracy; its logs also into README.md)
#   tools/measure.sh NAME BUILD DATA --quick       only those marked quick; compares and writes nothing
#
# An experiment is a line of tools/NAME.txt: item | column | command | text [| quick]. {key} in the text is the value of that key in
# the last JSON line that the command prints, {key%} that of a share in percent. The text goes into the column of that name, in the
# row of that item. Items: only these. An experiment whose command fails leaves its cell as it was, and the exit status is 1.
usage='usage: tools/measure.sh NAME BUILD DATA [--quick | ITEM...]'
name=${1:?$usage}
build=${2:?$usage}
data=${3:?$usage}
shift 3
quick=
[ "$1" != --quick ] || { quick=1; shift; }
document=docs/$name.md
experiments=tools/$name.txt
out=$build/$name
mkdir -p "$out"
: >"$out/cells"

# filled TEXT LINE: the text with every {key} replaced from a line of JSON.
filled()
{
    printf '%s\n%s\n' "$1" "$2" | awk '
        NR == 1 { text = $0; next }
        {
            while (match(text, /\{[A-Za-z0-9_.]+%?\}/)) {
                key = substr(text, RSTART + 1, RLENGTH - 2)
                percent = sub(/%$/, "", key)
                if (!match($0, "\"" key "\": *(\"[^\"]*\"|[^,}]*)")) { print key > "/dev/stderr"; exit 1 }
                value = substr($0, RSTART, RLENGTH)
                sub(/^"[^"]*": */, "", value)
                gsub(/"/, "", value)
                if (percent && value ~ /^[0-9]/) value = sprintf("%.3g %%", 100 * value)
                else if (value ~ /^-?[0-9]*\.[0-9]+(e[-+]?[0-9]+)?$/) value = sprintf(value + 0 >= 1000 || value + 0 <= -1000 ? "%.0f" : "%.3g", value)
                sub("\\{" key "%?\\}", value, text)
            }
            print text
        }'
}

failed=0
for item in "$@"; do
    grep -q "^$item |" "$experiments" || {
        echo "$experiments has no item $item" >&2
        exit 2
    }
done
while IFS='|' read -r item column command text mark; do
    case $item in '' | '#'*) continue ;; esac
    item=$(echo $item) column=$(echo $column) text=$(echo $text) mark=$(echo $mark)
    [ -z "$quick" ] || [ "$mark" = quick ] || continue
    if [ $# -gt 0 ]; then
        case " $* " in *" $item "*) ;; *) continue ;; esac
    fi
    command=$(printf '%s\n' $command | sed "s|^@|$data|; s|^build/|$build/|" | tr '\n' ' ')
    echo "$item $column: $command"
    if $command </dev/null >"$out/printed" 2>"$out/errors" && line=$(grep '^{' "$out/printed" | tail -1) && [ -n "$line" ] &&
        cell=$(filled "$text" "$line"); then
        echo "    $cell"
        printf '%s|%s|%s\n' "$item" "$column" "$cell" >>"$out/cells"
    else
        echo "    FAILED: $(tail -1 "$out/errors")"
        failed=1
    fi
done <"$experiments"

# Cells into the rows of their items; the columns are found by the header of each table.
awk -F '|' -v OFS='|' -v document="$document" '
    NR == FNR { cell[$1, $2] = $3; wanted[$1, $2] = 1; next }
    /^\| *item *\|/ {
        split("", at)
        for (i = 2; i < NF; i++) { head = $i; gsub(/^ +| +$/, "", head); at[head] = i }
        width = NF
    }
    {
        item = $2
        gsub(/^ +| +$/, "", item)
        for (column in at)
            if ((item, column) in cell && NF == width) { $(at[column]) = " " cell[item, column] " "; delete wanted[item, column] }
        print
    }
    END { for (i in wanted) { split(i, part, SUBSEP); print "no row of " document " for " part[1] ", column " part[2] > "/dev/stderr"; bad = 1 } exit bad }
' "$out/cells" "$document" >"$out/$name.md" || failed=1
if [ -n "$quick" ]; then
    diff "$document" "$out/$name.md" || {
        echo "FAILED $document: not what the programs say (make $name writes it)"
        failed=1
    }
    [ $failed -ne 0 ] || echo "ok     $document: $(wc -l <"$out/cells") cells measured again, the same"
elif [ $failed -eq 0 ] || [ -s "$out/cells" ]; then
    [ ! -s "$out/$name.md" ] || cp "$out/$name.md" "$document"
    [ "$name" != accuracy ] || sh tools/document-figures.sh || failed=1
fi
exit $failed
