#!/bin/sh
# Prints the sizes and offsets of the open structs of all public headers for tests/test_layout.c: tools/layout.sh >BUILD/tests/layout.h
#
# Open structs are found as `typedef struct cairn_name {` ... `} cairn_name;`, at most one declaration per line.
set -e
export LC_ALL=C
cc=${CC:-cc}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat include/cairn/*.h | awk '
{
    line = $0
    while (1) { # comments, also over several lines
        if (comment) {
            end = index(line, "*/")
            if (!end) { line = ""; break }
            line = substr(line, end + 2)
            comment = 0
        }
        start = index(line, "/*")
        if (!start) break
        rest = substr(line, start + 2)
        line = substr(line, 1, start - 1)
        end = index(rest, "*/")
        if (end) line = line " " substr(rest, end + 2)
        else comment = 1
    }
}
line ~ /^typedef struct cairn_[a-z0-9_]+ *\{/ {
    name = line
    sub(/^typedef struct /, "", name)
    sub(/ *\{.*/, "", name)
    print "SIZE " name
    next
}
name != "" && line ~ /^}/ { name = ""; next }
name != "" { # a declaration ends with its semicolon
    line = held " " line
    held = line ~ /;/ ? "" : line
}
name != "" && line ~ /;/ {
    if (line ~ /[{}]/) { print "tools/layout.sh: nested struct in " name > "/dev/stderr"; exit 1 }
    if (match(line, /\( *\*[a-z0-9_]+ *\)/)) { # a pointer to a function
        field = substr(line, RSTART, RLENGTH)
        gsub(/[^a-z0-9_]/, "", field)
        print "FIELD " name " " field
        next
    }
    sub(/;.*/, "", line)
    gsub(/\[[^]]*\]/, "", line)
    count = split(line, part, ",")
    for (i = 1; i <= count; i++) {
        field = part[i]
        sub(/[ \t]+$/, "", field)
        sub(/^.*[ \t*]/, "", field)
        print "FIELD " name " " field
    }
}' >"$work/names"

{
    for header in include/cairn/*.h; do
        echo "#include \"cairn/${header##*/}\""
    done
    echo '#include <stdio.h>'
    echo 'int main(void) {'
    awk '$1 == "SIZE" { printf "printf(\"SIZE(%s %%zu\\n\", sizeof(%s));\n", $2, $2 }
         $1 == "FIELD" { printf "printf(\"FIELD(%s@%s %%zu\\n\", offsetof(%s, %s));\n", $2, $3, $2, $3 }' "$work/names"
    echo 'return 0; }'
} >"$work/layout.c"
$cc -std=c11 -Iinclude "$work/layout.c" -o "$work/double" -lm
$cc -std=c11 -Iinclude -DCAIRN_FLOAT "$work/layout.c" -o "$work/float" -lm
"$work/double" >"$work/double.txt"
"$work/float" >"$work/float.txt"

echo '/* Sizes and offsets of the open structs in bytes, double and float, on a 64-bit ABI: made by'
echo ' * tools/layout.sh. */'
for header in include/cairn/*.h; do
    echo "#include \"cairn/${header##*/}\""
done
echo
echo 'static const layout OPEN_STRUCTS[] = {'
paste -d ' ' "$work/double.txt" "$work/float.txt" | awk '{ sub(/@/, ", ", $1); print "    {" $1 ", " $2 ", " $4 ")}," }'
echo '};'
