#!/bin/sh
# Line and branch coverage of src/ by the tests, double and float together: tools/coverage.sh BUILD
#
# BUILD was built with COVERAGE=1 and its tests have run. Writes BUILD/coverage.info, and HTML when genhtml is installed.
set -e
build=${1:?usage: tools/coverage.sh BUILD}
info=$build/coverage.info
lcov --quiet --rc lcov_branch_coverage=1 --capture --base-directory . --no-external \
    --directory "$build/double/src" --directory "$build/float/src" --output-file "$info.all" 2>"$build/lcov.log" || {
    cat "$build/lcov.log" >&2
    exit 1
}
lcov --quiet --rc lcov_branch_coverage=1 --extract "$info.all" "$PWD/src/*" "$PWD/include/cairn/*" --output-file "$info"
rm "$info.all"

awk -F: -v here="$PWD/" '
function percent(hit, found) { return found ? sprintf("%6.1f %%", 100 * hit / found) : "     - " }
function row(name, lh, lf, bh, bf) { printf "%-40s %s %6d of %-6d %s %6d of %d\n", name, percent(lh, lf), lh, lf, percent(bh, bf), bh, bf }
BEGIN { printf "%-40s %-24s %s\n", "", "lines", "branches" }
$1 == "SF" { name = $2; sub(here, "", name); lf = lh = bf = bh = 0 }
$1 == "LF" { lf = $2 }
$1 == "LH" { lh = $2 }
$1 == "BRF" { bf = $2 }
$1 == "BRH" { bh = $2 }
$1 == "end_of_record" {
    row(name, lh, lf, bh, bf)
    lines += lf; hit += lh; branches += bf; taken += bh
}
END { row("all", hit, lines, taken, branches) }' "$info"

if command -v genhtml >/dev/null 2>&1; then
    genhtml --quiet --branch-coverage --output-directory "$build/html" "$info"
    echo "$build/html/index.html"
fi
