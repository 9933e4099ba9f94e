#!/bin/sh
# Checks that files of a library do not need each other in a circle: tools/check-circles.sh LIBRARY.a...
#
# What a file needs of another is read from the symbols of the objects. A file that needs none of those left is removed; when
# none can be removed any more, those left are on circles or lead to one, and one circle is printed. NM names the tool of
# another target.
nm=${NM:-nm}

[ $# -gt 0 ] || {
    echo "usage: tools/check-circles.sh LIBRARY.a..." >&2
    exit 2
}

failed=0
for library in "$@"; do
    symbols=$($nm -A -g "$library") || exit 2
    echo "$symbols" | awk -v library="$library" '
    # libcairn.a:pool.c.o:0000000000000040 T cairn_pool_take, or ...:                 U memset
    {
        file = $1
        sub(/^[^:]*:/, "", file)
        sub(/\.o:.*/, "", file)
        if (!(file in is_left)) { is_left[file] = 1; files[++count] = file }
        if ($(NF - 1) == "U") { user[++uses] = file; used[uses] = $NF }
        else definer[$NF] = file
    }
    # A use of another file that is left; 0: none.
    function use_of(file,    i)
    {
        for (i = first[file]; i <= last[file]; i++)
            if ((used[i] in definer) && definer[used[i]] != file && is_left[definer[used[i]]]) return i
        return 0
    }
    END {
        if (!uses) { print library ": no symbols"; exit 2 }
        for (i = uses; i > 0; i--) {
            first[user[i]] = i
            if (!(user[i] in last)) last[user[i]] = i
        }
        do {
            removed = 0
            for (i = 1; i <= count; i++)
                if (is_left[files[i]] && !use_of(files[i])) { is_left[files[i]] = 0; removed++ }
        } while (removed)
        for (i = 1; i <= count && !is_left[files[i]]; i++) {}
        if (i > count) {
            print "ok     circles: " library ", " count " files, none"
            exit 0
        }
        for (file = files[i]; !(file in step); file = definer[used[use]]) {
            step[file] = ++steps
            use = use_of(file)
            text[steps] = file " needs " used[use] " of " definer[used[use]]
        }
        print library ": files that need each other in a circle:"
        for (i = step[file]; i <= steps; i++) print "    " text[i]
        exit 1
    }' || failed=1
done
exit $failed
