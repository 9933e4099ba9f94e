#!/bin/sh
# The table of logs in README.md, from the rows log/* of docs/accuracy.md: tools/readme-table.sh [--check]
#
# Writes the lines between the two marks of README.md anew; --check compares them, and the exit status is 1 when they differ.
new=$(mktemp)
trap 'rm -f "$new"' EXIT
awk -F ' *[|] *' '
    NR == FNR {
        if ($2 ~ /^log\//) { data[$2] = $3; cairn[$2] = $5; other[$2] = $7 }
        next
    }
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
        if (!ended || inside) {
            print "README.md: no marks of the figures, or one of them alone" > "/dev/stderr"
            exit 1
        }
    }' docs/accuracy.md README.md >"$new" || exit 1
if [ "$1" = --check ]; then
    diff README.md "$new" || {
        echo "README.md: its figures are not those of docs/accuracy.md (tools/readme-table.sh writes them)"
        exit 1
    }
    echo "ok     README: its figures are those of docs/accuracy.md"
else
    cat "$new" >README.md
fi
