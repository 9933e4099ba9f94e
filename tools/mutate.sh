#!/bin/sh
# Mutation testing: inserts one-line faults into src/ and counts those that the tests detect: tools/mutate.sh [N] [SEED] [FILE]...
#
# N faults (40) are drawn by SEED (1) over the lines of the FILEs (all of src/): signs, comparisons, indices, constants,
# x and y, and, or, not, min and max. Integers grow by 1, but a 1 that is returned or assigned, which mostly means "yes",
# becomes 0, and the sizes of declared arrays stay. The double tests run against each until one fails, dies or takes ten
# times its usual time: first that of the same module, then all others that link it, the quick ones first. Tests that fail
# without a fault are left out. Faults that do not compile or leave the object code as it was are drawn again. Equal
# arguments give equal faults. Exits with 1 when fewer than nine in ten are found: some faults are equivalent
# mutants.
#
# The tests and tools use one shared library, $BUILD/mutants/libfaulty.so; a fault is one object that the loader
# puts before it. The source tree is not changed.
count=${1:-40}
seed=${2:-1}
[ $# -lt 1 ] || shift
[ $# -lt 1 ] || shift
export LC_ALL=C
unset MAKEFLAGS MFLAGS MAKELEVEL
[ $# -gt 0 ] || set -- $(ls src/*/*.c src/host/*/*.c)
case ${BUILD:-build} in
/*)
    echo "tools/mutate.sh: BUILD is \"$BUILD\", expected a path from this folder" >&2
    exit 2
    ;;
esac
build=${BUILD:-build}/mutants
mkdir -p "$build/tests"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM

# Candidates, one a line: file, line, column, length, replacement (tabs between). Comments, strings, preprocessor lines
# and assertions are left alone. Their order is drawn by the seed: first a line, then a fault on it.
awk -v seed="$seed" '
function random(n) { state = (state * 16807) % 2147483647; return int(state / 2147483647 * n) }
# Comments and strings become spaces, so that columns stay.
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
# Every match of a pattern; `how` is the kind of replacement.
function each(pattern, how,    rest, base, at, text, before, after, digits, k, c, changed)
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
            before = substr(code, 1, at - 1)
            if (after !~ /[.a-zA-Z_]/ && !(declaration && before ~ /\[[^]]*$/))
                candidate(at, length(k), k == 1 && after == ";" && before ~ /(return|[^=!<>]=) $/ ? 0 : k + 1)
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

# A fast folder for the tests' files, and the locale that they would make, each for itself.
export TMPDIR="$work"
[ ! -w /dev/shm ] || TMPDIR=$(mktemp -d /dev/shm/mutate-XXXXXX)
trap 'rm -rf "$work" "$TMPDIR"' EXIT
mkdir "$work/locale"
# The heap as tests/run.sh has it.
export MALLOC_PERTURB_=165 MALLOC_CHECK_=3 heap=
[ -n "$(LD_PRELOAD=libc_malloc_debug.so.0 true 2>&1)" ] || heap=:libc_malloc_debug.so.0
localedef -i de_DE -f UTF-8 "$work/locale/de_DE.UTF-8" >/dev/null 2>&1 && export LOCPATH="$work/locale"

libraries="$build/libcairn-host.a $build/libcairn.a"
system_libs="-lcmocka $(make -s host-libraries) -lpthread -lm"
[ ! -f /usr/include/box2d/box2d.h ] && [ ! -f /usr/local/include/box2d/box2d.h ] || {
    libraries="$build/libcairn-sim.a $libraries"
    system_libs="-lbox2d $system_libs"
}
mutate_make()
{
    make -s BUILD="$build" OPT=-O1 CFLAGS='-g0 -w' ASSERTIONS=1 "$@"
}
objects() # of the files given
{
    for source in "$@"; do
        echo "$build/double/$source.o"
    done
}
# program NAME FILE...: links $build/NAME; $work/uses/NAME says which of the library's objects it needs (newer linkers name
# the members of archives only with the option twice).
program()
{
    name=$1
    shift
    # shellcheck disable=SC2046,SC2086
    c++ -o "$build/$name" $(objects "$@") -L"$build" -lfaulty -Wl,-rpath,"$PWD/$build" $system_libs &&
        c++ -o "$work/program" $(objects "$@") -Wl,--trace,--trace,--start-group $libraries -Wl,--end-group $system_libs |
        sed -n 's/.*[(\/)]\([a-z0-9_]*\.c\)\.o)*$/\1/p' >"$work/uses/$name"
}

tests=$(ls tests/test_*.c | sed 's|.*/||; s|\.c$||')
files_of() # a variable of the Makefile
{
    printf 'include Makefile\nshow:\n\t@echo "$(%s)"\n' "$1" | make -s -f - show
}
cairn=$(files_of CAIRN_SRC) arena=$(files_of ARENA_SRC) scene=$(files_of SCENE_SRC) common=$(files_of TEST_COMMON)
shims="$([ -z "$(files_of VISION_SRC)" ] || echo "$build/libcairn-vision.so") $([ -z "$(files_of APPEARANCE_SRC)" ] || echo "$build/libcairn-appearance.so")"
needs=$(printf 'include Makefile\nshow:\n\t@$(foreach test,$(TESTS),echo $(test) $(NEEDS_$(test));)\n' | make -s -f - show)
needs_of() # the files that a test alone is linked with
{
    echo "$needs" | sed -n "s/^$1 //p"
}
mkdir -p "$work/uses/tests"
(
    # shellcheck disable=SC2046,SC2086
    mutate_make -j2 $libraries $shims $(objects $common $(for t in $tests; do echo "tests/$t.c"; needs_of "$t"; done) $cairn $arena $scene) || exit 2
    # shellcheck disable=SC2086
    c++ -shared -o "$build/libfaulty.so" -Wl,--whole-archive $libraries -Wl,--no-whole-archive -Wl,-rpath,"\$ORIGIN" $system_libs || exit 2
    # shellcheck disable=SC2086
    program cairn $cairn && program cairn-arena $arena && program cairn-scene $scene || exit 2
    for t in $tests; do
        # shellcheck disable=SC2046,SC2086
        program "tests/$t" "tests/$t.c" $common $(needs_of "$t") || exit 2
    done
    grep -qx pool.c "$work/uses/tests/test_pool" || {
        echo "the linker does not report which objects tests use" >&2
        exit 2
    }
    for t in $tests; do
        # Those that run a tool use what that uses.
        ! grep -q '/cairn' "tests/$t.c" || cat "$work/uses/cairn" "$work/uses/cairn-arena" "$work/uses/cairn-scene" >>"$work/uses/tests/$t"
    done
    for t in $tests; do
        start=$(date +%s%N)
        "$build/tests/$t" >"$work/log" 2>&1 || {
            echo "left out: $t, which fails without a fault" >&2
            continue
        }
        echo "$t $((($(date +%s%N) - start) / 100000000 + 3))" # ten times its time, and three seconds
    done | sort -n -k 2 >"$work/times"
    [ -s "$work/times" ]
) || {
    echo "tools/mutate.sh: the tests must build and pass first" >&2
    exit 2
}

# try NUMBER: writes "skip", "found by <test>" or "missed" and the changed line to $work/NUMBER.result.
cat >"$work/try" <<'END'
work=$1 build=$2 number=$3
tab=$(printf '\t')
sed -n "${number}p" "$work/candidates" >"$work/$number.fault"
IFS=$tab read -r file line column length text <"$work/$number.fault"
awk -v line="$line" -v column="$column" -v length_="$length" -v text="$text" '
    NR == line { $0 = substr($0, 1, column - 1) text substr($0, column + length_) } { print }' "$file" >"$work/$number.c"
source=$work/$number/$(basename "$file")
mkdir "$work/$number"
{ echo "#line 1 \"$file\"" && cat "$work/$number.c"; } >"$source"
object=$build/double/$file.o
command=$(make -n -W "$file" BUILD="$build" OPT=-O1 CFLAGS='-g0 -w' ASSERTIONS=1 "$object" |
    sed -n "s| -c $file -o $object| -c $source -o $work/$number.o|p")
verdict=skip
if eval "$command" 2>/dev/null &&
    ! cmp -s "$object" "$work/$number.o" && cc -shared -o "$work/$number.so" "$work/$number.o" 2>/dev/null; then
    verdict=missed
    module_test=test_$(basename "$file" .c)
    until [ -f "tests/$module_test.c" ] || [ "${module_test%_*}" = test ]; do # of a part: its module
        module_test=${module_test%_*}
    done
    ulimit -c 0
    mkdir "$TMPDIR/$number"
    while read -r t limit; do
        [ -n "$t" ] || continue
        [ "$t" = "$module_test" ] || grep -qx "$(basename "$file")" "$work/uses/tests/$t" || continue
        LD_PRELOAD=$work/$number.so$heap CMOCKA_TEST_ABORT=1 TMPDIR=$TMPDIR/$number timeout -k 1 "$limit" "$build/tests/$t" \
            >/dev/null 2>&1 || {
            verdict="found by $t"
            break
        }
    done <<TIMES
$(awk -v module_test="$module_test" '$1 == module_test' "$work/times")
$(awk -v module_test="$module_test" '$1 != module_test' "$work/times")
TIMES
    rm -rf "${TMPDIR:?}/$number"
fi
{
    echo "$verdict"
    echo "$file:$line: $verdict"
    sed -n "${line}s/^ */    - /p" "$file"
    sed -n "${line}s/^ */    + /p" "$work/$number.c"
} >"$work/$number.result"
[ "$verdict" = skip ] || sed 1d "$work/$number.result"
rm -rf "$work/$number" "$work/$number".[cos]*
END

# Two at a time, as many as are still wanted.
tried=0 total=0 candidates=$(wc -l <"$work/candidates")
while [ $total -lt "$count" ] && [ $tried -lt "$candidates" ]; do
    last=$((tried + count - total))
    [ $last -le "$candidates" ] || last=$candidates
    seq $((tried + 1)) $last | xargs -P 2 -n 1 sh "$work/try" "$work" "$build"
    tried=$last
    total=$(cat "$work"/*.result | grep -c '^found\|^missed$')
done
found=$(cat "$work"/*.result | grep -c '^found')
echo "found $found of $total (seed $seed; $((tried - total)) more did not compile or changed nothing)"
[ $((found * 10)) -ge $((total * 9)) ]
