#!/bin/sh
# The measured figures of README.md and docs/embedding.md, from those of docs: tools/document-figures.sh [--check]
#
# README.md: the table of logs between two marks from the rows log/* of docs/accuracy.md, and code sizes from docs/memory-and-time.md.
# docs/embedding.md: sizes of the programs of one module from docs/memory-and-time.md, their limits from tools/amalgamate-test.sh. Writes
# them; --check compares them, and the exit status is 1 when they differ.
new=$(mktemp -d)
trap 'rm -rf "$new"' EXIT
awk -F ' *[|] *' '
    FILENAME == "docs/accuracy.md" {
        if ($2 ~ /^log\//) { data[$2] = $3; cairn[$2] = $5; other[$2] = $7 }
        next
    }
    FILENAME == "docs/memory-and-time.md" {
        if ($2 == "icp alone" || $2 == "mapper alone" || ($2 == "apartment" && !($2 in code))) code[$2] = sprintf("%.0f KB", $3 / 1024)
        next
    }
    sub(/take [0-9]+ KB in a program of `icp` alone, [0-9]+ KB in one of the mapper, and [0-9]+ KB in a robot program/,
        "take " code["icp alone"] " in a program of `icp` alone, " code["mapper alone"] " in one of the mapper, and " code["apartment"] " in a robot program") { sizes++ }
    /^<!-- end of the figures/ {
        inside = 0
        print "| log | cairn, with odometry | Cartographer, with odometry | cairn, 250 keyframes | cairn, ranges only |"
        print "|---|---|---|---|---|"
        logs = split("log/intel log/fr079 log/aces", log_, " ")
        for (k = 1; k <= logs; k++) {
            item = log_[k]
            if (cairn[item] == "" || cairn[item "-culled"] == "" || cairn[item "-ranges"] == "") {
                print "docs/accuracy.md: no row " item ", " item "-culled or " item "-ranges" > "/dev/stderr"
                exit 1
            }
            print "| " data[item] " | " cairn[item] " | " other[item] " | " cairn[item "-culled"] " | " cairn[item "-ranges"] " |"
        }
        ended = 1
    }
    !inside { print }
    /^<!-- figures of docs\/accuracy.md/ { inside = 1 }
    END {
        if (!ended || inside || sizes != 1) {
            print "README.md: no marks of the figures, one of them alone, or no sentence of the code sizes" > "/dev/stderr"
            exit 1
        }
    }' docs/accuracy.md docs/memory-and-time.md README.md >"$new/README.md" || exit 1

# grouped(12584): 12,584
awk -F ' *[|] *' '
    function grouped(number)
    {
        while (match(number, /[0-9][0-9][0-9][0-9](,|$)/))
            number = substr(number, 1, RSTART) "," substr(number, RSTART + 1)
        return number
    }
    function kilobytes(bytes) { return sprintf("%.0f KB", bytes / 1024) }
    FILENAME == "docs/memory-and-time.md" {
        if ($2 ~ /^(icp|mapper) alone/) bytes[$2] = $3
        next
    }
    FILENAME == "tools/amalgamate-test.sh" {
        if (sub(/^ *fits /, "")) {
            split($0, word, " ")
            limit[word[1]] = word[2]
        }
        next
    }
    sub(/[0-9]+ KB in a program of `icp`, [0-9]+ KB in one of `mapper`/,
        kilobytes(bytes["icp alone"]) " in a program of `icp`, " kilobytes(bytes["mapper alone"]) " in one of `mapper`") { sizes++ }
    sub(/takes [0-9,]+ and [0-9,]+ bytes, of which `make check` accepts at most [0-9,]+ and [0-9,]+ \([0-9]+ KB\)/,
        "takes " grouped(bytes["icp alone, whole image"]) " and " grouped(bytes["mapper alone, whole image"]) \
        " bytes, of which `make check` accepts at most " grouped(limit["icp"]) " and " grouped(limit["mapper"]) " (" kilobytes(limit["mapper"]) ")") { images++ }
    { print }
    END {
        if (sizes != 1 || images != 1) {
            print "docs/embedding.md: no sentence of the code sizes, or none of the whole images" > "/dev/stderr"
            exit 1
        }
    }' docs/memory-and-time.md tools/amalgamate-test.sh docs/embedding.md >"$new/embedding.md" || exit 1

differ=0
for document in README.md docs/embedding.md; do
    if [ "$1" != --check ]; then
        cat "$new/$(basename $document)" >$document
    elif ! diff $document "$new/$(basename $document)"; then
        echo "$document: its figures are not those that were measured (tools/document-figures.sh writes them)"
        differ=1
    fi
done
[ "$1" != --check ] || [ $differ -ne 0 ] || echo "ok     figures of README.md and docs/embedding.md: those that were measured"
exit $differ
