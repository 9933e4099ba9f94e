# Completion for zsh: build/completion/_cairn
function quoted(text)
{
    gsub(/\\/, "\\\\", text)
    gsub(/[\[\]:]/, "\\\\&", text)
    gsub(/'/, "'\\''", text)
    return text
}

function function_of(text)
{
    gsub(/[ -]/, "_", text)
    return "_" text "_"
}

function action(what) { return what == "folder" ? "_files -/" : what == "file" ? "_files" : " " }

function list_words(p,    w)
{
    print "    local -a words_of"
    print "    words_of=("
    if (program[p] == "cairn") print "        'help:what a command takes'"
    for (w = 1; w <= words[p]; w++) print "        '" quoted(word[p, w]) ":" quoted(word_help[p, w]) "'"
    print "    )"
}

function list_options(p,    o, what)
{
    for (o = 1; o <= options[p]; o++) {
        what = kind(placeholder[p, o])
        printf "        '%s%s[%s]", name[p, o], what != "none" && name[p, o] ~ /^--/ ? "=" : "", quoted(help[p, o])
        print (what == "none" ? "" : ":" quoted(placeholder[p, o]) ":" action(what)) "' \\"
    }
}

END {
    printf "#compdef cairn-float"
    for (p = 1; p <= programs; p++)
        if (program[p] !~ / /) printf " %s", program[p]
    print "\n# zsh completion for cairn, made from the option tables of its programs"
    for (p = 1; p <= programs; p++) {
        print "\n" function_of(program[p]) "()\n{"
        if (words[p]) list_words(p)
        if (has_commands[p]) {
            print "    if (( CURRENT == 2 )); then"
            print "        _describe -t commands command words_of"
            print "        return"
            print "    fi"
            print "    shift words"
            print "    (( CURRENT-- ))"
            print "    case ${words[1]} in"
            if (program[p] == "cairn") print "    help) " function_of(program[p]) " ;;"
            for (w = 1; w <= words[p]; w++) print "    " word[p, w] ") " function_of(program[p] " " word[p, w]) " ;;"
            print "    esac"
        } else {
            print "    _arguments \\"
            list_options(p)
            print "        '*: :" (words[p] ? "{_describe -t words word words_of}" : "_files") "'"
        }
        print "}"
    }
    print "\ncase $service in"
    print "cairn | cairn-float) " function_of("cairn") " ;;"
    for (p = 1; p <= programs; p++)
        if (program[p] !~ / / && program[p] != "cairn") print program[p] ") " function_of(program[p]) " ;;"
    print "esac"
}
