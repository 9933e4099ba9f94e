# Reads public headers and writes what their comments say. CONTRIBUTING.md describes the form of the comments.
#
#   awk -f tools/docs.awk HEADER                  the header as Doxygen reads it (an input filter)
#   awk -v mode=params -f tools/docs.awk HEADER... parameter structs, tab separated, one field a line:
#                                                 header, struct, type, name, unit, range, default, meaning
#
# A field of a parameter struct without unit, range (default): meaning is an error in mode params.

BEGIN {
    faults = 0
    # Names of the build and of the environment.
    outside["CAIRN_FLOAT"] = outside["CAIRN_DOUBLE"] = outside["CAIRN_VISION"] = outside["CAIRN_APPEARANCE"] = 1
    while ((getline line < "tools/docs-parameters.txt") > 0) {
        if (line ~ /^#/ || line !~ /\|/)
            continue
        split(line, part, / *\| */)
        standard[part[1] " " part[2]] = part[3]
    }
    # Objects, which are structs that are not open, and all public names.
    while (("cat include/cairn/*.h" | getline line) > 0) {
        if (line ~ /^ *(\/\*|\*)/)
            continue
        if (line ~ /^typedef struct cairn_[a-z_0-9]+ cairn_[a-z_0-9]+;$/) {
            split(line, part, /[ ;]/)
            opaque[part[4]] = 1
        }
        sub(/\/\*.*/, "", line)
        while (match(line, /(cairn_|CAIRN_)[A-Za-z_0-9]+/)) {
            known[substr(line, RSTART, RLENGTH)] = 1
            line = substr(line, RSTART + RLENGTH)
        }
    }
    # What a status means, for those that a comment lists without a reason.
    while ((getline line < "include/cairn/status.h") > 0) {
        if (line ~ /^ +\/\* /)
            text = ""
        if (line ~ /^ +(\/\*|\*) /) {
            sub(/^ +(\/\*|\*) /, "", line)
            sub(/ *\*\/$/, "", line)
            text = text (text == "" ? "" : " ") line
        } else if (line ~ /^ +CAIRN_[A-Z_]+ = -?[0-9]+,?$/ && !(/CAIRN_MODE/)) {
            split(line, part, " ")
            status_text[part[1]] = text
        }
    }
}

FNR == 1 && NR > 1 { file() }
FNR == 1 { header = FILENAME; lines = 0 }
{ L[++lines] = $0 }
END {
    if (lines)
        file()
    exit faults > 0
}

function fault(where, what)
{
    sub(/^ +/, "", where)
    print header ": " where ": " what > "/dev/stderr"
    faults++
}

function put(text)
{
    if (mode == "")
        print text
}

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

# Splits C[from ... to] into blocks: B_kind is text, list or verbatim.
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
        } else if (text ~ /^ *[0-9]+\. / && (kind == "" || kind == "list" || kind == "text")) {
            sub(/^ *[0-9]+\. /, "", text)
            B_kind[++block_count] = kind = "list"
            B_text[block_count] = text
        } else if (kind == "list" && text ~ /^  /) {
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
function sentences(text,    n, at, rest, head, tail)
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
        } else if (B_kind[i] == "list") {
            if (i == from || B_kind[i - 1] != "list")
                put(" * <ol>")
            put(" * <li>" literal(text) "</li>")
            if (i == to || B_kind[i + 1] != "list")
                put(" * </ol>")
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

# ---- Parameter structs ----

# Splits "unit, range (default): meaning" into unit, range, value, meaning. Returns 0 when it is not of this form.
function spec(text,    at, head)
{
    at = index(text, "): ")
    if (at < 2)
        return 0
    head = substr(text, 1, at - 1)
    meaning = substr(text, at + 3)
    if (!match(head, / \([^()]*$/))
        return 0
    value = substr(head, RSTART + 2)
    head = substr(head, 1, RSTART - 1)
    unit = ""
    if (head !~ /^(any$|finite$|[-<>0-9]|CAIRN_|[a-z_.]+ \.\.\. )/) {
        if (!match(head, /, (any$|finite$|[-<>0-9]|CAIRN_|[a-z_.]+ \.\.\. )/))
            return 0
        unit = substr(head, 1, RSTART - 1)
        head = substr(head, RSTART + 2)
    }
    range = head
    return meaning != "" && value != ""
}

# Reads the fields of a struct from line i on: F_doc, F_type, F_name, F_end (what follows the name). Returns the line of "}".
function fields(i, name,    text, pending, decl, n, k, piece, type, j)
{
    field_count = 0
    pending = ""
    for (; i <= lines && L[i] !~ /^\}/;) {
        if (L[i] ~ /^ *$/ || L[i] ~ /^#/) {
            i++
            continue
        }
        if (L[i] ~ /^ *\/\*/) {
            i = comment(i)
            pending = joined()
            continue
        }
        decl = L[i]
        while (decl !~ /;/ && i < lines) {
            text = L[++i]
            sub(/^ +/, " ", text)
            decl = decl text
        }
        if (match(decl, /; *\/\*/)) {
            text = decl
            decl = substr(decl, 1, RSTART)
            i = comment(i)
            if (pending == "")
                pending = joined()
        } else
            i++
        sub(/^ +/, "", decl)
        sub(/;.*$/, "", decl)
        if (match(decl, /\(\*[a-z_]+\)\(/)) {
            F_type[++field_count] = substr(decl, 1, RSTART - 1)
            F_name[field_count] = substr(decl, RSTART + 2, RLENGTH - 4)
            F_decl[field_count] = decl
            F_doc[field_count] = pending
            F_first[field_count] = 1
        } else {
            n = split(decl, piece, /, */)
            if (!match(piece[1], /[ *][A-Za-z_0-9]+(\[.*)?$/)) {
                fault(name, "cannot read the field \"" decl "\"")
                return i
            }
            # The type without the stars of the first declarator.
            type = substr(piece[1], 1, RSTART)
            piece[1] = substr(piece[1], RSTART + 1)
            while (type ~ /\*$/) {
                piece[1] = "*" piece[1]
                type = substr(type, 1, length(type) - 1)
            }
            sub(/ +$/, "", type)
            for (k = 1; k <= n; k++) {
                F_type[++field_count] = type
                F_decl[field_count] = type " " piece[k]
                text = piece[k]
                sub(/^\*+/, "", text)
                sub(/\[.*$/, "", text)
                F_name[field_count] = text
                F_doc[field_count] = pending
                F_first[field_count] = k
                if (piece[k] ~ /^\*/)
                    F_type[field_count] = type " *"
            }
        }
        pending = ""
    }
    return i
}

function cell(text)
{
    return "<td>" literal(text) "</td>"
}

# The table of a parameter struct, or its lines in mode params.
function params_table(name,    i, k, out, part, n, nested)
{
    out = " * <table class=\"params-table doxtable\"><tr><th>Field</th><th>Type</th><th>Meaning</th><th>Unit</th><th>Range</th><th>Default</th></tr>"
    for (i = 1; i <= field_count; i++) {
        nested = F_type[i] ~ /^cairn_[a-z_]+_params$/
        if (nested) {
            unit = range = ""
            value = "see " F_type[i]
            meaning = F_doc[i]
            if (meaning == "")
                fault(name "." F_name[i], "no comment, expected what the nested parameters are for")
        } else if (!spec(F_doc[i])) {
            fault(name "." F_name[i], "the comment is \"" F_doc[i] "\", expected \"unit, range (default): meaning\"")
            continue
        }
        # Several fields under one comment: "(640 and 480)".
        if (!nested && (F_first[i] > 1 || i < field_count && F_first[i + 1] > 1)) {
            n = split(value, part, / and /)
            if (n > 1)
                value = part[F_first[i]]
        }
        if (mode == "params")
            print header "\t" name "\t" F_type[i] "\t" F_name[i] "\t" unit "\t" range "\t" value "\t" meaning
        F_doc[i] = meaning
        out = out "\n * <tr><td><code>" F_name[i] "</code></td>" cell(F_type[i]) cell(capital(meaning)) cell(unit) cell(range) cell(value) "</tr>"
    }
    return out "\n * </table>"
}

# ---- Functions ----

# The parameters of a prototype: P_count, P_type, P_name.
function parameters(list,    n, i, depth, c, piece, text)
{
    P_count = 0
    depth = 0
    text = ""
    gsub(/[ \n]+/, " ", list)
    for (i = 1; i <= length(list) + 1; i++) {
        c = substr(list, i, 1)
        if (c == "(")
            depth++
        if (c == ")")
            depth--
        if (c == "" || c == "," && depth == 0) {
            sub(/^ +/, "", text)
            sub(/ +$/, "", text)
            if (text != "" && text != "void" && text != "...") {
                sub(/\[.*$/, "", text)
                # "(*boxes)[4]"
                gsub(/[()]/, "", text)
                match(text, /[A-Za-z_0-9]+$/)
                P_name[++P_count] = substr(text, RSTART)
                piece = substr(text, 1, RSTART - 1)
                sub(/ +$/, "", piece)
                P_type[P_count] = piece
            } else if (text == "...") {
                P_name[++P_count] = "..."
                P_type[P_count] = ""
            }
            text = ""
        } else
            text = text c
    }
}

# True when names "a, *b" are all parameters of the function; they are then N[1 ... name_count].
function are_parameters(names,    i, k, found)
{
    gsub(/\*/, "", names)
    name_count = split(names, N, /, /)
    for (i = 1; i <= name_count; i++) {
        found = 0
        for (k = 1; k <= P_count; k++)
            if (P_name[k] == N[i])
                found = 1
        if (!found)
            return 0
    }
    return 1
}

# Documents the parameters N[]: one row of the table for all.
function explain(text,    i, all)
{
    all = N[1]
    for (i = 2; i <= name_count; i++)
        all = all "," N[i]
    for (i = 1; i <= name_count; i++)
        if (!(N[i] in P_text)) {
            P_text[N[i]] = text
            P_row[N[i]] = i == 1 ? all : ""
        }
}

function has_word(text, word,    at, before, after, rest, seen)
{
    rest = text
    seen = ""
    while ((at = index(rest, word)) > 0) {
        before = at > 1 ? substr(rest, at - 1, 1) : substr(seen, length(seen), 1)
        after = substr(rest, at + length(word), 1)
        if (before !~ /[A-Za-z0-9_.>]/ && after !~ /[A-Za-z0-9_(]/)
            return 1
        seen = substr(rest, 1, at)
        rest = substr(rest, at + 1)
    }
    return 0
}

# The statuses of a sentence: "CAIRN_A, CAIRN_B (reason), CAIRN_C: reason; CAIRN_D: reason."
function statuses(text,    n, i, k, list, name, reason)
{
    sub(/\.$/, "", text)
    gsub(/[;,] (also |and |or )?CAIRN_/, "\001CAIRN_", text)
    n = split(text, list, /\001/)
    for (i = 1; i <= n; i++) {
        match(list[i], /^CAIRN_[A-Z_]+/)
        name = substr(list[i], 1, RLENGTH)
        reason = substr(list[i], RLENGTH + 1)
        if (!(name in status_text)) {
            R_text[R_count] = R_text[R_count] ", " list[i]
            continue
        }
        sub(/^(:|,)? +/, "", reason)
        if (reason ~ /^\([^()]*\)$/)
            reason = substr(reason, 2, length(reason) - 2)
        if (reason == "")
            reason = status_text[name]
        for (k = 1; k <= R_count && R_name[k] != name; k++)
            continue
        if (k <= R_count)
            R_text[k] = R_text[k] "; " reason
        else {
            R_name[++R_count] = name
            R_text[R_count] = reason
        }
    }
}

function is_status(text)
{
    return match(text, /^CAIRN_[A-Z_]+/) && substr(text, 1, RLENGTH) in status_text
}

# The array whose shape "[name]" names the parameter; "" for none.
function array_of(name,    k, shape)
{
    for (k = 1; k <= P_count; k++)
        if (P_name[k] in P_text && (index(P_text[P_name[k]], "[" name "]") || index(P_text[P_name[k]], "[*" name "]")))
            return P_name[k]
    return ""
}

# What a parameter means by its name and type alone; "" for most.
function usual(k,    type, plain, name)
{
    type = P_type[k]
    name = P_name[k]
    plain = type
    sub(/^const /, "", plain)
    if ((type " " name) in standard)
        return standard[type " " name]
    if ((plain " " name) in standard)
        return standard[plain " " name]
    if (plain ~ /^cairn_[a-z_0-9]+ \*$/ && name == "params")
        return "parameters, see " substr(plain, 1, length(plain) - 2)
    if (plain == "cairn_pose" && name ~ /^[a-z]+_[a-z]+$/)
        return "pose of `" substr(name, index(name, "_") + 1) "` in the frame of `" substr(name, 1, index(name, "_") - 1) "`: m and rad"
    sub(/ \*+$/, "", plain)
    if (plain in opaque) {
        if (type ~ /\*\*$/)
            return "receives the created object"
        return type ~ /^const / ? "object to read" : "object to work on"
    }
    return ""
}

# The doc comment of a function or function type from C[].
function put_function(type, name, list,    i, k, n, m, text, last, cost, brief, prose, returns, value_in, is_void, from, to, order, entry, action)
{
    parameters(list)
    split("", P_text)
    split("", P_row)
    R_count = 0
    last = comment_lines
    # The list of parameters after the last empty line.
    i = comment_lines
    while (i >= 1 && C[i] !~ /^ *$/)
        i--
    if (match(C[i + 1], /^\*?[a-z_0-9]+(, \*?[a-z_0-9]+)*: /) && are_parameters(substr(C[i + 1], 1, RLENGTH - 2))) {
        last = i - 1
        entry = ""
        for (i = i + 1; i <= comment_lines + 1; i++) {
            if (i > comment_lines || match(C[i], /^\*?[a-z_0-9]+(, \*?[a-z_0-9]+)*: /)) {
                if (entry != "") {
                    match(entry, /: /)
                    if (!are_parameters(substr(entry, 1, RSTART - 1)))
                        fault(name, "\"" entry "\" is no parameter")
                    else
                        explain(substr(entry, RSTART + 2))
                }
                entry = i > comment_lines ? "" : C[i]
            } else {
                text = C[i]
                sub(/^ +/, "", text)
                entry = entry " " text
            }
        }
    }
    blocks(1, last)
    is_void = type == "void"
    brief = returns = cost = ""
    value_in = ""
    for (k = 1; k <= block_count; k++) {
        if (B_kind[k] != "text")
            continue
        n = sentences(B_text[k])
        prose = ""
        m = 0 # statuses before this sentence
        for (i = 1; i <= n; i++) {
            text = S[i]
            if (match(text, /^\*?[a-z_0-9]+(, \*?[a-z_0-9]+)*: /) && are_parameters(substr(text, 1, RLENGTH - 2))) {
                explain(substr(text, RLENGTH + 1))
                continue
            }
            # "*count is set to their number."
            if (match(text, /^\*[a-z_0-9]+,? /) && are_parameters(substr(text, 2, index(text ",", ",") < RLENGTH ? index(text, ",") - 2 : RLENGTH - 2))) {
                text = substr(text, RLENGTH + 1)
                sub(/^is /, "", text)
                explain(text)
                continue
            }
            if (type == "cairn_status" && is_status(text)) {
                statuses(text)
                m = R_count
                continue
            }
            if (m > 0 && text ~ /^(Both|It|They) /) {
                R_text[m] = R_text[m] ". " text
                continue
            }
            if (text ~ /^(Cost|Linear|Constant time|Logarithmic|Quadratic)/) {
                sub(/^Cost: /, "", text)
                cost = cost (cost == "" ? "" : " ") capital(text)
                continue
            }
            for (j = 1; j <= P_count; j++)
                if (!(P_name[j] in P_mention) && has_word(text, P_name[j]))
                    P_mention[P_name[j]] = text
            if (brief == "")
                brief = text
            else
                prose = prose (prose == "" ? "" : " ") text
            if (!is_void && returns == "" && text ~ /(^|[a-z,;] )[Rr]eturns? |[Ss]tatuses|[Ss]tatus of/) {
                returns = text
                value_in = text == brief ? "brief" : "prose"
            }
        }
        B_text[k] = prose
        if (prose == "")
            B_kind[k] = "none"
    }
    if (brief == "") {
        split("", P_mention)
        return # Doxygen says that the function is not documented.
    }
    action = brief ~ /^(Adds|Allocates|Appends|Applies|Charges|Checks|Computes|Continues|Copies|Creates|Detects|Escapes|Fills|Finds|Fits|Frees|Gets|Merges|Opens|Parses|Reads|Records|Removes|Reports|Scores|Solves|Sorts|Starts|Validates|Works|Writes)/
    if (returns == "" && !is_void && type != "cairn_status" && !action) {
        returns = brief
        value_in = "brief"
    }
    put("/** \\brief " literal(capital(stopped(brief))))
    if (value_in != "brief") {
        # The brief is not repeated by Doxygen.
        B_text[1] = capital(stopped(brief)) (B_kind[1] == "none" ? "" : " " B_text[1])
        B_kind[1] = "text"
    }
    put_blocks(1, block_count)
    if (cost != "")
        put(" * \\par Cost\n * " literal(stopped(cost)))
    for (k = 1; k <= P_count; k++) {
        text = P_name[k]
        if (text in P_text)
            entry = P_text[text]
        else if ((entry = usual(k)) == "") {
            if (array_of(text) != "")
                entry = "number of elements of `" array_of(text) "`"
            else if (text in P_mention)
                entry = P_mention[text]
        }
        if (text == "..." && entry == "")
            entry = "the values to format"
        if (text in P_row)
            text = P_row[text]
        if (entry != "" && text != "")
            put(" * \\param " text " " literal(capital(stopped(entry))))
    }
    if (returns != "") {
        sub(/^Returns /, "", returns)
        put(" * \\return " literal(capital(stopped(returns))))
    } else if (R_count > 0)
        put(" * \\return A status, #CAIRN_OK on success.")
    for (i = 1; i <= R_count; i++)
        put(" * \\retval " R_name[i] " " literal(capital(stopped(R_text[i]))))
    put(" */")
    P_count = 0
    split("", P_mention)
}

# ---- Declarations ----

# Reads a prototype from line i on, up to ";" or "{"; returns the line after it, without the body.
function prototype(i,    text, at, depth, k, c, before, inline)
{
    proto = L[i]
    while (proto !~ /;/ && proto !~ /\) *$/ && proto !~ /\{/ && i < lines) {
        text = L[++i]
        sub(/^ +/, " ", text)
        proto = proto text
        # "static inline f(...)" is followed by "{"; an attribute and a broken list are not.
        if (L[i + 1] ~ /^\{/)
            break
    }
    while (proto !~ /;/ && L[i + 1] !~ /^\{/ && i < lines) {
        text = L[++i]
        sub(/^ +/, " ", text)
        proto = proto text
    }
    i++
    if (L[i] ~ /^\{/) {
        while (i <= lines && L[i] !~ /^\}/)
            i++
        i++
        proto = proto ";"
    }
    sub(/ *CAIRN_FILE_ERROR_FORMAT\([^()]*\)/, "", proto)
    sub(/^CAIRN_CHECKED /, "", proto)
    text = proto
    sub(/^static inline /, "", text)
    sub(/^typedef /, "", text)
    if (match(text, /\(\*[a-z_0-9]+\)\(/)) {
        proto_name = substr(text, RSTART + 2, RLENGTH - 4)
        proto_type = substr(text, 1, RSTART - 1)
    } else {
        match(text, /[a-z_A-Z0-9]+\(/)
        proto_name = substr(text, RSTART, RLENGTH - 1)
        proto_type = substr(text, 1, RSTART - 1)
    }
    at = RSTART + RLENGTH
    sub(/ +$/, "", proto_type)
    depth = 1
    proto_list = ""
    for (k = at; k <= length(text); k++) {
        c = substr(text, k, 1)
        if (c == "(")
            depth++
        if (c == ")" && --depth == 0)
            break
        proto_list = proto_list c
    }
    return i
}

# Reads the header L[1 ... lines]. A comment holds for all declarations up to the next empty line.
function file(    i, k, held, module, name, text, part, in_enum, enum_name, title, end, saved)
{
    name = header
    sub(/^.*\//, "", name)
    sub(/\.h$/, "", name)
    module = name
    held = 0 # 1: C[] belongs to the next declaration
    i = 1
    if (L[1] ~ /^\/\* /) {
        i = comment(1)
        sub(/^[a-z_0-9]+: /, "", C[1])
        put("/** \\addtogroup " name)
        blocks(1, comment_lines)
        k = sentences(B_text[1])
        put(" * \\brief " literal(capital(stopped(S[1]))))
        B_text[1] = capital(B_text[1])
        put_blocks(1, block_count)
        put(" * @{ */")
    } else
        fault("1", "expected a comment \"" name ": what the module is\"")
    while (i <= lines) {
        text = L[i]
        if (text ~ /^ *\/\* -+ /) {
            i = comment(i)
            held = 0
        } else if (text ~ /^ *\/\*/) {
            i = comment(i)
            held = 1
        } else if (text ~ /^ *$/) {
            held = 0
            put("")
            i++
        } else if (text ~ /^#define/) {
            if (held)
                put_doc("")
            while (L[i] ~ /\\$/)
                put(L[i++])
            put(L[i++])
        } else if (text ~ /^#|^extern "C"|^\}/) {
            put(text)
            i++
        } else if (match(text, /^typedef struct [a-z_0-9]+ \{/)) {
            split(text, part, " ")
            name = part[3]
            saved = i
            # The fields overwrite the comment: keep its documentation first.
            keep_comment()
            end = fields(i + 1, name)
            extra = name ~ /_params$/ ? params_table(name) : ""
            restore_comment()
            # The table has a column for them.
            if (extra != "") {
                for (k = 1; k <= comment_lines; k++)
                    sub(/[;.] [Dd]efaults in brackets/, "", C[k])
                sub(/^Parameters\.?$/, "Parameters of " module ".", C[1])
            }
            if (held)
                put_doc(extra)
            else
                fault(name, "no comment")
            put(text)
            for (k = 1; k <= field_count; k++) {
                if (F_doc[k] == "")
                    fault(name "." F_name[k], "no comment")
                put_line(F_doc[k])
                put("    " F_decl[k] ";")
            }
            put(L[end])
            i = end + 1
            held = 0
        } else if (text ~ /^typedef [a-z_0-9]+ [a-z_0-9]+;$/ && L[i + 1] ~ /^enum \{/) {
            split(text, part, /[ ;]/)
            if (held)
                put_doc(" * Stored in an " part[2] ".")
            else
                fault(part[3], "no comment")
            put("enum " part[3] " {")
            i = enumerators(i + 2)
            held = 0
        } else if (text ~ /^enum \{/) {
            if (held)
                put_doc("")
            else
                fault(L[i + 1], "no comment of the enumeration")
            put(text)
            i = enumerators(i + 1)
            held = 0
        } else if (text ~ /^typedef [^(]*;$/) {
            if (held)
                put_doc("")
            else
                fault(text, "no comment")
            put(text)
            i++
        } else {
            keep_comment()
            i = prototype(i)
            restore_comment()
            if (!held)
                fault(proto_name, "no comment")
            else
                put_function(proto_type, proto_name, proto_list)
            put(proto)
        }
    }
    put("/** @} */")
    lines = 0
}

function keep_comment(    k)
{
    kept_lines = comment_lines
    for (k = 1; k <= comment_lines; k++)
        kept[k] = C[k]
}

function restore_comment(    k)
{
    comment_lines = kept_lines
    for (k = 1; k <= kept_lines; k++)
        C[k] = kept[k]
}

# The doc comment of a field or an enumerator.
function put_line(text)
{
    if (text != "")
        put("/** " literal(capital(stopped(text))) " */")
}

# Enumerators from line i on, each with its comment above or behind; returns the line after "};".
function enumerators(i,    text, pending, after)
{
    pending = ""
    for (; i <= lines && L[i] !~ /^\}/;) {
        text = L[i]
        if (text ~ /^ *$/) {
            i++
            continue
        }
        if (text ~ /^ *\/\*/) {
            i = comment(i)
            pending = joined()
            continue
        }
        if (match(text, /\/\*/)) {
            after = i
            text = substr(text, 1, RSTART - 1)
            i = comment(i)
            pending = joined()
        } else
            i++
        if (pending == "")
            fault(text, "no comment")
        put_line(pending)
        put(text)
        pending = ""
    }
    put("};")
    return i + 1
}
