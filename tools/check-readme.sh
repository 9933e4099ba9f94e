#!/bin/sh
# The embedding example of the README compiles without a warning and runs: tools/check-readme.sh LIBCAIRN.a
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
awk '/^```c$/ { inside = 1; next } /^```/ { inside = 0 } inside' README.md >"$folder/example.c"
[ -s "$folder/example.c" ] || { echo "README.md: no C example, expected one between \`\`\`c and \`\`\`"; exit 1; }
${CC:-cc} -std=c11 -Wall -Wextra -Wpedantic -Werror -Iinclude "$folder/example.c" "$1" -lm -o "$folder/example"
"$folder/example" | awk '{ lines++ } END { if (lines != 10) { print "README.md: the example printed " lines + 0 " poses, expected 10"; exit 1 } }'
echo "ok     README: the example compiles and runs"
