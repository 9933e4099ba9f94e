# Comments as text: part of tools/docs.awk, which describes it.

# Text with its public names linked. A name that does not exist is an error; "cairn_x_..." stands for several.
function linked(text,    name, out, before)
{
    out = ""
    while (match(text, /(cairn_|CAIRN_)[A-Za-z_0-9]+/)) {
        name = substr(text, RSTART, RLENGTH)
        before = substr(text, 1, RSTART - 1)
        text = substr(text, RSTART + RLENGTH)
        if (before ~ /[A-Za-z0-9_#\/]$/ || name ~ /_$/ || text ~ /^(\.[hc]|\()/ || (name in outside) || !(name in known)) {
            if (!(name in known) && name !~ /_$/ && before !~ /[A-Za-z0-9_\/]$/ && !(name in outside))
                fault(name, "no public name")
            out = out before name
        } else
            out = out before "#" name
    }
    return out text
}

# Text as Doxygen prints it literally, `code` set as code.
function literal(text,    n, i, piece, out)
{
    n = split(text, piece, /\\/)
    text = piece[1]
    for (i = 2; i <= n; i++)
        text = text "\\\\" piece[i]
    gsub(/&/, "\\&amp;", text)
    gsub(/</, "\\&lt;", text)
    gsub(/>/, "\\&gt;", text)
    gsub(/@/, "\\@", text)
    gsub(/#/, "\\#", text)
    gsub(/%/, "\\%", text)
    text = linked(text)
    n = split(text, piece, /`/)
    if (n % 2 == 0)
        return text
    for (i = 1; i <= n; i++)
        out = out (i % 2 == 0 ? "<code>" piece[i] "</code>" : piece[i])
    return out
}

# A sentence with a capital, unless it begins with a name: of one letter, with a digit or underscore, of a parameter, or compared.
function capital(text,    i, word)
{
    if (text !~ /^[a-z][a-z]+[ ,.;:-]/ && text !~ /^a [a-z]/ || text ~ /^[a-z]+ [<>=]/)
        return text
    match(text, /^[a-z]+/)
    word = substr(text, 1, RLENGTH)
    for (i = 1; i <= P_count; i++)
        if (P_name[i] == word && text !~ /^[a-z]+ [a-z]/)
            return text
    return toupper(substr(text, 1, 1)) substr(text, 2)
}

# Ends a text with a full stop.
function stopped(text)
{
    return text ~ /[.:!?]$/ ? text : text "."
}

# ---- Comments ----

# Collects the comment that begins in line i into C[1 ... comment_lines]; returns the line after it.
function comment(i,    text)
{
    comment_lines = 0
    for (; i <= lines; i++) {
        text = L[i]
        if (comment_lines == 0)
            sub(/^.*\/\*+ ?/, "", text)
        else
            sub(/^ *\* ?/, "", text)
        if (text ~ /\*\/ *$/) {
            sub(/ *\*\/ *$/, "", text)
            C[++comment_lines] = text
            return i + 1
        }
        C[++comment_lines] = text
    }
    fault("end of file", "a comment does not end")
    return i
}

function joined(    i, text)
{
    text = C[1]
    for (i = 2; i <= comment_lines; i++)
        text = text " " C[i]
    gsub(/  +/, " ", text)
    sub(/^ +/, "", text)
    sub(/ +$/, "", text)
    return text
}

# Splits C[from ... to] into blocks: B_kind is text, ol (an item "1. ..."), ul (an item "- ...") or verbatim.
function blocks(from, to,    i, text, kind)
{
    block_count = 0
    kind = ""
    for (i = from; i <= to; i++) {
        text = C[i]
        if (text ~ /^ *$/) {
            if (kind == "verbatim" && i < to && C[i + 1] ~ /^  /)
                B_text[block_count] = B_text[block_count] "\n"
            else
                kind = ""
        } else if (text ~ /^ *([0-9]+\.|-) / && kind != "verbatim") {
            B_kind[++block_count] = kind = text ~ /^ *-/ ? "ul" : "ol"
            sub(/^ *([0-9]+\.|-) /, "", text)
            B_text[block_count] = text
        } else if (kind ~ /^[uo]l$/ && text ~ /^  /) {
            sub(/^ +/, "", text)
            B_text[block_count] = B_text[block_count] " " text
        } else if (kind == "verbatim" || kind == "" && text ~ /^  /) {
            if (kind == "") {
                B_kind[++block_count] = kind = "verbatim"
                B_text[block_count] = text
            } else
                B_text[block_count] = B_text[block_count] "\n" text
        } else {
            sub(/^ +/, "", text)
            if (kind != "text") {
                B_kind[++block_count] = kind = "text"
                B_text[block_count] = text
            } else
                B_text[block_count] = B_text[block_count] " " text
        }
    }
}

# Splits a text into sentences S[1 ... returned].
function sentences(text,    n, at, rest, head)
{
    n = 0
    rest = text
    head = ""
    while (match(rest, /[^.]\. +([A-Z0-9`*(-]|[a-z_]+(, \*?[a-z_]+)*: |[a-z_]+\[)/)) {
        at = RSTART + 1
        S[++n] = head substr(rest, 1, at)
        rest = substr(rest, at + 1)
        sub(/^ +/, "", rest)
        head = ""
        # "fig. 3", "eq. (2)", "e.g. X"
        if (S[n] ~ /(fig|eq|eqs|e\.g|i\.e|vs|cf|al)\.$/) {
            head = S[n] " "
            n--
        }
    }
    S[++n] = head rest
    return n
}

# Prints the blocks from..to as paragraphs of a Doxygen comment.
function put_blocks(from, to,    i, text)
{
    for (i = from; i <= to; i++) {
        text = B_text[i]
        if (B_kind[i] == "verbatim") {
            sub(/\n+$/, "", text)
            put(" * \\verbatim\n" text "\n\\endverbatim")
        } else if (B_kind[i] ~ /^[uo]l$/) {
            if (i == from || B_kind[i - 1] != B_kind[i])
                put(" * <" B_kind[i] ">")
            put(" * <li>" literal(text) "</li>")
            if (i == to || B_kind[i + 1] != B_kind[i])
                put(" * </" B_kind[i] ">")
        } else if (B_kind[i] == "text") {
            text = literal(text)
            # "Limits: ...", "No return. ..."
            if (match(text, /^[A-Z][a-z]+( [a-z]+)?(: |\. +[A-Z])/) && text !~ /^(A|An|The) /)
                text = "<b>" substr(text, 1, match(text, /[:.]/)) "</b>" substr(text, RSTART + 1)
            put(" *\n * " text)
        }
    }
}

# The doc comment of anything but a function, of C[], with lines of its own at the end.
function put_doc(extra,    n, i, rest)
{
    blocks(1, comment_lines)
    if (block_count == 0 || B_kind[1] != "text")
        return
    n = sentences(B_text[1])
    put("/** \\brief " literal(capital(stopped(S[1]))))
    rest = ""
    for (i = 2; i <= n; i++)
        rest = rest (i > 2 ? " " : "") S[i]
    # The brief is not repeated by Doxygen.
    B_text[1] = capital(stopped(S[1])) (rest != "" ? " " rest : "")
    put_blocks(1, block_count)
    if (extra != "")
        put(" *\n" extra)
    put(" */")
}
