#!/bin/sh
# Checks that budgets are charged in one place: tools/check-budgets.sh [ROOT]
#
# In the library, but for src/base, no line writes to the units that a budget has left (`budget->left`, the same of a part of a
# budget, or a pointer to it), for which cairn/status.h and src/base/step.h have functions, and none lowers the units charged for an
# operation (`units_charged`, or a name that ends so), which are set to 0 alone. None adds to the eighths used (`eighths_used`), which
# CAIRN_STEP_CHARGE_EIGHTHS() charges before the work, or keeps units that are due (`units_due`). None defines a macro RUN of its own,
# since CAIRN_STEP_RUN() waits for a phase. Comments are not looked at.
cd "${1:-.}" || exit 2
export LC_ALL=C
files=$(ls src/*/*.[ch] 2>/dev/null | grep -v '^src/base/')
[ -n "$files" ] || {
    echo "tools/check-budgets.sh: no files of the library in $PWD"
    exit 2
}
# shellcheck disable=SC2086
awk '
function refuse(text) { print FILENAME ":" FNR ": " text; bad = 1 }
{
    line = $0
    gsub(/\/\*.*\*\//, "", line)
    sub(/\/\*.*/, "", line)
    if (line ~ /^ *\* /) next # of a comment
    gsub(/[()* ]/, "", line)
}
line ~ /(budget|share|part)(->|\.)left(([-+\/%|&^]|<<|>>)?=([^=]|$)|--|[+][+])/ || line ~ /(--|[+][+])[a-z0-9_>.-]*(budget|share|part)(->|\.)left/ ||
    line ~ /(^|[^&])&[a-z0-9_>.-]*(budget|share|part)(->|\.)left([^a-z0-9_]|$)/ {
    refuse("writes to the units that are left of a budget, expected cairn_budget_charge(), take or spend")
}
line ~ /units_charged(-=|--|=-)/ || line ~ /--[a-z0-9_>.-]*units_charged/ {
    refuse("lowers the units charged for an operation, expected cairn_budget_charge(), or 0 at the begin")
}
line ~ /eighths_used([-+\/%|&^]|<<|>>)=|eighths_used(--|[+][+])/ || line ~ /(--|[+][+])[a-z0-9_>.-]*eighths_used/ {
    refuse("charges eighths after the work, expected CAIRN_STEP_CHARGE_EIGHTHS() before it")
}
line ~ /units_due([-+]?=[^=]|--|[+][+])/ || line ~ /(--|[+][+])[a-z0-9_>.-]*units_due/ {
    refuse("charges after the work, expected CAIRN_STEP_CHARGE() before it")
}
$1 == "#define" && $2 ~ /^([A-Z0-9_]*_)?RUN(_[A-Z0-9_]*)?\(/ {
    refuse("a macro that runs a phase, expected CAIRN_STEP_RUN()")
}
END {
    if (!bad) print "ok     budgets are charged by the functions of src/base"
    exit bad
}' $files
