# Functions and their comments: part of tools/docs.awk, which describes it.

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
function array_of(name,    k)
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
function put_function(type, name, list,    i, k, n, m, text, last, cost, brief, prose, returns, value_in, is_void, j, entry, action)
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
    value_in = "" # where the sentence about the returned value stands: brief or prose
    for (k = 1; k <= block_count; k++) {
        if (B_kind[k] != "text")
            continue
        n = sentences(B_text[k])
        prose = ""
        m = 0 # the status of the sentence before, in R_text
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
                if (!(P_name[j] in P_mention) && length(text) <= MENTION && has_word(text, P_name[j]))
                    P_mention[P_name[j]] = text
            if (brief == "")
                brief = text
            else if (!is_void && text ~ /^Returns /) {
                # "Returns 1 when ... Returns 0 when ..."
                if (value_in != "brief")
                    value_in = "prose"
                returns = returns (returns == "" ? "" : " ") text
                continue
            } else
                prose = prose (prose == "" ? "" : " ") text
            if (!is_void && returns == "" && text ~ /(^|[a-z,;] )[Rr]eturns? |[Ss]tatuses|[Ss]tatus of/) {
                returns = text
                value_in = text == brief && type != "cairn_status" ? "brief" : "prose"
                # "Writes the value and returns its length."
                if (match(text, /(and|;) returns /)) {
                    returns = substr(text, RSTART + RLENGTH)
                    value_in = "prose"
                }
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
