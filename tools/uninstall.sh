#!/bin/sh
# Removes what `make install` installed: tools/uninstall.sh INSTALLED DESTINATION
#
# INSTALLED: a folder into which the same was installed; each file of it is removed below DESTINATION (DESTDIR, may be empty), and then
# the folders named cairn that are empty; the others are shared.
installed=${1:?usage: tools/uninstall.sh INSTALLED DESTINATION} to=$2
cd "$installed" || exit 1
find . ! -type d | sed 's/^\.//' | while read -r file; do
    [ ! -e "$to$file" ] && [ ! -L "$to$file" ] || rm -f "$to$file" || exit 1
done || exit 1
find . -depth -type d -name cairn | sed 's/^\.//' | while read -r folder; do
    [ ! -d "$to$folder" ] || rmdir "$to$folder" 2>/dev/null || echo "uninstall: $to$folder is not empty" >&2
done
echo "cairn: removed from ${to:-/}"
