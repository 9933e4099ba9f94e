#!/bin/sh
# Writes the scans of a CARMEN log as C for a mission: firmware/record.sh LOG >NAME_scans.h
#
# Reads ROBOTLASER1; a beam that met nothing becomes INFINITY; the pose is that of the scanner.
awk '
BEGIN { scans = 0; print "/* Written by firmware/record.sh. */\n#include <math.h>\n#include \"firmware/mission.h\"" }
$1 == "ROBOTLASER1" {
    n = $9
    if (NF < 9 + n + 4) { print FILENAME ":" NR ": too few fields for " n " beams" >"/dev/stderr"; exit 1 }
    printf "static const float range_%d[%d] = {", scans, n
    for (i = 1; i <= n; i++) {
        r = $(9 + i)
        text = r + 0 >= $6 + 0 ? "INFINITY" : (r ~ /[.e]/ ? r "f" : r ".0f")
        printf "%s%s", text, (i == n ? "};\n" : i % 12 == 0 ? ",\n    " : ", ")
    }
    at = 9 + n + 1 + $(9 + n + 1)
    record[scans] = sprintf("    {range_%d, %d, %sf, %sf, {%s, %s, %s}},", scans, n, real($3), real($5),
                              constant($(at + 1)), constant($(at + 2)), constant($(at + 3)))
    scans++
}
function real(x) { return x ~ /[.e]/ ? x : x ".0" }
function constant(x) { return "CAIRN_REAL(" real(x) ")" }
END {
    if (scans == 0) exit 1
    print "static const robot_sweep recorded[] = {"
    for (i = 0; i < scans; i++) print record[i]
    print "};"
}' "$1"
