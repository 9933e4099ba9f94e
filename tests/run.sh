#!/bin/sh
# Runs test programs one after another: tests/run.sh BUILD PROGRAM...
# Prints each program's failures and a closing line with the totals; exits with 1 when a test failed or a program died.
build=$1
shift
mkdir -p "$build/log"
passed=0 failed=0
for program in "$@"; do
    name=$(basename "$(dirname "$program")")-$(basename "$program")
    log=$build/log/$name
    "$program" >"$log" 2>&1
    status=$?
    ok=$(grep -c '^\[       OK \]' "$log")
    bad=$(grep -c '^\[  FAILED  \] [A-Za-z0-9_]*$' "$log")
    if [ "$status" -ne 0 ] || [ "$ok" -eq 0 ]; then
        [ "$bad" -gt 0 ] || bad=1
        echo "FAILED $name (exit $status)"
        grep -v '^\[       OK \]\|^\[ RUN' "$log"
    else
        echo "ok     $name: $ok tests"
    fi
    passed=$((passed + ok))
    failed=$((failed + bad))
done
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
