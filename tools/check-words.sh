#!/bin/sh
# Checks that the project uses the field's terms: tools/check-words.sh [-C ROOT] [FILE]...
#
# Reports the lines of all text files of the project in which a pattern of tools/words.txt occurs as whole words. With FILE... only
# those files are checked.
#
# Method.
# 1. A line is reduced to lower-case words: each other character than a letter, a digit or an underscore becomes a space.
#    An underscore separates words like a space, so that `key_scan` and "key scan" are the same words.
# 2. The text of the exceptions for the file is removed, then the patterns are searched for. Words that a line break separates
#    are found: the last word of a line is also placed before the next one.
# 3. Errors are also: an exception without a word in any file (not with FILE...), and an invalid line of tools/words.txt.
#
# Limits: camelCase is one word. The files in which words are quoted on purpose are not checked: tools/words.txt, docs/renamed.md,
# this program and its test.
root=.
[ "$1" = -C ] && root=$2 && shift 2
cd "$root" || exit 2
export LC_ALL=C
all=0
[ $# -gt 0 ] || {
    all=1
    # Of a tree without git the files below these folders are the same ones.
    # shellcheck disable=SC2046
    set -- $(find .ci Makefile ./*.md ./*.json ./*.py ./*.txt ./*.yml bench data docs firmware include packaging python sim src tests tools zephyr -type f 2>/dev/null |
        sed 's|^\./||' | grep -E '\.(c|h|cpp|md|sh|awk|py|pyi|toml|txt|html|ipynb|json|ld|xml|yaml|yml)$|^Makefile$|/Kconfig$|^\.ci/run$' | sort)
}
awk -v all=$all '
function refuse(text) { print text; bad = 1 }
function trim(text) { gsub(/^[ \t]+|[ \t]+$/, "", text); return text }
# A pattern as whole words: a space stands for any separator.
function whole(pattern) { gsub(/ /, "[ _]+", pattern); return "[ _](" pattern ")[ _]" }
function words_of(text) { text = " " text " "; gsub(/[^A-Za-z0-9_]+/, " ", text); return tolower(text) }
# Removes the exceptions of this file, and counts those that had a private word.
function without_exceptions(text,    i, hidden) {
    for (i = 1; i <= exceptions; i++) {
        if (FILENAME !~ file[i]) continue
        hidden = text
        if (gsub(exception[i], " . ", hidden)) { used[i]++; text = hidden }
    }
    return text
}
function check(text, line,    i, found) {
    text = without_exceptions(text)
    if (text !~ any) return
    for (i = 1; i <= patterns; i++)
        if (match(text, pattern[i])) {
            found = substr(text, RSTART + 1, RLENGTH - 2)
            refuse(FILENAME ":" line ": \"" found "\": expected " term[i])
        }
}
BEGIN {
    list = "tools/words.txt"
    while ((status = (getline line < list)) > 0) {
        at = list ":" ++number ": "
        if (line ~ /^#/ || line ~ /^[ \t]*$/) continue
        cells = split(line, cell, / \| /)
        if (line ~ /^allow /) {
            if (cells != 3 || trim(cell[3]) == "") { refuse(at "expected: allow PATTERN | FILE | reason"); continue }
            exception[++exceptions] = whole(trim(substr(cell[1], 7)))
            file[exceptions] = "^(" trim(cell[2]) ")$"
            place[exceptions] = at
        } else {
            if (cells != 2 || trim(cell[2]) == "") { refuse(at "expected: PATTERN | term"); continue }
            pattern[++patterns] = whole(trim(cell[1]))
            term[patterns] = trim(cell[2])
            any = any (patterns > 1 ? "|" : "") pattern[patterns]
        }
    }
    if (!patterns) { print list ": no patterns"; exit bad = 2 }
}
FNR == 1 { last = ""; skip = FILENAME ~ /^(tools\/(words\.txt|check-words(-test)?\.sh)|docs\/renamed\.md)$/; files += !skip }
skip { next }
{
    text = words_of($0)
    both = last text
    if (both ~ any) {
        if (text ~ any) check(text, FNR)
        # Words across the line break: neither line has them alone.
        else if ((last " ") !~ any) check(both, FNR)
    }
    last = ""
    if ($0 ~ /[A-Za-z0-9_,]$/ && text != " ") {
        sub(/ $/, "", text)
        sub(/^.* /, "", text)
        last = " " text
    }
}
END {
    if (bad == 2) exit 2
    for (i = 1; i <= exceptions && all; i++)
        if (!used[i]) refuse(place[i] "the exception has no words in any file")
    if (!bad) print "ok     words: " patterns " patterns, " exceptions " exceptions, " files " files"
    exit bad
}' "$@"
