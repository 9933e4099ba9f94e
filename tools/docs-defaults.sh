#!/bin/sh
# Whether the defaults in the comments of the headers are those that _default() returns: tools/docs-defaults.sh BUILD [OUT]
#
# Of each line of OUT/params.tsv (tools/docs.sh; OUT: BUILD/docs) a comparison in C is made, compiled with the libraries in BUILD
# and run. HOST_LIBS: what libcairn-host needs. Not compared are defaults that depend on arguments, "(from ...)".
set -e
build=${1:?usage: tools/docs-defaults.sh BUILD [OUT]}
out=${2:-$build/docs}
export LC_ALL=C
without='^host'
libraries="$build/libcairn.a -lm"
if [ -f "$build/libcairn-host.a" ]; then
    without='^$'
    libraries="$build/libcairn-host.a $build/libcairn.a ${HOST_LIBS--lyaml -lpng -lz} -lm"
else
    echo "skipped defaults of the host library: not built"
fi
headers=
for module in $(awk -v without="$without" '!/^#/ && NF == 2 && $1 !~ without { print $2 }' tools/modules.txt); do
    [ ! -f "include/cairn/$module.h" ] || headers="$headers include/cairn/$module.h"
done

# shellcheck disable=SC2086
awk -F '\t' '
function fault(what)
{
    print $2 "." $4 ": " what > "/dev/stderr"
    failed = 1
}
# A default as an expression in C.
function expression(text)
{
    while (match(text, /[0-9],[0-9][0-9][0-9]/))
        text = substr(text, 1, RSTART) substr(text, RSTART + 2)
    gsub(/ degrees?/, " * CAIRN_PI / 180", text)
    gsub(/2\^/, "1 << ", text)
    gsub(/pi/, "CAIRN_PI", text)
    return "1.0 * " text
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
    print "#include <math.h>\n#include <stdio.h>\n#include <string.h>"
    for (name in included) {
        sub(/^include\//, "", name)
        print "#include \"" name "\""
    }
    print "static int faults, compared;"
    print "static void same(const char *name, double is, double said)\n{"
    print "    compared++;"
    print "    if (fabs(is - said) > 1e-6 * fabs(said)) {"
    print "        printf(\"%s: the comment says %.9g, the default is %.9g\\n\", name, said, is);"
    print "        faults++;\n    }\n}"
    print "int main(void)\n{"
    for (i = 1; i <= rows; i++) {
        $0 = row[i]
        value = $7
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
            print "    same(" label ", " what ".x, " expression(part[1]) ");"
            print "    same(" label ", " what ".y, " expression(part[2] == "" ? part[1] : part[2]) ");"
        } else
            print "    same(" label ", (double)" what ", " expression(value) ");"
    }
    print "    if (compared == 0)\n        printf(\"no default was compared: none of the modules has any\\n\");"
    print "    else if (faults == 0)\n        printf(\"ok     %d defaults in comments\\n\", compared);"
    print "    return faults != 0 || compared == 0;\n}"
    exit failed
}' $headers "$out/params.tsv" >"$out/defaults.c"
# shellcheck disable=SC2086
${CC:-cc} -std=c11 -Iinclude "$out/defaults.c" $libraries -o "$out/defaults"
"$out/defaults"
