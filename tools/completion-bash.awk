# Completion for bash: build/completion/cairn.bash
function list(p, wanted,    o, text)
{
    for (o = 1; o <= options[p]; o++)
        if (wanted == "" || kind(placeholder[p, o]) == wanted) text = text " " name[p, o]
    return substr(text, 2)
}

function entries(title, wanted,    p, text)
{
    print "    " title "="
    print "    case $program in"
    for (p = 1; p <= programs; p++) {
        text = list(p, wanted)
        if (text != "") print "    '" program[p] "') " title "='" text "' ;;"
    }
    print "    esac"
}

END {
    print "# bash completion for cairn, made from the option tables of its programs"
    print "_cairn()"
    print "{"
    print "    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} program=${COMP_WORDS[0]##*/} at=1"
    print "    local words options folders files values"
    print "    COMPREPLY=()"
    print "    [ \"$program\" != cairn-float ] || program=cairn"
    print "    # --option=value is three words for bash."
    print "    if [ \"$current\" = = ]; then"
    print "        current="
    print "    elif [ \"$previous\" = = ]; then"
    print "        previous=${COMP_WORDS[COMP_CWORD - 2]}"
    print "    fi"
    print "    while [ $at -lt $COMP_CWORD ]; do"
    print "        case \"$program ${COMP_WORDS[at]}\" in"
    print "        'cairn help') ;;"
    for (p = 1; p <= programs; p++)
        if (program[p] ~ / /) print "        '" program[p] "') program=\"$program ${COMP_WORDS[at]}\" ;;"
    print "        *) break ;;"
    print "        esac"
    print "        at=$((at + 1))"
    print "    done"
    entries("options", "")
    entries("folders", "folder")
    entries("files", "file")
    entries("values", "value")
    print "    words="
    print "    case $program in"
    for (p = 1; p <= programs; p++) {
        if (!words[p]) continue
        text = program[p] == "cairn" ? "help" : ""
        for (w = 1; w <= words[p]; w++) text = text (text == "" ? "" : " ") word[p, w]
        print "    '" program[p] "') words='" text "' ;;"
    }
    print "    esac"
    print "    case \" $folders \" in *\" $previous \"*)"
    print "        mapfile -t COMPREPLY < <(compgen -d -- \"$current\")"
    print "        compopt -o filenames 2>/dev/null"
    print "        return 0 ;;"
    print "    esac"
    print "    case \" $values \" in *\" $previous \"*) return 0 ;; esac"
    print "    case \" $files \" in *\" $previous \"*) options= words= ;; esac"
    print "    if [ -n \"$options\" ] && [ \"${current#-}\" != \"$current\" ]; then"
    print "        mapfile -t COMPREPLY < <(compgen -W \"$options\" -- \"$current\")"
    print "    elif [ -n \"$words\" ] && [ $at -eq $COMP_CWORD ]; then"
    print "        mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$current\")"
    print "    else"
    print "        mapfile -t COMPREPLY < <(compgen -f -- \"$current\")"
    print "        compopt -o filenames 2>/dev/null"
    print "    fi"
    print "    return 0"
    print "}"
    printf "complete -F _cairn cairn-float"
    for (p = 1; p <= programs; p++)
        if (program[p] !~ / /) printf " %s", program[p]
    print ""
}
