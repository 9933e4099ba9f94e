# Completion for fish: build/completion/cairn.fish
function quoted(text)
{
    gsub(/\\/, "\\\\", text)
    gsub(/'/, "\\'", text)
    return "'" text "'"
}

# The test that the words of a program, but its first, have been typed: exactly those, or those and others.
function condition(p, exactly)
{
    return "'__cairn_typed " exactly substr(program[p], length(first_word(program[p])) + 1) "'"
}

function first_word(text) { return substr(text, 1, index(text " ", " ") - 1) }

function complete(p, exactly, rest) { print "complete -c " first_word(program[p]) " -n " condition(p, exactly) " " rest }

END {
    print "# fish completion for cairn, made from the option tables of its programs"
    print "complete -c cairn-float -w cairn"
    print "function __cairn_typed -d 'the words typed begin with these, behind 0; behind 1 they are these'"
    print "    set -l typed (commandline -opc)[2..-1]"
    print "    set -l exactly $argv[1]"
    print "    set -l wanted $argv[2..-1]"
    print "    test \"$typed[1]\" != help; or set -e typed[1]"
    print "    test $exactly = 0; or test (count $typed) -eq (count $wanted); or return 1"
    print "    for at in (seq (count $wanted))"
    print "        test \"$typed[$at]\" = \"$wanted[$at]\"; or return 1"
    print "    end"
    print "end"
    for (p = 1; p <= programs; p++) {
        if (program[p] == "cairn") complete(p, 1, "-f -a help -d 'what a command takes'")
        for (w = 1; w <= words[p]; w++) complete(p, 1, "-f -a " word[p, w] " -d " quoted(word_help[p, w]))
        for (o = 1; o <= options[p]; o++) {
            what = kind(placeholder[p, o])
            option = name[p, o] ~ /^--/ ? "-l " substr(name[p, o], 3) : "-s " substr(name[p, o], 2)
            argument = what == "none" ? "" : what == "folder" ? " -x -a '(__fish_complete_directories)'" : what == "file" ? " -r -F" : " -x"
            complete(p, has_commands[p] + 0, option argument " -d " quoted(help[p, o]))
        }
    }
}
