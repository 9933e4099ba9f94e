#!/bin/sh
# Packages of PyPI in a folder of their own: tools/venv.sh FOLDER PACKAGE...
#
# Makes FOLDER/bin/python, which has the packages. Prints nothing and exits with 0 when it has; otherwise prints why not, and exits
# with 3.
folder=${1:?usage: tools/venv.sh FOLDER PACKAGE...}
shift
sh tools/deps.sh python >/dev/null 2>&1
command -v python3 >/dev/null || {
    echo "no python3"
    exit 3
}
[ ! -f "$folder/packages.txt" ] || [ "$(cat "$folder/packages.txt")" != "$*" ] || exit 0
rm -rf "$folder"
python3 -m venv "$folder" >/dev/null 2>&1 || {
    echo "no venv of python3"
    exit 3
}
"$folder/bin/pip" install --quiet --disable-pip-version-check "$@" >"$folder/pip.log" 2>&1 || {
    echo "pip cannot install $*: $(tail -1 "$folder/pip.log")"
    exit 3
}
echo "$*" >"$folder/packages.txt"
