#!/bin/sh
# Prints the option tables of all programs in BUILD and of their commands, one after another: tools/option-tables.sh BUILD
#
# Rows of fields between tabs, as options_table() (tools/options.h) and tool_commands_table() (tools/cairn_tool.h) print them. The
# manual pages (tools/man.awk) and the completions (tools/completion-*.awk) are made of them.
build=${1:?usage: tools/option-tables.sh BUILD}
tab=$(printf '\t')

# table PROGRAM [COMMAND]...: its table, then those of its commands
table()
{
    rows=$("$build/$@" --option-table) || exit 1
    echo "$rows"
    for command in $(echo "$rows" | sed -n "s/^command$tab\([^$tab]*\)$tab.*/\1/p"); do
        (table "$@" "$command") || exit 1
    done
}

found=
for program in cairn cairn-arena cairn-scene; do
    [ ! -x "$build/$program" ] || { found=1 && table "$program"; }
done
[ -n "$found" ] || {
    echo "tools/option-tables.sh: no program in $build, expected cairn" >&2
    exit 1
}
