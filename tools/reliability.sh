#!/bin/sh
# Reliability diagrams of the stated error probabilities: tools/reliability.sh FILE.svg
#
# From the tables in docs/lab after a line <!-- reliability: TITLE -->, as --table and --reliability of the programs in
# bench/ print them: a panel each, the share that is wrong over the probability that is stated of it, both in powers of
# ten, with intervals of 95 %. On the diagonal what is said to be wrong in one of n is wrong in one of n.
file=${1:?usage: tools/reliability.sh FILE.svg}
export LC_ALL=C
awk -F'|' '
BEGIN {
    LEAST = 0.0003; SIDE = 200; LEFT = 60; TOP = 40; STEP = 270
}
function log10(p) { return log(p) / log(10) }
function share_of(p) { return (log10(p > LEAST ? p : LEAST) - log10(LEAST)) / -log10(LEAST) * SIDE }
function x_of(p) { return sprintf("%.1f", x0 + share_of(p)) }
function y_of(p) { return sprintf("%.1f", TOP + SIDE - share_of(p)) }
function line(x1, y1, x2, y2, colour, dash)
{
    body = body sprintf("<line x1=\"%s\" y1=\"%s\" x2=\"%s\" y2=\"%s\" stroke=\"%s\"%s/>\n", x1, y1, x2, y2, colour,
                        dash ? " stroke-dasharray=\"4 3\"" : "")
}
function text(x, y, anchor, words)
{
    body = body sprintf("<text x=\"%s\" y=\"%s\" text-anchor=\"%s\">%s</text>\n", x, y, anchor, words)
}
function begin_panel(title,    p)
{
    x0 = LEFT + panels * STEP
    panels++
    body = body sprintf("<rect x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\" fill=\"none\" stroke=\"#888\"/>\n", x0, TOP, SIDE, SIDE)
    for (p = 0.001; p < 2; p *= 10) {
        line(x_of(p), TOP, x_of(p), TOP + SIDE, "#ddd", 0)
        line(x0, y_of(p), x0 + SIDE, y_of(p), "#ddd", 0)
        text(x_of(p), TOP + SIDE + 16, "middle", p)
        if (panels == 1)
            text(x0 - 6, y_of(p) + 4, "end", p)
    }
    line(x0, TOP + SIDE, x0 + SIDE, TOP, "#888", 1)
    text(x0 + SIDE / 2, TOP - 12, "middle", title)
    text(x0 + SIDE / 2, TOP + SIDE + 34, "middle", "stated to be wrong, mean")
}
function add_bin(decisions, stated, share, interval,    ends)
{
    split(interval, ends, " to ")
    line(x_of(stated), y_of(ends[1] + 0), x_of(stated), y_of(ends[2] + 0), "#c33", 0)
    body = body sprintf("<circle cx=\"%s\" cy=\"%s\" r=\"3\" fill=\"#c33\"><title>%d decisions, stated %s, wrong %s (%s)</title></circle>\n", x_of(stated), y_of(share + 0), decisions, stated, share, interval)
}
{ gsub(/ *\| */, "|"); $0 = $0 }
/^<!-- reliability: / { title = $0; sub(/^<!-- reliability: /, "", title); sub(/ -->$/, "", title); begin_panel(title); open = 1; next }
open && /^\|[0-9.]+\|/ { add_bin($3, $4, $6, $7); seen = 1; next }
open && seen { open = seen = 0 }
END {
    if (panels == 0) {
        print "reliability.sh: no table after a line <!-- reliability: TITLE --> in docs/lab" > "/dev/stderr"
        exit 1
    }
    width = LEFT + panels * STEP - 40
    height = TOP + SIDE + 50
    printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" width=\"%d\" height=\"%d\" font-family=\"sans-serif\" font-size=\"12\">\n", width, height, width, height
    print "<title>Reliability of the stated error probabilities</title>"
    printf "<rect width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n", width, height
    printf "%s", body
    printf "<text transform=\"translate(16 %d) rotate(-90)\" text-anchor=\"middle\">share that is wrong, 95 %%</text>\n", TOP + SIDE / 2
    print "</svg>"
}' docs/lab/*.md >"$file.part" && mv "$file.part" "$file" || { rm -f "$file.part"; exit 1; }
