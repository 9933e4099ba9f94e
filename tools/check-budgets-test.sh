#!/bin/sh
# Tests that the check of the budgets rejects what does not charge by the functions of src/base: tools/check-budgets-test.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
mkdir -p "$work/src/base" "$work/src/edges" "$work/src/host/files"

# expect MESSAGE [LINE]: what the check must print of a line, or of standard input, as src/edges/edge.c, or "" when it is right
expect()
{
    if [ $# -gt 1 ]; then
        echo "    $2" >"$work/src/edges/edge.c"
    else
        cat >"$work/src/edges/edge.c"
    fi
    said=$(sh tools/check-budgets.sh "$work")
    status=$?
    if [ -z "$1" ] && [ $status -ne 0 ]; then
        echo "FAILED budgets test: lines that are right were rejected: $said"
        failed=1
    elif [ -n "$1" ] && { [ $status -eq 0 ] || ! echo "$said" | grep -q "$1"; }; then
        echo "FAILED budgets test: expected \"$1\" with a failure, got exit $status for \"${2:-}\": $said"
        failed=1
    fi
}

# Read, compared and initialized; in comments; of another thing that is left.
expect "" <<'END'
/* charges budget->left -= 1
 * budget->left -= 1 */
    int32_t before = budget->left;
    cairn_budget share = {most};
    if (is_ready && budget->left > 0 && budget->left != 1)
        return;
    if (budget->left == 0 || budget->left <= 0 || share.left >= 1)
        used = before - budget->left;
    box->left -= 1;
    ordering->poses_left -= 1;
    edge->units_charged = 0; /* units_charged -= 1 */
    edge->eighths_used = 0;
#define CAIRN_EDGE_RUN_H
#define TRUNCATION(x) (x)
#define RUNNING(x) (x)
    cairn_budget_charge(budget, &edge->units_charged, cost - edge->units_charged);
END
while read -r line; do
    expect "src/edges/edge.c:1: writes to the units that are left" "$line"
done <<'END'
budget->left -= units;
budget->left += 1;
budget->left = 0;
budget->left =
budget->left--;
(budget)->left--;
--budget->left;
++(*budget).left;
share.left -= 1;
own_budget.left = 2;
add_row(kernel, &budget->left);
int32_t *left = &budget->left;
END
while read -r line; do
    expect "src/edges/edge.c:1: lowers the units charged" "$line"
done <<'END'
set->units_charged -= UNITS_PER_INLIER;
set->units_charged--;
--set->units_charged;
*units_charged -= 1;
(*units_charged)--;
set->step_units_charged -= 1;
set->units_charged = -1;
END
while read -r line; do
    expect "src/edges/edge.c:1: charges eighths after the work" "$line"
done <<'END'
edge->eighths_used += 24;
edge->eighths_used++;
++edge->eighths_used;
END
while read -r line; do
    expect "src/edges/edge.c:1: charges after the work" "$line"
done <<'END'
edge->units_due += 1 + count / 8;
edge->units_due++;
edge->units_due = cost;
END
while read -r line; do
    printf '%s\n' "$line" >"$work/macro"
    expect "src/edges/edge.c:1: a macro that runs a phase" <"$work/macro"
done <<'END'
#define RUN(phase) CAIRN_STEP_UNTIL(edge->resume, phase(edge, budget))
#define EDGE_RUN(edge, phase)
#define RUN_CHARGE(edge, budget, cost)
END
# What serves all others, and the host, which is no part of the library.
expect "" </dev/null
echo '    budget->left -= now;' | tee "$work/src/base/step.h" >"$work/src/host/files/file.c"
expect "" </dev/null
rm -r "$work/src"
sh tools/check-budgets.sh "$work" >"$work/said" && {
    echo "FAILED budgets test: a tree without a library was accepted"
    failed=1
}
[ $failed -eq 0 ] && echo "ok     the check of the budgets rejects what charges otherwise"
exit $failed
