#!/bin/sh
# Plants one-line faults in src/ and counts how many the tests find: tools/mutate.sh [N] [SEED] [FILE]...
#
# N faults (40) are drawn by SEED (1) over the lines of the FILEs (all of src/): signs, comparisons, indices, constants,
# x and y, and, or, not, min and max. Each is planted in a scratch copy; the double tests run, that of the same room
# first, until one fails, dies or takes ten times its usual time. Tests that fail without a fault (those of installed
# commands, say) are left out. Faults that do not compile or leave the object code as
# it was are drawn again. Equal arguments give equal faults. Exits with 1 when fewer than nine in ten are found: some
# faults change nothing that can be seen.
count=${1:-40}
seed=${2:-1}
[ $# -lt 1 ] || shift
[ $# -lt 1 ] || shift
export LC_ALL=C
unset MAKEFLAGS MFLAGS MAKELEVEL
[ $# -gt 0 ] || set -- $(ls src/core/*.c src/contour/*.c src/mapping/*.c src/host/*.c 2>/dev/null)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM

# Candidates, one a line: file, line, column, length, replacement (tabs between). Comments, strings, preprocessor lines
# and assertions are left alone. Their order is drawn by the seed: first a line, then a fault on it.
awk -v seed="$seed" '
function random(n) { state = (state * 16807) % 2147483647; return int(state / 2147483647 * n) }
# What is not code becomes spaces, so that columns stay.
function code_of(line,    out, i, c, end)
{
    out = ""
    for (i = 1; i <= length(line); i++) {
        c = substr(line, i, 1)
        if (comment) {
            out = out " "
            if (substr(line, i, 2) == "*/") { comment = 0; out = out " "; i++ }
        } else if (substr(line, i, 2) == "/*") { comment = 1; out = out "  "; i++ }
        else if (substr(line, i, 2) == "//") break
        else if (c == "\"" || c == "\047") {
            end = c
            out = out " "
            for (i++; i <= length(line) && substr(line, i, 1) != end; i++) {
                if (substr(line, i, 1) == "\\") { i++; out = out " " }
                out = out " "
            }
            out = out " "
        } else out = out c
    }
    return out
}
function candidate(column, length_, text)
{
    if (!found_on_line++) { lines++; first[lines] = candidates + 1 }
    fault[++candidates] = FILENAME "\t" FNR "\t" column "\t" length_ "\t" text
    last[lines] = candidates
}
# Every place of `from`, given literally.
function exchange(from, to,    at, start)
{
    start = 1
    while ((at = index(substr(code, start), from)) > 0) {
        candidate(start + at - 1, length(from), to)
        start += at - 1 + length(from)
    }
}
function both(a, b) { exchange(a, b); exchange(b, a) }
# Every match of a pattern; `how` says what becomes of it.
function each(pattern, how,    rest, base, at, text, after, digits, k, c, changed)
{
    rest = code
    base = 0
    while (match(rest, pattern)) {
        text = substr(rest, RSTART, RLENGTH)
        after = substr(rest, RSTART + RLENGTH, 1)
        at = base + RSTART
        if (how == "index") {
            k = substr(text, 2, length(text) - 2)
            candidate(at, RLENGTH, "[" k " + 1]")
            candidate(at, RLENGTH, "[" k " - 1]")
        } else if (how == "minus") # without the sign, the last but one
            candidate(at + RLENGTH - 2, 1, "")
        else if (how == "not")
            candidate(at, 1, "")
        else if (how == "member") {
            if (after !~ /[a-z_0-9(]/) candidate(at + RLENGTH - 1, 1, text ~ /x/ ? "y" : "x")
        } else if (how == "integer") {
            if (text !~ /^[0-9]/) { at++; k = substr(text, 2) } else k = text
            if (after !~ /[.a-zA-Z_]/ && !(declaration && text ~ /^\[/)) candidate(at, length(k), k + 1)
        } else if (how == "decimal") { # its third significant digit, or the last when there are fewer
            digits = changed = 0
            for (k = 1; k <= length(text) && digits < 3; k++) {
                c = substr(text, k, 1)
                if (c ~ /[eE]/) break
                if (c ~ /[1-9]/ || (digits && c == "0")) { digits++; changed = k }
            }
            if (changed) candidate(at + changed - 1, 1, (substr(text, changed, 1) + 1) % 10)
        }
        base += RSTART + RLENGTH - 1
        rest = substr(rest, RSTART + RLENGTH)
    }
}
BEGIN { state = seed * 2654435 % 2147483646 + 1; for (i = 0; i < 10; i++) random(2) }
FNR == 1 { comment = continued = 0 }
{
    code = code_of($0)
    found_on_line = 0
    if (continued || code ~ /^[ \t]*#/) { continued = code ~ /\\$/; next }
    if (code ~ /CAIRN_ASSERT/) next
    declaration = code ~ /^ *(static |const |unsigned )*(cairn_[a-z0-9_]+|int|u?int[0-9]+_t|size_t|char|float|double|struct [a-z_]+) [*a-z]/ || code ~ /^[a-z]/
    both(" + ", " - ")
    both(" += ", " -= ")
    both(" * ", " / ")
    both(" < ", " <= ")
    both(" > ", " >= ")
    both(" == ", " != ")
    both(" && ", " || ")
    both("++", "--")
    both("cairn_min(", "cairn_max(")
    both(" << ", " >> ")
    both(" & ", " | ")
    each("![a-zA-Z(]", "not")
    each("\\[[a-z_][a-z_0-9]*\\]", "index")
    each("(\\.|->)[xy]", "member")
    each("([=(,?:] |\\(|return )-[a-zA-Z(]", "minus")
    each("(^|[^a-zA-Z_0-9.])[0-9]+", "integer")
    each("[0-9]+(\\.[0-9]+([eE][-+]?[0-9]+)?|[eE][-+]?[0-9]+)", "decimal")
}
END {
    # A draw without return over the lines.
    for (n = lines; n > 0; n--) {
        k = 1 + random(n)
        print fault[first[k] + random(last[k] - first[k] + 1)]
        first[k] = first[n]
        last[k] = last[n]
    }
}' "$@" >"$work/candidates"

# Two workers, each in a copy of its own. The tests stand on one shared library, so that a fault costs one object and one
# link.
sources=$(ls src/core/*.c src/contour/*.c src/mapping/*.c src/host/*.c sim/*.cpp 2>/dev/null)
tests=$(ls tests/test_*.c | sed 's|.*/||; s|\.c$||')
[ -f /usr/include/box2d/box2d.h ] || [ -f /usr/local/include/box2d/box2d.h ] || sources=$(echo "$sources" | grep -v '^sim/')
system_libs="-lcmocka -lyaml -lpng -lz -lpthread -lm"
case $sources in *sim/*) system_libs="-lbox2d $system_libs" ;; esac

objects() # of the files given, in BUILD=m
{
    for source in "$@"; do
        echo "m/double/$source.o"
    done
}
# shellcheck disable=SC2086
library() # in a worker's tree
{
    c++ -shared -o m/libfaulty.so $(objects $sources) $system_libs
}
mutate_make()
{
    make -s BUILD=m OPT=-O1 CFLAGS='-g0 -w' ASSERTIONS=1 "$@"
}

mkdir "$work/1"
for entry in *; do
    [ "$entry" = build ] || cp -r "$entry" "$work/1/"
done
(
    cd "$work/1" || exit 2
    # shellcheck disable=SC2046,SC2086
    mutate_make -j2 $(objects $sources tests/support.c) $(for t in $tests; do objects "tests/$t.c"; done) && library || exit 2
    mkdir m/tests
    for t in $tests; do
        # shellcheck disable=SC2086
        c++ -o "m/tests/$t" "m/double/tests/$t.c.o" m/double/tests/support.c.o -Lm -lfaulty $system_libs || exit 2
        start=$(date +%s%N)
        LD_LIBRARY_PATH=m "m/tests/$t" >m/log 2>&1 || {
            echo "left out: $t, which fails without a fault" >&2
            continue
        }
        echo "$t $((($(date +%s%N) - start) / 100000000 + 5))" # ten times its time, and five seconds
    done >m/times
    cat m/times >"$work/times"
) || {
    echo "tools/mutate.sh: the tests must build and pass first" >&2
    exit 2
}
cp -r "$work/1" "$work/2"

# try WORKER CANDIDATE: writes "skip", "found <by>" or "missed" and the changed line to the worker's file `result`.
try()
{
    cd "$work/$1" || exit 2
    tab=$(printf '\t')
    IFS=$tab read -r file line column length text <<END
$2
END
    cp "$file" m/original.c
    cp "m/double/$file.o" m/original.o
    awk -v line="$line" -v column="$column" -v length_="$length" -v text="$text" '
        NR == line { $0 = substr($0, 1, column - 1) text substr($0, column + length_) } { print }' m/original.c >"$file"
    verdict=skip
    if mutate_make "m/double/$file.o" >/dev/null 2>&1 && ! cmp -s "m/double/$file.o" m/original.o &&
        library 2>/dev/null; then
        verdict=missed
        room=test_$(basename "$file" .c)
        until [ -f "tests/$room.c" ] || [ "${room%_*}" = test ]; do # of a part: its room
            room=${room%_*}
        done
        # shellcheck disable=SC2013
        for t in $(awk -v room="$room" '$1 == room' m/times | cut -d ' ' -f 1) $(awk -v room="$room" '$1 != room { print $1 }' m/times); do
            limit=$(awk -v t="$t" '$1 == t { print $2 }' m/times)
            LD_LIBRARY_PATH=m timeout -k 1 "$limit" "m/tests/$t" >m/log 2>&1 || {
                verdict="found by $t"
                break
            }
        done
    fi
    {
        echo "$verdict"
        echo "$file:$line"
        sed -n "${line}s/^ */    - /p" m/original.c
        sed -n "${line}s/^ */    + /p" "$file"
    } >result
    cp m/original.c "$file"
    cp m/original.o "m/double/$file.o"
}

found=0 skipped=0 total=0
exec 3<"$work/candidates"
more=1
while [ $total -lt "$count" ] && [ $more -eq 1 ]; do
    for worker in 1 2; do
        rm -f "$work/$worker/result"
        if IFS= read -r fault <&3; then
            (try $worker "$fault") 3<&- &
        else
            more=0
        fi
    done
    wait
    for worker in 1 2; do
        [ -f "$work/$worker/result" ] && [ $total -lt "$count" ] || continue
        verdict=$(head -1 "$work/$worker/result")
        if [ "$verdict" = skip ]; then
            skipped=$((skipped + 1))
            continue
        fi
        total=$((total + 1))
        [ "$verdict" = missed ] || found=$((found + 1))
        awk 'NR == 1 { verdict = $0 } NR == 2 { print $0 ": " verdict } NR > 2' "$work/$worker/result"
    done
done
echo "found $found of $total (seed $seed; $skipped more did not compile or changed nothing)"
[ $((found * 10)) -ge $((total * 9)) ]
