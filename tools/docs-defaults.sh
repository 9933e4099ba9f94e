#!/bin/sh
# Whether the comments of the headers say the defaults that _default() returns, and the ranges of the tables of parameters:
# tools/docs-defaults.sh BUILD [OUT]
# tools/docs-defaults.sh --source [host]
#
# Of each line of OUT/params.tsv (tools/docs.sh; OUT: BUILD/docs) comparisons in C are made, compiled with the libraries in BUILD
# and run. HOST_LIBS: what libcairn-host needs. Not compared are defaults that depend on arguments, "(from ...)", the range "any" of
# an enumeration, callbacks, and a bound that names another field, which is a rule of _check(). Ranges are those of the modules that declare
# their parameters in a table (src/base/object.h; src/host/base/host_parameters.h).
#
# --source: prints these comparisons alone, as the function compare_with_comments(), for tests/test_comments.c; host: those of the host
# library, too.
set -e
build=${1:?usage: tools/docs-defaults.sh BUILD [OUT], or --source [host]}
export LC_ALL=C
without='^host'
libraries="$build/libcairn.a -lm"
if [ "$build" = --source ]; then
    [ "$2" != host ] || without='^$'
    out=$(mktemp -d)
    trap 'rm -rf "$out"' EXIT
    # shellcheck disable=SC2046
    awk -v mode=params -f tools/docs-text.awk -f tools/docs-functions.awk -f tools/docs.awk \
        $(awk '!/^#/ && NF == 2 { print "include/cairn/" $2 ".h" }' tools/modules.txt | xargs ls 2>/dev/null) >"$out/params.tsv"
elif out=${2:-$build/docs} && [ -f "$build/libcairn-host.a" ]; then
    without='^$'
    libraries="$build/libcairn-host.a $build/libcairn.a ${HOST_LIBS--lyaml -lpng -lz} -lm"
else
    echo "skipped defaults of the host library: not built"
fi
tables=$(sed -n 's/^const cairn_parameters cairn_\([a-z_]*\)_parameters.*/\1/p' src/*/*.c | tr '\n' ' ')
host_tables=
[ "$without" != '^$' ] || host_tables=$(sed -n 's/^const cairn_host_parameters cairn_\([a-z_]*\)_parameters.*/\1/p' src/host/*/*.c | tr '\n' ' ')
headers=
for module in $(awk -v without="$without" '!/^#/ && NF == 2 && $1 !~ without { print $2 }' tools/modules.txt); do
    [ ! -f "include/cairn/$module.h" ] || headers="$headers include/cairn/$module.h"
done

# shellcheck disable=SC2086
awk -F '\t' -v tables=" $tables" -v host_tables=" $host_tables" '
function fault(what)
{
    print $2 "." $4 ": " what > "/dev/stderr"
    failed = 1
}
# A default or a bound as an expression in C.
function expression(text)
{
    while (match(text, /[0-9],[0-9][0-9][0-9]/))
        text = substr(text, 1, RSTART) substr(text, RSTART + 2)
    gsub(/ degrees?/, " * pi / 180", text)
    while (match(text, /2\^[0-9]+/))
        text = substr(text, 1, RSTART - 1) "ldexp(1, " substr(text, RSTART + 2, RLENGTH - 2) ")" substr(text, RSTART + RLENGTH)
    gsub(/pi/, "3.14159265358979323846", text)
    gsub(/CAIRN_[A-Z0-9_]+/, "(double)&", text)
    return "1.0 * " text
}
# A bound as an expression in C; NAN for one that names another field.
function bound(text,    names)
{
    names = text
    gsub(/pi|degrees?|[0-9.]+e-?[0-9]+|CAIRN_[A-Z0-9_]+/, "", names)
    return names ~ /[a-z]/ ? "(double)NAN" : expression(text)
}
# The default in float, where the meaning says another one.
function in_float(meaning)
{
    return match(meaning, /[0-9.e-]+ by default in float/) ? "sizeof(cairn_real) == sizeof(float) ? " substr(meaning, RSTART, RLENGTH - 20) " : " : ""
}
# The comparison of a range with the table of a module.
function range_check(module, field, type, text,    part, parts, i, low, high, above, below)
{
    low = "-(double)INFINITY"
    high = "(double)INFINITY"
    above = below = 0
    if (text == "any" && type !~ /^(int(32|64)_t|cairn_real|double|float)$/)
        low = high = "(double)NAN"
    else if (split(text, part, / \.\.\. /) == 2 || split(text, part, / or /) == 2) {
        low = bound(part[1])
        high = bound(part[2])
    } else if (text != "any" && text != "finite") {
        parts = split(text, part, /, /)
        for (i = 1; i <= parts; i++) {
            if (sub(/^>= /, "", part[i]))
                low = bound(part[i])
            else if (sub(/^> /, "", part[i])) {
                low = bound(part[i])
                above = 1
            } else if (sub(/^<= /, "", part[i]))
                high = bound(part[i])
            else if (sub(/^< /, "", part[i])) {
                high = bound(part[i])
                below = 1
            } else if (part[i] != "finite")
                fault("the range \"" text "\" is none of those of CONTRIBUTING.md")
        }
    }
    return "    " (index(host_tables, " " module " ") ? "host_range(\"" module "\", " : "range(") "&cairn_" module "_parameters, \"" field "\", " above ", " low ", " below ", " high ");"
}
FILENAME != last { last = FILENAME; file++ }
# The functions of the headers, which may be broken behind the type.
FILENAME ~ /\.h$/ {
    if ($0 ~ /^cairn_[a-z_]+_params$/) {
        type = $0
        next
    }
    line = type == "" ? $0 : type " " $0
    type = ""
    if (match(line, /^cairn_[a-z_]+_params cairn_[a-z_]+_default\(/)) {
        split(line, part, /[ (]/)
        made[part[1]] = part[2] (line ~ /\(void\)/ ? "()" : "(640, 480)")
    }
    included[FILENAME] = 1
    next
}
# The lines of the parameters: those of nested structs first.
{ row[++rows] = $0 }
$3 ~ /_params$/ && ($2 in made) && !($3 in made) { made[$3] = made[$2] "." $4 }
END {
    print "#include <math.h>\n#include <stdio.h>\n#include <string.h>\n#include \"src/base/object.h\""
    for (name in included) {
        sub(/^include\//, "", name)
        print "#include \"" name "\""
    }
    count = split(tables, table, / /)
    for (i = 1; i <= count; i++)
        if (table[i] != "")
            print "extern const cairn_parameters cairn_" table[i] "_parameters;"
    has_host = host_tables ~ /[a-z]/
    if (has_host)
        print "#include \"src/host/base/host_parameters.h\""
    count = split(host_tables, table, / /)
    for (i = 1; i <= count; i++)
        if (table[i] != "")
            print "extern const cairn_host_parameters cairn_" table[i] "_parameters;"
    print "static int faults, compared, ranges;"
    print "static void same(const char *name, double is, double said)\n{"
    print "    compared++;"
    print "    if (fabs(is - said) > 1e-6 * fabs(said)) {"
    print "        printf(\"%s: the comment says %.9g, the default is %.9g\\n\", name, said, is);"
    print "        faults++;\n    }\n}"
    print "static void bound(const char *module, const char *field, const char *said_sign, double said, const char *sign, double is)\n{"
    print "    if (isnan(said) || (fabs(is - said) <= 1e-6 * fabs(said) && strcmp(sign, said_sign) == 0))\n        return;"
    print "    printf(\"cairn_%s_params.%s: the comment says %s %.9g, the table %s %.9g\\n\", module, field, said_sign, said, sign, is);"
    print "    faults++;\n}"
    print "static void range(const cairn_parameters *table, const char *field, int above, double low, int below, double high)\n{"
    print "    const cairn_parameter *row = table->list;"
    print "    const cairn_parameter *end = row + table->count;\n"
    print "    while (row < end && strcmp(row->field, field) != 0)\n        row++;"
    print "    if (row == end) {"
    print "        printf(\"cairn_%s_params.%s: no row in the table of parameters\\n\", table->module, field);"
    print "        faults++;\n        return;\n    }"
    print "    ranges++;"
    print "    if (row->type == CAIRN_PARAMETER_INTEGER) {"
    print "        bound(table->module, field, \">=\", low < INT32_MIN ? INT32_MIN : low + above, \">=\", (double)row->lowest.integer);"
    print "        bound(table->module, field, \"<=\", high > INT32_MAX ? INT32_MAX : high - below, \"<=\", (double)row->highest.integer);"
    print "    } else {"
    print "        const double most = (double)CAIRN_REAL_MAX;"
    print "        int is_above = row->type == CAIRN_PARAMETER_NUMBER_ABOVE || row->type == CAIRN_PARAMETER_NUMBER_BETWEEN;"
    print "        int is_below = row->type == CAIRN_PARAMETER_NUMBER_BELOW || row->type == CAIRN_PARAMETER_NUMBER_BETWEEN;\n"
    print "        bound(table->module, field, above ? \">\" : \">=\", low < -most ? -most : low, is_above ? \">\" : \">=\", (double)row->lowest.number);"
    print "        bound(table->module, field, below ? \"<\" : \"<=\", high > most ? most : high, is_below ? \"<\" : \"<=\", (double)row->highest.number);"
    print "    }\n}"
    if (has_host) {
        print "static void host_range(const char *module, const cairn_host_parameters *table, const char *field, int above, double low, int below, double high)\n{"
        print "    const cairn_host_parameter *row = table->list;"
        print "    const cairn_host_parameter *end = row + table->count;\n"
        print "    while (row < end && strcmp(row->field, field) != 0)\n        row++;"
        print "    if (row == end) {"
        print "        printf(\"cairn_%s_params.%s: no row in the table of parameters\\n\", module, field);"
        print "        faults++;\n        return;\n    }"
        print "    ranges++;"
        print "    if (row->type == CAIRN_HOST_PARAMETER_INT32 || row->type == CAIRN_HOST_PARAMETER_INT64) {"
        print "        double least = row->type == CAIRN_HOST_PARAMETER_INT32 ? INT32_MIN : (double)INT64_MIN;\n"
        print "        bound(module, field, \">=\", low < least ? least : low + above, \">=\", row->lowest + row->above);"
        print "        bound(module, field, \"<=\", high > -least ? -least - 1 : high - below, \"<=\", row->highest);"
        print "    } else {"
        print "        bound(module, field, above ? \">\" : \">=\", low, row->above ? \">\" : \">=\", row->lowest);"
        print "        bound(module, field, below ? \"<\" : \"<=\", high, \"<=\", row->highest);"
        print "    }\n}"
    }
    print "static int compare_with_comments(void)\n{"
    for (i = 1; i <= rows; i++) {
        $0 = row[i]
        value = $7
        module = $2
        sub(/^cairn_/, "", module)
        sub(/_params$/, "", module)
        if (($1 in included) && index(host_tables, " " module " ") && $3 !~ /_params$|^uint|^void |\*/)
            print range_check(module, $4, $3, $6)
        if (($1 in included) && index(tables, " " module " ") && $3 !~ /_params$|^uint|^int64|^double|^void |\*/) {
            if ($3 == "cairn_vec2") {
                print range_check(module, $4 ".x", "cairn_real", $6)
                print range_check(module, $4 ".y", "cairn_real", $6)
            } else
                print range_check(module, $4, $3, $6)
        }
        if ($3 ~ /_params$/ || !($1 in included))
            continue
        if (!($2 in made)) {
            if (value != "none")
                fault("the default is \"" value "\", but no _default() returns " $2 ", expected \"none\"")
            continue
        }
        what = made[$2] "." $4
        label = "\"" $2 "." $4 "\""
        if (value == "none")
            fault("no default, but " made[$2] " returns one")
        else if (value ~ /^from /)
            continue
        else if (value == "NULL")
            print "    same(" label ", " what " != NULL, 0);"
        else if (value ~ /^"/)
            print "    same(" label ", strcmp(" what ", " value "), 0);"
        else if ($3 == "cairn_vec2") {
            split(value, part, / and /)
            print "    same(" label ", (double)" what ".x, " expression(part[1]) ");"
            print "    same(" label ", (double)" what ".y, " expression(part[2] == "" ? part[1] : part[2]) ");"
        } else
            print "    same(" label ", (double)" what ", " in_float($8) expression(value) ");"
    }
    print "    if (compared == 0)\n        printf(\"no default was compared: none of the modules has any\\n\");"
    print "    else if (faults == 0)\n        printf(\"ok     %d defaults and %d ranges in comments\\n\", compared, ranges);"
    print "    return faults != 0 || compared == 0;\n}"
    exit failed
}' $headers "$out/params.tsv" >"$out/defaults.c"
if [ "$build" = --source ]; then
    cat "$out/defaults.c"
    exit
fi
echo 'int main(void) { return compare_with_comments(); }' >>"$out/defaults.c"
# shellcheck disable=SC2086
${CC:-cc} -std=c11 -I. -Iinclude "$out/defaults.c" $libraries -o "$out/defaults"
"$out/defaults"
