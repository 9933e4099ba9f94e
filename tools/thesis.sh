#!/bin/sh
# Runs the experiments of the thesis and writes their results into docs/thesis.md: tools/thesis.sh BUILD DATA [ITEM]...
#
# An experiment is a line of tools/thesis.txt: item | column | command | text. {key} in the text is the value of that key in the
# last JSON line that the command prints. The text goes into the column of the row of that item. Items: only these.
# An experiment whose command fails leaves its cell as it was, and the exit status is 1.
build=${1:?usage: tools/thesis.sh BUILD DATA [ITEM]...}
data=${2:?usage: tools/thesis.sh BUILD DATA [ITEM]...}
shift 2
document=docs/thesis.md
out=$build/thesis
mkdir -p "$out"
: >"$out/cells"

# filled TEXT LINE: the text with every {key} replaced from a line of JSON.
filled()
{
    printf '%s\n%s\n' "$1" "$2" | awk '
        NR == 1 { text = $0; next }
        {
            while (match(text, /\{[A-Za-z0-9_.]+\}/)) {
                key = substr(text, RSTART + 1, RLENGTH - 2)
                if (!match($0, "\"" key "\": *(\"[^\"]*\"|[^,}]*)")) { print key > "/dev/stderr"; exit 1 }
                value = substr($0, RSTART, RLENGTH)
                sub(/^"[^"]*": */, "", value)
                gsub(/"/, "", value)
                if (value ~ /^-?[0-9]*\.[0-9]+(e[-+]?[0-9]+)?$/) value = sprintf(value + 0 >= 1000 || value + 0 <= -1000 ? "%.0f" : "%.3g", value)
                sub("\\{" key "\\}", value, text)
            }
            print text
        }'
}

failed=0
for item in "$@"; do
    grep -q "^$item |" tools/thesis.txt || {
        echo "tools/thesis.txt has no item $item" >&2
        exit 2
    }
done
while IFS='|' read -r item column command text; do
    case $item in '' | '#'*) continue ;; esac
    item=$(echo $item) column=$(echo $column) text=$(echo $text)
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
done <tools/thesis.txt

awk -F '|' -v OFS='|' '
    NR == FNR { cell[$1, $2] = $3; wanted[$1, $2] = 1; next }
    {
        item = $2
        gsub(/^ +| +$/, "", item)
        if ((item, "as_written") in cell && NF == 10) { $8 = " " cell[item, "as_written"] " "; delete wanted[item, "as_written"] }
        if ((item, "default") in cell && NF == 10) { $9 = " " cell[item, "default"] " "; delete wanted[item, "default"] }
        print
    }
    END { for (i in wanted) { split(i, part, SUBSEP); print "no row of docs/thesis.md for " part[1] > "/dev/stderr"; bad = 1 } exit bad }
' "$out/cells" "$document" >"$out/thesis.md" && cp "$out/thesis.md" "$document" || failed=1
exit $failed
