# Reads public headers and writes what their comments say. CONTRIBUTING.md describes the form of the comments.
#
#   awk -f tools/docs-text.awk -f tools/docs-functions.awk -f tools/docs.awk HEADER
#                                                 the header as Doxygen reads it (an input filter)
#   awk -v mode=params ... HEADER...              parameter structs, tab separated, one field a line:
#                                                 header, struct, type, name, unit, range, default, meaning
#
# A field of a parameter struct without unit, range (default): meaning is an error in mode params.

BEGIN {
    faults = 0
    # Characters of a sentence that documents a parameter by naming it.
    MENTION = 80
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
        } else if (line ~ /^ +CAIRN_[A-Z_]+ = -?[0-9]+,?$/ && line !~ /CAIRN_MODE/) {
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
    exit (faults > 0)
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

# Reads the fields of a struct from line i on: F_doc, F_type, F_name, F_decl (the declaration), F_first (1: the first field under
# its comment, 2: the second ...). Returns the line of "}".
function fields(i, name,    text, pending, decl, n, k, piece, type)
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
            # The type has a table of its own.
            unit = range = value = ""
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

# ---- Declarations ----

# Reads a prototype from line i on, up to ";" or "{"; returns the line after it, without the body.
function prototype(i,    text, at, depth, k, c)
{
    proto = L[i]
    while (proto !~ /;/ && L[i + 1] !~ /^\{/ && i < lines) {
        text = L[++i]
        sub(/^ +/, "", text)
        proto = proto (proto ~ /\($/ ? "" : " ") text
    }
    i++
    if (L[i] ~ /^\{/) {
        while (i <= lines && L[i] !~ /^\}/)
            i++
        i++
        proto = proto ";"
    }
    sub(/ *CAIRN_FILE_ERROR_FORMAT\([^()]*\)/, "", proto)
    sub(/^CAIRN_(CHECKED|INLINED) /, "", proto)
    text = proto
    sub(/^(static )?inline /, "", text)
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
function file(    i, k, held, module, name, text, part, extra, end)
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
            # The text below the title of a section belongs to the module.
            i = comment(i)
            if (comment_lines > 1) {
                blocks(2, comment_lines)
                gsub(/^-+ +| +-+$/, "", C[1])
                put("/** @} */\n/** \\addtogroup " module "\n * <b>" literal(C[1]) "</b>\n *")
                put_blocks(1, block_count)
                put(" * @{ */")
            }
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
            # The comments of the fields overwrite that of the struct.
            keep_comment()
            end = fields(i + 1, name)
            extra = name ~ /_params$/ ? params_table(name) : ""
            restore_comment()
            # The table has a column for the defaults.
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
function enumerators(i,    text, pending)
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
