#!/bin/sh
# Bounds the stack from gcc's call graphs: tools/check-stack.sh [--all] DIRECTORY
#
# With --all prints a row of a table for every public function, and rejections on standard error.
# DIRECTORY holds the *.ci files of objects compiled by gcc with -fstack-usage -fcallgraph-info=su. Refused are recursion
# and stack whose size is only known at run time. The functions of libc count as 0 and calls through pointers are listed:
# the stack of the called function is added. Prints the public functions with the largest stack.
all=
[ "$1" != --all ] || {
    all=1
    shift
}
[ $# -eq 1 ] || {
    echo "usage: tools/check-stack.sh [--all] DIRECTORY" >&2
    exit 2
}
find "$1" -name '*.ci' | LC_ALL=C sort | xargs cat /dev/null | awk -v directory="$1" -v all="$all" '
function quoted(text, key) # the string after key: "..."
{
    if (!match(text, key ": \"[^\"]*\"")) return ""
    return substr(text, RSTART + length(key) + 3, RLENGTH - length(key) - 4)
}
function display(title) { sub(/^.*:/, "", title); return title }

# Deepest stack below and including function f. Colours: 1 on the path, 2 done.
function worst(f,    i, n, target, deepest, below)
{
    if (colour[f] == 2) return depth[f]
    colour[f] = 1
    path[++path_length] = f
    n = callees[f]
    for (i = 1; i <= n; i++) {
        target = callee[f, i]
        if (target == "__indirect_call") { calls_back[f] = 1; continue }
        if (colour[target] == 1) {
            if (!((f, target) in reported)) {
                reported[f, target] = 1
                print directory ": recursion: " display(f) " calls " (f == target ? "itself" : display(target) ", which leads back to it")
                bad = 1
            }
            continue
        }
        below = worst(target)
        if (calls_back[target]) calls_back[f] = 1
        if (below > deepest) { deepest = below; next_down[f] = target }
    }
    path_length--
    colour[f] = 2
    depth[f] = own[f] + deepest
    return depth[f]
}
/^node:/ {
    title = quoted($0, "title")
    label = quoted($0, "label")
    if (match(label, /[0-9]+ bytes \([a-z,]+\)/)) {
        usage = substr(label, RSTART, RLENGTH)
        own[title] = usage + 0
        if (usage ~ /dynamic/ && usage !~ /bounded/) {
            print directory ": unbounded stack: " display(title)
            bad = 1
        }
        if (!(title in known)) { known[title] = 1; node[++nodes] = title }
    }
}
/^edge:/ {
    from = quoted($0, "sourcename")
    to = quoted($0, "targetname")
    # Calls within a file, built with -fPIC, go to a local alias of a global function.
    if (sub(/\.localalias(\.[0-9]+)?$/, "", to)) sub(/^.*:/, "", to)
    if (!((from, to) in edge)) { edge[from, to] = 1; callee[from, ++callees[from]] = to }
}
END {
    for (i = 1; i <= nodes; i++) worst(node[i])
    if (!nodes) { print directory ": no call graphs"; exit 2 }
    for (pair in edge) {
        split(pair, ends, SUBSEP)
        if (!(ends[2] in known) && ends[2] ~ /(^|:)cairn_|:/) {
            print directory ": " ends[2] " is called but its stack is not known"
            bad = 1
        }
    }
    for (i = 1; i <= nodes; i++)
        if (node[i] ~ /^cairn_/) public[++publics] = node[i]
    if (all) {
        for (k = 1; k <= publics; k++) print "| " public[k] " | " depth[public[k]] (calls_back[public[k]] ? " and its callback" : "") " |" | "sort"
        close("sort")
        exit bad
    }
    # The ten largest, by selection.
    for (k = 1; k <= 10 && k <= publics; k++) {
        for (i = k + 1; i <= publics; i++)
            if (depth[public[i]] > depth[public[k]]) { swap = public[i]; public[i] = public[k]; public[k] = swap }
        line = public[k]
        for (f = next_down[public[k]]; f != ""; f = next_down[f]) line = line " > " display(f)
        printf "%6d bytes  %s\n", depth[public[k]], line
    }
    for (i = 1; i <= nodes; i++)
        if (calls_back[node[i]] && node[i] ~ /^cairn_/) back = back " " node[i]
    if (back != "") print "calls back (the callback comes on top):" back
    if (!bad) print "ok     stack: " directory ", " nodes " functions, no recursion, all bounded"
    exit bad
}'
