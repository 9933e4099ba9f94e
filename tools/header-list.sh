#!/bin/sh
# The list of the public headers, folder by folder in the order of the modules: tools/header-list.sh [--check]
#
# Writes include/cairn/README.md, or with --check says whether it is up to date. A header's text is the first sentence of its head.
export LC_ALL=C
list=include/cairn/README.md
made=$(mktemp)
trap 'rm -f "$made"' EXIT

# sentence HEADER: the first sentence of its head, without the name of the module
sentence()
{
    awk '
        { line = $0; sub(/^\/\* [a-z0-9_]+: /, "", line); sub(/^ \* ?/, "", line); ends = sub(/ *\*\/.*/, "", line) }
        line == "" { exit }
        { text = text (text == "" ? "" : " ") line }
        ends { exit }
        END { if (match(text, /\. [A-Z]/)) text = substr(text, 1, RSTART - 1); sub(/[.:]$/, "", text); print text }' "$1"
}

{
    echo '# Headers'
    echo
    echo 'In the order of the modules: a header includes only headers above it. Which module suits a task: [docs/choose.md](../../docs/choose.md); what a folder is for: [docs/architecture.md](../../docs/architecture.md).'
    echo 'Headers of `src/host` need the host library. Written by `tools/header-list.sh`.'
    echo
    echo '| source | header | |'
    echo '|---|---|---|'
    awk '!/^#/ && NF == 2 && $1 != "apart"' tools/modules.txt | while read -r folder module; do
        header=include/cairn/$module.h
        [ -f "$header" ] || continue
        shown=
        [ "$folder" = "$before" ] || shown="\`src/$folder\`"
        before=$folder
        echo "| $shown | [\`$module.h\`]($module.h) | $(sentence "$header") |"
    done
} >"$made"

if [ "$1" != --check ]; then
    cp "$made" "$list"
elif cmp -s "$made" "$list"; then
    echo "ok     list of the headers"
else
    diff "$list" "$made" | head -n 10
    echo "FAILED $list is not up to date (tools/header-list.sh writes it)"
    exit 1
fi
