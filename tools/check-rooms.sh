#!/bin/sh
# Proves the order of the rooms: tools/check-rooms.sh [ROOT]
#
# Reads the includes of src/*/*.[ch] and include/cairn/*.h against tools/rooms.txt. A room is src/<floor>/<room>.c with the
# header include/cairn/<room>.h, or src/<floor>/<room>.h when only its own floor may use it. A file <room>_<part>.[ch] in
# src/ that is not listed itself is a part of that room. Refused are: an include of a
# room below, contour and mapping including each other, a header of libc that is not freestanding in the library, a room
# that is not listed, has no header, no .c or no test, a .c of the library that does not include src/core/build.h first.
# Reported: rooms over 500 lines.
cd "${1:-.}" || exit 2
export LC_ALL=C
ls src/*/*.c src/*/*.h include/cairn/*.h tests/test_*.c 2>/dev/null | awk '
function refuse(text) { print text; bad = 1 }
function base_of(path) { sub(/^.*\//, "", path); sub(/\.[ch]$/, "", path); return path }
# The listed room of a file, or its bare name; of a part the listed room with the longest name.
function room_of(path,    base, room)
{
    base = room = base_of(path)
    if (path ~ /^src/)
        while (!((room in place) && floor[room] == floor_of(path)) && sub(/_[^_]*$/, "", room)) {}
    return path !~ /^src/ || ((room in place) && floor[room] == floor_of(path)) ? room : base
}
function floor_of(path) { sub(/^src\//, "", path); sub(/\/.*/, "", path); return path }
BEGIN {
    while ((getline line < "tools/rooms.txt") > 0) {
        if (line ~ /^#/ || split(line, word, " ") != 2) continue
        place[word[2]] = ++rooms
        floor[word[2]] = word[1]
        name[rooms] = word[2]
        lowest[word[1]] = rooms
    }
    if (!rooms) { print "tools/rooms.txt: no rooms"; exit bad = 2 }
    split("float.h limits.h math.h stddef.h stdint.h string.h", list, " ")
    for (i in list) freestanding[list[i]] = 1
}
/^tests\// { sub(/^tests\/test_/, ""); sub(/\.c$/, ""); tested[$0] = 1; next }
{
    file[++files] = $0
    room = room_of($0)
    if ($0 ~ /\.c$/) {
        if (base_of($0) == room) source[room] = $0
        else parts[room]++
        if (!(room in place)) refuse($0 ": tools/rooms.txt does not list the room " room)
        else if (floor[room] != floor_of($0)) refuse($0 ": tools/rooms.txt has " room " on the floor " floor[room])
    } else if ($0 ~ /^include/) {
        public[room] = 1
        if (!(room in place)) refuse($0 ": tools/rooms.txt does not list the room " room)
    } else
        inner[base_of($0)] = $0
}
END {
    if (bad == 2) exit 2
    for (i = 1; i <= rooms; i++) {
        room = name[i]
        if (!(room in source)) refuse("room " room ": no src/" floor[room] "/" room ".c")
        if (!(room in public) && !(room in inner)) refuse("room " room ": no header of its name")
        if ((room in public) && !(room in tested)) refuse("room " room ": no tests/test_" room ".c")
    }
    for (i = 1; i <= files; i++) {
        path = file[i]
        room = room_of(path)
        # A header without a .c (build.h, say) belongs to its floor and sees what the floor sees.
        if (!(room in place) && (path ~ /\.c$/ || (room in source) || (room in public))) continue
        where = path ~ /^src/ ? floor_of(path) : floor[room]
        own = (room in place) ? place[room] : lowest[where]
        lines = 0
        first = ""
        while ((getline line < path) > 0) {
            lines++
            if (line !~ /^[ \t]*#[ \t]*include/) continue
            if (first == "") {
                first = line
                if (path ~ /\.c$/ && where != "host" && line !~ /"src\/core\/build\.h"/)
                    refuse(path ":" lines ": expected #include \"src/core/build.h\" first")
            }
            at = path ":" lines ": "
            if (match(line, /<[^>]*>/)) {
                header = substr(line, RSTART + 1, RLENGTH - 2)
                if (where != "host" && !(header in freestanding)) refuse(at "<" header "> is not for the freestanding library")
                continue
            }
            if (!match(line, /"[^"]*"/)) continue
            header = substr(line, RSTART + 1, RLENGTH - 2)
            other = room_of(header)
            if (header !~ /^(cairn|src\/[a-z]+)\/[a-z0-9_]+\.h$/) {
                refuse(at "\"" header "\": expected \"cairn/...\" or \"src/...\"")
                continue
            }
            if (header ~ /^src/ && floor_of(header) != where && header != "src/core/build.h")
                refuse(at header " is private to " floor_of(header))
            if (other in place) {
                if (place[other] > own && other != room) refuse(at room " may not know " other ", which is below it")
                if ((where == "mapping" && floor[other] == "contour") || (where == "contour" && floor[other] == "mapping"))
                    refuse(at "contour and mapping may not know each other (" other ")")
            } else if (header ~ /^cairn/)
                refuse(at "no room " other)
        }
        close(path)
        if (path ~ /\.c$/ && lines > 500) print "note   " path " has " lines " lines: over 500 it is two rooms"
    }
    for (i = 1; i <= rooms; i++)
        if (parts[name[i]]) print "note   " name[i] " has " parts[name[i]] " more parts"
    if (!bad) print "ok     rooms: " rooms " in order"
    exit bad
}'
