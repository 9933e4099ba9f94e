#!/bin/sh
# Checks the dependency order of the modules: tools/check-modules.sh [ROOT]
#
# Checks the includes of src/ and include/cairn/*.h against tools/modules.txt, whose lines are "FOLDER MODULE" in order. A module is
# src/FOLDER/MODULE.c with the header include/cairn/MODULE.h, or src/FOLDER/MODULE.h when only its own folder (of src/host: the
# folders of the host; of src/base and src/containers: all of src/) may use it. A module of src/containers may be a header of inline
# functions alone. A file MODULE_PART.[ch] that is not listed itself is a part of that module. Refused are: an
# include of a module below, of a folder that is apart, or of a private header of another folder, a header of libc that is not
# freestanding in the library, a module that is not listed, has no header, no .c or no test, a .c of the library that does not
# include src/base/build.h first, an object (CAIRN_OBJECT) that tools/pool_objects.c does not list, a folder of more than 30 files,
# a .c of more than 700 lines. Reported: a .c of more than 500.
cd "${1:-.}" || exit 2
export LC_ALL=C
ls src/*/*.[ch] src/host/*/*.[ch] include/cairn/*.h tests/test_*.c 2>/dev/null | awk '
function refuse(text) { print text; bad = 1 }
function base_of(path) { sub(/^.*\//, "", path); sub(/\.[ch]$/, "", path); return path }
function folder_of(path) { sub(/^src\//, "", path); sub(/\/[^\/]*$/, "", path); return path }
function is_host(folder) { return folder ~ /^host\// }
# The listed module of a file, or its bare name; of a part the listed module with the longest name.
function module_of(path,    base, module)
{
    base = module = base_of(path)
    if (path ~ /^src/)
        while (!((module in place) && folder[module] == folder_of(path)) && sub(/_[^_]*$/, "", module)) {}
    return path !~ /^src/ || ((module in place) && folder[module] == folder_of(path)) ? module : base
}
BEGIN {
    while ((getline line < "tools/modules.txt") > 0) {
        words = split(line, word, " ")
        if (word[1] == "apart") {
            side++
            for (i = 2; i <= words; i++) side_of[word[i]] = side
        }
        if (word[1] == "apart" || line ~ /^#/ || words != 2) continue
        place[word[2]] = ++modules
        folder[word[2]] = word[1]
        name[modules] = word[2]
        lowest[word[1]] = modules
    }
    if (!modules) { print "tools/modules.txt: no modules"; exit bad = 2 }
    while ((getline line < "tools/pool_objects.c") > 0)
        if (match(line, /OBJECT\([a-z0-9_]+\)/)) pooled[substr(line, RSTART + 7, RLENGTH - 8)] = 1
        else if (match(line, /\.name = "[a-z0-9_]+"/)) pooled[substr(line, RSTART + 9, RLENGTH - 10)] = 1
    split("float.h limits.h math.h stddef.h stdint.h string.h", list, " ")
    for (i in list) freestanding[list[i]] = 1
}
/^tests\// { sub(/^tests\/test_/, ""); sub(/\.c$/, ""); tested[$0] = 1; next }
{
    file[++files] = $0
    module = module_of($0)
    if ($0 ~ /^src/ && ++size[folder_of($0)] == 31) refuse("src/" folder_of($0) " has more than 30 files: expected a folder a capability")
    if ($0 ~ /\.c$/) {
        if (base_of($0) == module) source[module] = $0
        else parts[module]++
        if (!(module in place)) refuse($0 ": tools/modules.txt does not list the module " module)
        else if (folder[module] != folder_of($0)) refuse($0 ": tools/modules.txt has " module " in the folder " folder[module])
    } else if ($0 ~ /^include/) {
        public[module] = 1
        if (!(module in place)) refuse($0 ": tools/modules.txt does not list the module " module)
    } else {
        inner[base_of($0)] = $0
        if ($0 ~ /^src\/containers\// && !(module in place)) refuse($0 ": tools/modules.txt does not list the module " module)
    }
}
END {
    if (bad == 2) exit 2
    for (i = 1; i <= modules; i++) {
        module = name[i]
        if (!(module in source) && !(folder[module] == "containers" && (module in inner))) refuse("module " module ": no src/" folder[module] "/" module ".c")
        if (!(module in public) && !(module in inner)) refuse("module " module ": no header of its name")
        if (((module in public) || folder[module] == "containers") && !(module in tested)) refuse("module " module ": no tests/test_" module ".c")
    }
    for (i = 1; i <= files; i++) {
        path = file[i]
        module = module_of(path)
        # A header without a .c (such as build.h) belongs to its folder and may include what the folder may.
        if (!(module in place) && (path ~ /\.c$/ || (module in source) || (module in public))) continue
        where = path ~ /^src/ ? folder_of(path) : folder[module]
        own = (module in place) ? place[module] : lowest[where]
        lines = 0
        first = ""
        while ((getline line < path) > 0) {
            lines++
            object = line
            if (sub(/^CAIRN_OBJECT(_OF)?\(/, "", object)) {
                sub(/,.*/, "", object)
                if (!(object in pooled)) refuse(path ":" lines ": tools/pool_objects.c does not list the object " object)
            }
            if (line !~ /^[ \t]*#[ \t]*include/) continue
            if (first == "") {
                first = line
                if (path ~ /\.c$/ && !is_host(where) && line !~ /"src\/base\/build\.h"/)
                    refuse(path ":" lines ": expected #include \"src/base/build.h\" first")
            }
            at = path ":" lines ": "
            if (match(line, /<[^>]*>/)) {
                header = substr(line, RSTART + 1, RLENGTH - 2)
                if (!is_host(where) && !(header in freestanding)) refuse(at "<" header "> is not for the freestanding library")
                continue
            }
            if (!match(line, /"[^"]*"/)) continue
            header = substr(line, RSTART + 1, RLENGTH - 2)
            other = module_of(header)
            if (header !~ /^(cairn|src\/[a-z]+(\/[a-z]+)?)\/[a-z0-9_]+\.h$/) {
                refuse(at "\"" header "\": expected \"cairn/...\" or \"src/...\"")
                continue
            }
            if (header ~ /^src/ && folder_of(header) != where && folder_of(header) !~ /^(base|containers)$/ && !(is_host(folder_of(header)) && is_host(where)))
                refuse(at header " is private to " folder_of(header))
            if (other in place) {
                if (place[other] > own && other != module) refuse(at module " may not know " other ", which is below it")
                if (side_of[where] && side_of[folder[other]] && side_of[where] != side_of[folder[other]])
                    refuse(at where " and " folder[other] " may not know each other (" other ")")
            } else if (header ~ /^cairn/)
                refuse(at "no module " other)
        }
        close(path)
        if (path ~ /\.c$/ && lines > 700) refuse(path ":701: " lines " lines, expected at most 700: split it")
        else if (path ~ /\.c$/ && lines > 500) print "note   " path " has " lines " lines: split it: more than 500 lines"
    }
    for (i = 1; i <= modules; i++)
        if (parts[name[i]]) print "note   " name[i] " has " parts[name[i]] " more parts"
    if (!bad) print "ok     modules: " modules " in order"
    exit bad
}'
