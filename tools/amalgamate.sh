#!/bin/sh
# Writes the library as two files, cairn.h and cairn.c, into a directory: tools/amalgamate.sh DIRECTORY [MODULE]...
#
# With modules: only those, and the modules that they include, directly or not.
# The public headers and the .c files of the library are concatenated in the order of tools/modules.txt.
# Macros of a .c are undefined at its end. A file-level name (static function or variable, type, tag, enum constant) that several
# files use is renamed in each .c by a macro, to <module>_<name>.
set -e
export LC_ALL=C
out=${1:?usage: tools/amalgamate.sh DIRECTORY [MODULE]...}
shift
mkdir -p "$out"

# The .c files as "place folder/module file", in the order of their modules. Parts (<module>_<part>.c) follow their module, and so do
# private headers, which are listed, too.
files=$(ls src/*/*.[ch] | awk '
    BEGIN {
        while ((getline line < "tools/modules.txt") > 0)
            if (line !~ /^#/ && split(line, word, " ") == 2) place["src/" word[1] "/" word[2]] = ++modules
    }
    {
        module = $0
        sub(/\.[ch]$/, "", module)
        while (!(module in place) && sub(/_[^_\/]*$/, "", module)) {}
        if (module in place) print place[module], substr(module, 5), $0
    }' | sort -k 1,1n -k 3)

# The modules in order, as folder/module: all, or those of the arguments with what they include.
modules=$(echo "$files" | awk -v wanted="$*" '
    # Follows the includes of a file.
    function follow(path,    line, other)
    {
        if (path in seen) return
        seen[path] = 1
        while ((getline line < path) > 0)
            if (match(line, /^#include "(cairn|src)\/[^"]*"/)) includes[path] = includes[path] " " substr(line, 11, RLENGTH - 11)
        close(path)
        count[path] = split(includes[path], list, " ")
        for (other = 1; other <= count[path]; other++) include[path, other] = list[other]
        for (other = 1; other <= count[path]; other++) {
            line = include[path, other]
            if (line ~ /^cairn\//) {
                take(of_header[line])
                follow("include/" line)
            } else {
                if (line in of) take(of[line])
                follow(line)
            }
        }
    }
    function take(module,    i)
    {
        if (module == "" || module in taken) return
        taken[module] = 1
        header = module
        sub(/.*\//, "", header)
        follow("include/cairn/" header ".h")
        for (i = 1; i <= sources[module]; i++) follow(source[module, i])
    }
    {
        of[$3] = $2
        if (!($2 in sources)) {
            order[++modules] = $2
            short = $2
            sub(/.*\//, "", short)
            of_header["cairn/" short ".h"] = of_name[short] = $2
        }
        source[$2, ++sources[$2]] = $3
    }
    END {
        words = split(wanted, word, " ")
        for (i = 1; i <= words; i++) {
            if (!(word[i] in of_name)) {
                print "tools/amalgamate.sh: no module \047" word[i] "\047, expected one of the library in tools/modules.txt" >"/dev/stderr"
                exit 2
            }
            take(of_name[word[i]])
        }
        for (i = 1; i <= modules; i++) if (!words || order[i] in taken) print order[i]
    }')
sources=$(echo "$files" | awk -v modules="$(echo "$modules" | tr '\n' ' ')" '
    BEGIN { for (n = split(modules, list, " "); n > 0; n--) chosen[list[n]] = 1 }
    $3 ~ /\.c$/ && $2 in chosen { print $3 }')

title="the whole library in one file"
[ $# -eq 0 ] || title="the modules $(echo "$*" | sed 's/ /, /g') of the library, and what they need, in one file"

# Comment that opens both files.
banner()
{
    echo "/* cairn $(awk '/define CAIRN_VERSION_STRING/ { gsub(/"/, "", $3); print $3 }' include/cairn/version.h): $1"
    echo ' *'
    awk 'NR > 1 { print "" } { printf " *%s%s", ($0 == "" ? "" : " "), $0 }' LICENSE
    echo ' */'
}

# Prints a header without its guard and without its includes of cairn.
body()
{
    awk '
    { line[NR] = $0 }
    END {
        guard = 0
        for (last = NR; last > 0 && line[last] !~ /^#endif/; last--) {}
        for (i = 1; i < last; i++) {
            if (!guard && line[i] ~ /^#ifndef CAIRN_[A-Z0-9_]*_H$/) { guard = 1; i++; continue }
            if (line[i] ~ /^#include "/) continue
            print line[i]
        }
    }' "$1"
}

{
    banner "its public headers in one (see cairn.c)"
    echo '#ifndef CAIRN_H'
    echo '#define CAIRN_H'
    for module in $modules; do
        header=include/cairn/${module#*/}.h
        [ ! -f "$header" ] || { echo && body "$header"; }
    done
    echo
    echo '#endif'
} >"$out/cairn.h.new"

# File-level names of .c files and private headers, one "<file> <name>" per line.
names()
{
    awk '
    function declared(name) { if (name != "" && name !~ /^cairn_/) print file, name }
    function finish(    i, skip, parens) # the tokens of one declaration without what is in braces
    {
        for (i = 1; i <= n; i++)
            if ((token[i] == "struct" || token[i] == "union" || token[i] == "enum") && token[i + 2] == "{}") declared(token[i + 1])
        if (token[1] == "typedef") {
            for (i = 1; i <= n && !(token[i] == "(" && token[i + 1] == "*"); i++) {}
            declared(i <= n ? token[i + 2] : token[n])
        } else if (token[1] == "static") {
            for (i = 1; i <= n && token[i] != "(" && token[i] != "=" && token[i] != "["; i++) {}
            if (token[i] == "(" && token[i + 1] != "*") declared(token[i - 1])
            else
                for (i = 1; i <= n + 1; i++) {
                    if (token[i] == "(" || token[i] == "[") parens++
                    if (!parens && !skip && token[i + 1] ~ /^(\[|=|,|)$/ && token[i] ~ /^[A-Za-z_]/) declared(token[i])
                    if (token[i] == ")" || token[i] == "]") parens--
                    if (!parens && token[i] == "=") skip = 1
                    if (!parens && token[i] == ",") skip = 0
                }
        }
        for (i = 1; i <= n + 2; i++) delete token[i]
        n = 0
    }
    FNR == 1 { file = FILENAME; n = depth = comment = continued = 0 }
    continued || /^[ \t]*#/ { continued = /\\$/; next }
    {
        rest = $0
        while (rest != "") {
            if (comment) {
                if (!(i = index(rest, "*/"))) break
                rest = substr(rest, i + 2)
                comment = 0
                continue
            }
            if (substr(rest, 1, 2) == "/*") { comment = 1; rest = substr(rest, 3); continue }
            if (substr(rest, 1, 2) == "//") break
            if (!match(rest, /^([A-Za-z_][A-Za-z0-9_]*|[0-9.][0-9A-Za-z_.]*|"([^"\\]|\\.)*"|\047([^\047\\]|\\.)*\047|[ \t]+|.)/)) break
            t = substr(rest, 1, RLENGTH)
            rest = substr(rest, RLENGTH + 1)
            if (t ~ /^[ \t]/) continue
            if (t == "{") {
                if (depth++ == 0) {
                    enumeration = token[n] == "enum" || token[n - 1] == "enum"
                    whole = token[n] == ")"
                    before = ","
                    token[++n] = "{}"
                }
            } else if (t == "}") {
                if (--depth == 0 && whole) finish()
            } else if (depth == 0) {
                if (t == ";") finish()
                else token[++n] = t
            } else if (depth == 1 && enumeration) {
                if (before == "," && t ~ /^[A-Za-z_]/) declared(t)
                before = t
            }
        }
    }' "$@"
}
# shellcheck disable=SC2086
names $sources $(ls src/*/*.h) | sort -u >"$out/names"

{
    banner "$title; #define CAIRN_FLOAT for it and for all users of cairn.h to compute in float"
    body src/base/build.h
    echo '#include "cairn.h"'
    cat include/cairn/*.h src/*/*.h >"$out/headers"
    # shellcheck disable=SC2086
    awk -v names="$out/names" -v headers="$out/headers" '
    function emit_header(path,    line, other, inner, i, count, guard, last) # with the private headers that it includes
    {
        if (path in emitted) return
        emitted[path] = 1
        count = 0
        while ((getline line < path) > 0) {
            if (line ~ /^#include "src\//) {
                other = line
                gsub(/^#include "|".*$/, "", other)
                emit_header(other)
            }
        }
        close(path)
        guard = 0
        count = 0
        while ((getline line < path) > 0) {
            if (!guard && line ~ /^#ifndef CAIRN_[A-Z0-9_]*_H$/) { guard = 1; getline line < path; continue }
            if (line ~ /^#include "/) continue
            text[++count] = line
        }
        close(path)
        for (last = count; last > 0 && text[last] !~ /^#endif/; last--) {}
        for (i = 1; i < last; i++) print text[i]
    }
    BEGIN {
        emitted["src/base/build.h"] = 1
        while ((getline line < headers) > 0)
            if (line ~ /^    [a-z].*;/) members = members line "\n"
        while ((getline line < names) > 0) {
            split(line, word, " ")
            users[word[2]]++
            list[++entries] = line
        }
    }
    function finish_file(    i)
    {
        for (i = 1; i <= macros; i++) print "#undef " macro[i]
        macros = 0
        split("", replaced)
    }
    # The line with the names in `replaced` exchanged, but not those after . or ->.
    function exchanged(line,    out, name)
    {
        out = ""
        while (match(line, /[A-Za-z_][A-Za-z0-9_]*/)) {
            name = substr(line, RSTART, RLENGTH)
            out = out substr(line, 1, RSTART - 1)
            out = out (name in replaced && out !~ /(\.|->)$/ ? replaced[name] : name)
            line = substr(line, RSTART + RLENGTH)
        }
        return out line
    }
    FNR == 1 {
        finish_file()
        module = FILENAME
        gsub(/^.*\/|\.c$/, "", module)
        whole = own = ""
        inside = 0
        while ((getline line < FILENAME) > 0) {
            whole = whole line "\n"
            if (line ~ /^}/) inside = 0
            if (inside) own = own line "\n"
            if (line ~ /^(typedef )?struct .*\{$/) inside = 1
            if (line ~ /^#include "src\//) {
                other = line
                gsub(/^#include "|".*$/, "", other)
                emit_header(other)
            }
        }
        close(FILENAME)
        print "\n/* ---- " FILENAME " ---- */\n"
        split("", defined)
        for (i = 1; i <= entries; i++) {
            split(list[i], word, " ")
            if (word[1] == FILENAME && users[word[2]] > 1) {
                # A name that a struct of a header, and none of this file, has as a member: it is replaced where it occurs
                # alone. A macro would change the member, too.
                member = "[ *]" word[2] "(,|;|\\[|\\)\\()"
                if (whole ~ ("(\\.|->)" word[2] "[^A-Za-z0-9_]") && members ~ member && own !~ member) {
                    replaced[word[2]] = module "_" word[2]
                    continue
                }
                print "#define " word[2] " " module "_" word[2]
                macro[++macros] = word[2]
            }
        }
    }
    /^#include "/ { next }
    /^#[ \t]*define[ \t]/ {
        name = $0
        sub(/^#[ \t]*define[ \t]+/, "", name)
        sub(/[^A-Za-z0-9_].*/, "", name)
        if (!(name in defined)) { defined[name] = 1; macro[++macros] = name }
    }
    { print exchanged($0) }
    END { finish_file() }' $sources
} >"$out/cairn.c.new"
rm "$out/names" "$out/headers"
mv "$out/cairn.h.new" "$out/cairn.h"
mv "$out/cairn.c.new" "$out/cairn.c"
