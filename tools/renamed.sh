#!/bin/sh
# The public names that differ between two sets of headers, as a document: tools/renamed.sh OLD NEW >docs/renamed.md
#
# OLD and NEW are source trees. Without comments and layout the headers of both are nearly the same sequence of words; words that
# differ between the same neighbours are a renaming (longest common subsequence, by diff). Fields are listed with their struct.
set -e
old=${1:?usage: tools/renamed.sh OLD NEW}
new=${2:?usage: tools/renamed.sh OLD NEW}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# words TREE: the words of all headers, one a line, in the order of the modules, each header behind a line "@header NAME"
words()
{
    list=$1/tools/modules.txt
    [ -f "$list" ] || list=$1/tools/rooms.txt
    awk '!/^#/ && NF == 2 { print $2 }' "$list" | while read -r module; do
        [ -f "$1/include/cairn/$module.h" ] || continue
        echo "@header"
        echo "$module.h"
        sed '/^#ifdef __cplusplus/,/^#endif/d; s|/\*|\n&|g; s|\*/|&\n|g' "$1/include/cairn/$module.h" | awk '
            /^\/\*/ { inside = 1 }
            !inside { print }
            /\*\/$/ { inside = 0 }' | grep -v '^ *#\(include\|if\|else\|endif\|undef\)' | grep -oE '[A-Za-z_][A-Za-z0-9_]*|[^A-Za-z_ \t]'
    done
}

words "$old" >"$work/old"
words "$new" >"$work/new"
cat <<'EOF'
# Renamed

Public names of version 0.1 and of 0.2, in the order of the headers; made by `tools/renamed.sh OLD NEW` from both sets of headers. Everything else kept its name; nothing changed its meaning or its place in a
struct unless [CHANGELOG.md](../CHANGELOG.md) says so. Names changed after 0.2: [CHANGELOG.md](../CHANGELOG.md).

| 0.1 | 0.2 |
|---|---|
EOF
diff --old-line-format='-%L' --new-line-format='+%L' --unchanged-line-format=' %L' "$work/old" "$work/new" >"$work/both" || true
awk '
    function pair(before, after,    key) {
        if (before == after || before !~ /^[A-Za-z_]/ || after !~ /^[A-Za-z_]/ || before ~ /_H$/) return
        if (before ~ /\.h$/) key = "`cairn/" before "` | `cairn/" after "`"
        else if (before ~ /^cairn_|^CAIRN_/) { was[after] = before; key = "`" before "` | `" after "`" }
        else if (record != "" && depth > 0) key = "`" formerly(record) "." before "` | `" record "." after "`"
        else return
        if (!seen[key]++) print "| " key " |"
    }
    function formerly(name) { return name in was ? was[name] : name }
    function flush(    i) {
        if (removed == added) for (i = 1; i <= removed; i++) pair(minus[i], plus[i])
        for (i = 1; i <= added; i++) follow(plus[i])
        removed = added = 0
    }
    function follow(word) {
        if (last == "struct" && word ~ /^cairn_/) candidate = word
        if (word == "{" && depth++ == 0) record = last == candidate ? candidate : ""
        if (word == "}" && --depth == 0) record = ""
        last = word
    }
    /^-/ { minus[++removed] = substr($0, 2); next }
    /^\+/ { plus[++added] = substr($0, 2); next }
    { flush(); follow(substr($0, 2)) }
    END { flush() }' "$work/both"
