# Writes a manual page for each program and command: sh tools/option-tables.sh BUILD | awk -v folder=DIR -v version=X.Y.Z -f tools/man.awk
#
# The description is filled, but its items ("  word   text") and what follows an empty line stay apart.
BEGIN { FS = "\t" }

# Text of the pages: no character of it is a command; a minus of an option can be copied.
function plain(text)
{
    gsub(/\\/, "\\e", text)
    gsub(/--/, "\\-\\-", text)
    text = " " text
    while (match(text, /[ (]-[A-Za-z]/)) text = substr(text, 1, RSTART) "\\" substr(text, RSTART + 1)
    text = substr(text, 2)
    return text ~ /^[.']/ ? "\\&" text : text
}

function page_of(program,    name)
{
    name = program
    gsub(/ /, "-", name)
    return name
}

# The first words of a description, in lower case.
function summary_of(text)
{
    sub(/[:.].*/, "", text)
    return tolower(substr(text, 1, 1)) substr(text, 2)
}

function out(text) { print text >file }

function section(title)
{
    if (title != shown) out(".SH " title)
    shown = title
}

function finish()
{
    if (file == "") return
    section("EXIT STATUS")
    out(".TP\n0\ndone\n.TP\n1\nout of memory, or standard output could not be written\n.TP\n2\nbad input, output folder or command line; a line on standard error says what was expected")
    if (program != "cairn") {
        section("SEE ALSO")
        out(".BR cairn (1)")
    }
    close(file)
}

$1 == "program" {
    finish()
    program = $2
    file = folder "/" page_of(program) ".1"
    shown = ""
    described = listed = 0
}

$1 == "synopsis" { synopsis = $2 }

$1 == "about" {
    if (!described++) {
        out(".TH " toupper(page_of(program)) " 1 \"\" \"cairn " version "\" \"cairn\"")
        out(".nh\n.ad l")
        section("NAME")
        out(page_of(program) " \\- " (program in summary ? plain(summary[program]) : summary_of($2)))
        section("SYNOPSIS")
        out(".B " plain(program) "\n" plain(synopsis))
        section("DESCRIPTION")
    }
    if ($2 == "")
        out(".PP")
    else if (match($2, /^  [^ ]+ +/)) {
        word = substr($2, 3, RLENGTH - 2)
        text = substr($2, RLENGTH + 1)
        sub(/ +$/, "", word)
        out(".TP\n.B " plain(word) "\n" plain(text))
    } else
        out(plain($2))
}

$1 == "option" {
    section("OPTIONS")
    out(".TP\n.B " plain($2) ($3 == "" ? "" : " \\fI" plain($3) "\\fR"))
    out(plain($5) ($4 == "" ? "" : " [" plain($4) "]"))
}

$1 == "command" {
    section("COMMANDS")
    summary[program " " $2] = $3
    out(".TP\n.BR " page_of(program " " $2) " (1)\n" plain($3))
}

END { finish() }
