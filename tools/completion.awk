# What the completions of all shells need: awk -f tools/completion.awk -f tools/completion-SHELL.awk, from tools/option-tables.sh.
#
# program[1 ... programs], each with options[p] (count), name[p, o], placeholder[p, o], help[p, o], and words[p] (count): the commands
# or words that it takes, word[p, w], with word_help[p, w].
BEGIN { FS = "\t" }

$1 == "program" { program[++programs] = $2 }

$1 == "about" && match($2, /^  [^ ]+ +/) {
    item = substr($2, 3, RLENGTH - 2)
    sub(/ +$/, "", item)
    word[programs, ++words[programs]] = item
    word_help[programs, words[programs]] = substr($2, RLENGTH + 1)
}

$1 == "command" {
    word[programs, ++words[programs]] = $2
    word_help[programs, words[programs]] = $3
    has_commands[programs] = 1
}

$1 == "option" {
    name[programs, ++options[programs]] = $2
    placeholder[programs, options[programs]] = $3
    help[programs, options[programs]] = $5
}

# What a placeholder stands for: "none" (the option stands alone), "folder", "file" or "value".
function kind(text)
{
    if (text == "") return "none"
    if (text == "DIR") return "folder"
    return text ~ /^(FILE|LOG|SHAPE|STEM)/ ? "file" : "value"
}

