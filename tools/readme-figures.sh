#!/bin/sh
# The measured figures of README.md, from those of docs: tools/readme-figures.sh [--check]
#
# The table of logs between two marks from the rows log/* of docs/accuracy.md, and code sizes from docs/memory-and-time.md. Writes them;
# --check compares them, and the exit status is 1 when they differ.
new=$(mktemp)
trap 'rm -f "$new"' EXIT
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
    }' docs/accuracy.md docs/memory-and-time.md README.md >"$new" || exit 1
if [ "$1" = --check ]; then
    diff README.md "$new" || {
        echo "README.md: its figures are not those of docs/accuracy.md and docs/memory-and-time.md (tools/readme-figures.sh writes them)"
        exit 1
    }
    echo "ok     README: its figures are those of docs/accuracy.md and docs/memory-and-time.md"
else
    cat "$new" >README.md
fi
