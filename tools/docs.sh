#!/bin/sh
# The API reference as HTML, by Doxygen from the public headers: tools/docs.sh BUILD [INCLUDE]
#
# A group for each folder of src/ and each module, in the order of tools/modules.txt. tools/docs.awk turns the plain comments of the
# headers into those of Doxygen. A public symbol, parameter or return value without documentation is an error, and so is
# a field of a parameter struct without range and default. INCLUDE: the folder of the headers, include/cairn.
set -e
build=${1:?usage: tools/docs.sh BUILD [INCLUDE]}
include=${2:-include/cairn}
out=$build/docs
rm -rf "$out"
mkdir -p "$out"
export LC_ALL=C

headers=
for module in $(awk '!/^#/ && NF == 2 { print $2 }' tools/modules.txt); do
    [ ! -f "$include/$module.h" ] || headers="$headers $include/$module.h"
done
# shellcheck disable=SC2086
awk -v mode=params -f tools/docs-text.awk -f tools/docs-functions.awk -f tools/docs.awk $headers >"$out/params.tsv" || {
    echo "FAILED API reference: comments are missing, or not of the form that CONTRIBUTING.md describes"
    exit 1
}

{
    printf '/** \\mainpage\n'
    cat <<'END'
 * A plain-C library that finds object contours in images and builds maps from range scans, in fixed memory.
 * <a class="el" href="modules.html">Modules</a> lists the headers in the order in which they build on each other.
 *
 * <b>Objects.</b> Fill in the parameters, or start from _default(); _memory() returns the bytes that _create() takes from
 * a #cairn_pool. Nothing is freed one by one. <b>Work in steps.</b> _begin() takes the input, _step() works until its
 * #cairn_budget is used up and returns #CAIRN_MORE, or #CAIRN_OK at the end; _read() returns the result. Results do not depend on
 * the budgets. <b>Errors.</b> A #cairn_status below 0 refuses a call, which then changes nothing. Where a function names
 * begin(), step() or create(), it means those of its own module.
 *
 * <b>Parameters.</b> Each with unit, range and default:
END
    awk -F '\t' '!seen[$2]++ { printf "%s * #%s", n++ ? ",\n" : "", $2 } END { print "." }' "$out/params.tsv"
    printf ' */\n'
    awk 'BEGIN {
        title["base"] = "Statuses, numbers, memory, geometry"
        title["containers"] = "Containers"
        title["numerics"] = "Numerics"
        title["shapes"] = "Lines, curves, rasters"
        title["edges"] = "Edges in images"
        title["outlines"] = "Contours of objects"
        title["parts"] = "Symmetry and parts of shapes"
        title["detection"] = "Detection of objects"
        title["scans"] = "Range scans and their registration"
        title["calibration"] = "Set-up of a scanner"
        title["poses"] = "Pose graphs"
        title["alignment"] = "Alignment of many scans"
        title["fields"] = "Force fields and virtual scans"
        title["maps"] = "Maps"
        title["merging"] = "Merging of maps"
        title["host_base"] = "Host: text and files (libcairn-host)"
        title["host_bags"] = "Host: bags of ROS"
        title["host_logs"] = "Host: logs"
        title["host_files"] = "Host: maps and tables"
        title["host_solver"] = "Host: SuiteSparse"
        title["host_pictures"] = "Host: pictures and pages"
        title["host_images"] = "Host: images and shape models"
        title["host_detection"] = "Host: detection in images"
        title["host_maps"] = "Host: scans at their poses, and their maps"
        title["host_results"] = "Host: files of results"
    }
    !/^#/ && NF == 2 {
        sub("/", "_", $1)
        if ($1 != folder) {
            folder = $1
            if (!(folder in title)) { print "tools/docs.sh: no title for the folder " folder >"/dev/stderr"; exit 1 }
            printf "/** \\defgroup folder_%s %s */\n", folder, title[folder]
        }
        if ((getline line < ("include/cairn/" $2 ".h")) > 0)
            printf "/** \\defgroup %s %s\n * \\ingroup folder_%s */\n", $2, $2, folder
    }' tools/modules.txt
} >"$out/groups.dox"

cat >"$out/docs.css" <<'END'
table.params-table td { vertical-align: top; }
table.params-table td:nth-child(-n+2) { white-space: nowrap; }
table.params-table td:nth-child(3) { min-width: 24em; }
table.params-table td:nth-child(n+5) { min-width: 7em; overflow-wrap: anywhere; }
.memdoc:has(table.params-table) table.fieldtable { display: none; }
END

cat >"$out/Doxyfile" <<END
PROJECT_NAME = cairn
PROJECT_NUMBER = $(awk '/define CAIRN_VERSION_STRING/ { print $3 }' "$include/version.h")
OUTPUT_DIRECTORY = $out
INPUT = $out/groups.dox $headers
STRIP_FROM_PATH = ${include%/cairn}
STRIP_FROM_INC_PATH = ${include%/cairn}
OPTIMIZE_OUTPUT_FOR_C = YES
MARKDOWN_SUPPORT = NO
REPEAT_BRIEF = NO
INLINE_GROUPED_CLASSES = YES
INLINE_SIMPLE_STRUCTS = YES
TYPEDEF_HIDES_STRUCT = YES
EXTRACT_ALL = NO
WARN_IF_UNDOCUMENTED = YES
WARN_IF_INCOMPLETE_DOC = YES
WARN_NO_PARAMDOC = YES
WARN_AS_ERROR = FAIL_ON_WARNINGS
SORT_GROUP_NAMES = NO
SORT_MEMBER_DOCS = NO
SORT_BRIEF_DOCS = NO
FILTER_PATTERNS = *.h="awk -f tools/docs-text.awk -f tools/docs-functions.awk -f tools/docs.awk"
MACRO_EXPANSION = YES
EXPAND_ONLY_PREDEF = YES
PREDEFINED = __GNUC__=12
SHOW_INCLUDE_FILES = NO
VERBATIM_HEADERS = NO
GENERATE_LATEX = NO
HTML_EXTRA_STYLESHEET = $out/docs.css
HTML_TIMESTAMP = NO
HAVE_DOT = NO
QUIET = YES
WARN_LOGFILE = $out/warnings.txt
END
if doxygen "$out/Doxyfile" >"$out/log" 2>&1; then
    echo "ok     API reference: $out/html/index.html"
else
    head -20 "$out/warnings.txt"
    echo "FAILED API reference: $(grep -c 'warning\|error' "$out/warnings.txt") warnings, in $out/warnings.txt"
    exit 1
fi
