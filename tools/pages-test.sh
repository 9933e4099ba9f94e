#!/bin/bash
# Whether every command has a manual page with all its options, and what is completed: tools/pages-test.sh BUILD
#
# Commands and options are those that --help lists. Needs `make man completion`. zsh and fish are tried where they are installed.
build=${1:?usage: tools/pages-test.sh BUILD}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
fail()
{
    echo "FAILED pages: $*"
    failed=1
}

# commands: all programs and commands, a line each
commands()
{
    "$build/cairn" --help | sed -n 's/^  \([a-z]*\)  .*/cairn \1/p' | grep -v '^cairn cairn'
    "$build/cairn" eval --help | sed -n 's/^  \([a-z]*\)  .*/cairn eval \1/p' | grep -v 'eval cairn'
    for program in cairn-arena cairn-scene; do
        [ ! -x "$build/$program" ] || echo $program
    done
}

# lacks FOLDER: what the pages in it lack, a line each
lacks()
{
    commands | while read -r command; do
        page=$1/${command// /-}.1
        if [ ! -s "$page" ]; then
            echo "no page of $command"
            continue
        fi
        man -l "$page" >"$work/text"
        # shellcheck disable=SC2086
        "$build"/$command --help | sed -n 's/^  \(-[^ ]*\)\( [^ ]*\)\{0,1\} .*/\1\2/p' | while read -r option; do
            grep -q "^ *$option\( \|\$\)" "$work/text" || echo "no option $option in the page of $command"
        done
    done
}
export MANWIDTH=80 MANROFFOPT=-ww

number=$(commands | wc -l)
[ "$number" -ge 16 ] || fail "--help lists $number commands only"
lacks "$build/man" >"$work/lacks" 2>"$work/warnings"
[ ! -s "$work/lacks" ] || fail "$(cat "$work/lacks")"
[ ! -s "$work/warnings" ] || fail "groff: $(cat "$work/warnings")"

# A row left out of a table, and a command left out, are found.
planted()
{
    mkdir -p "$work/planted" && awk -v folder="$work/planted" -v version=0 -f tools/man.awk "$work/tables"
    lacks "$work/planted" 2>/dev/null
}
grep -v "^option	--clear	" "$build/option-tables.txt" >"$work/tables"
[ "$(planted | grep -c 'no option --clear M in the page of cairn map$')" = 1 ] || fail "a missing option is not found"
rm -rf "$work/planted"
sed '/^program	cairn map$/,/^option	--version/d' "$build/option-tables.txt" >"$work/tables"
[ "$(planted)" = "no page of cairn map" ] || fail "a missing page is not found"

# Versions in one shape, and help of commands.
commands | while read -r command; do
    # shellcheck disable=SC2086
    [ "$("$build"/$command --version)" = "$("$build/cairn" --version)" ] || echo "$command"
done >"$work/versions"
[ ! -s "$work/versions" ] || fail "another --version: $(cat "$work/versions")"
[ "$("$build/cairn" eval --version)" = "$("$build/cairn" --version)" ] || fail "another --version: cairn eval"
for command in map 'eval relations'; do
    # shellcheck disable=SC2086
    [ "$("$build/cairn" help $command)" = "$("$build/cairn" $command --help)" ] || fail "cairn help $command"
done

# bash: completed WORD... prints what the last word is completed to.
completed()
{
    (
        # shellcheck disable=SC1090
        source "$build/completion/cairn.bash"
        COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
        cd "$work/files" && _cairn && echo "${COMPREPLY[*]}"
    )
}
build=$(cd "$build" && pwd)
mkdir -p "$work/files/folder" && touch "$work/files/drive.log"
# expect TEXT WORD...
expect()
{
    wanted=$1
    shift
    said=$(completed "$@")
    [ "$said" = "$wanted" ] || fail "bash: '$*' is completed to '$said', expected '$wanted'"
}
expect 'map match' cairn ma
expect '--release --resolution --report' cairn map --re
expect 'map match merge model' cairn-float help m
expect '--range --range-max --range-scale' cairn help map --ran
expect 'map poses relations' cairn eval ''
expect '--log' cairn eval relations --l
expect 'drive.log folder' cairn map ''
expect 'drive.log' cairn map -o folder d
expect 'folder' cairn map -o ''
expect '' cairn map --window ''
expect 'drive.log' cairn map --report = d
expect 'rooms round' cairn-arena ro
expect '--seed --sensor' cairn-arena maze --se

if command -v zsh >/dev/null; then
    zsh -n "$build/completion/_cairn" || fail "zsh does not read its completion"
fi
if command -v fish >/dev/null; then
    fished()
    {
        fish --no-config -c "source '$build/completion/cairn.fish'; complete -C '$1'" | cut -f 1 | sort | paste -s -d ' ' -
    }
    [ "$(fished 'cairn ma')" = 'map match' ] || fail "fish: 'cairn ma' is completed to '$(fished 'cairn ma')'"
    [ "$(fished 'cairn eval map --l')" = --least ] || fail "fish: 'cairn eval map --l' is completed to '$(fished 'cairn eval map --l')'"
    [ "$(fished 'cairn map --rel')" = --release ] || fail "fish: 'cairn map --rel' is completed to '$(fished 'cairn map --rel')'"
fi

[ $failed -eq 0 ] && echo "ok     pages: $number commands with all options, groff without warnings; completion"
exit $failed
