#!/bin/sh
# The example of README.md, and after it the end of a drive of docs/embedding.md, compile without a warning and run, and its figures are
# those of the other documents:
#
#   tools/check-readme.sh LIBCAIRN.a
set -e
sh tools/document-figures.sh --check
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for document in README.md docs/embedding.md; do
    awk '/^```c$/ { inside = 1; next } /^```/ { inside = 0 } inside' $document >"$folder/part"
    [ -s "$folder/part" ] || { echo "$document: no C example, expected one between \`\`\`c and \`\`\`"; exit 1; }
    cat "$folder/part" >>"$folder/lines"
done
{
    cat <<'EOF'
#include <math.h>
#include <stdio.h>
#include "cairn/mapper.h"

static float range[181];
static cairn_scan_input scan = {.range = range, .count = 181, .angle_min = -1.5708f, .angle_step = 0.0174533f,
                                .range_min = 0.05f, .range_max = 30.0f, .range_sigma = 0.01f};

/* A scanner that drives towards a wall, ten scans. One has no angles, and is refused. */
static int next_scan(cairn_scan_input *next)
{
    static int number;

    for (int i = 0; i < 181; i++)
        range[i] = i > 45 && i < 135 ? 3.0f - 0.05f * (float)number : 2.0f;
    next->range = range;
    next->angle_step = number == 4 ? NAN : 0.0174533f;
    return number++ < 10;
}

static void control_motors(void)
{
}

static void publish(cairn_pose pose)
{
    printf("%.3f %.3f %.3f\n", (double)pose.x, (double)pose.y, (double)pose.theta);
}

int main(void)
{
EOF
    cat "$folder/lines"
    printf 'return 0;\n}\n'
} >"$folder/example.c"
${CC:-cc} -std=c11 -Wall -Wextra -Wpedantic -Werror -Iinclude "$folder/example.c" "$1" -lm -o "$folder/example"
"$folder/example" | awk '{ lines++ } END { if (lines != 9) { print "README.md: the example printed " lines + 0 " poses, expected 9"; exit 1 } }'
echo "ok     README: the example compiles and runs"
