#!/bin/sh
# Runs test programs, two at a time: tests/run.sh BUILD PROGRAM...
# Prints each program's seconds and failures and a closing line with the totals; exits with 1 when a test failed or a program died.
build=$1
shift
mkdir -p "$build/log"

# What glibc offers: nothing may rest on what fresh memory of the heap holds, and a write behind a piece ends the program.
# Sanitizers do that themselves.
export MALLOC_PERTURB_=165
if [ -z "$SANITIZE" ] && [ -z "$(LD_PRELOAD=libc_malloc_debug.so.0 true 2>&1)" ]; then
    export MALLOC_CHECK_=3 TEST_PRELOAD=libc_malloc_debug.so.0
fi

# The tests' files are in memory where it has a gigabyte for them: the programs flush what they write, which a disk makes slow.
free=$(df -Pk /dev/shm 2>/dev/null | awk 'NR == 2 { print $4 }')
if [ -z "$TMPDIR" ] && [ -w /dev/shm ] && [ "${free:-0}" -gt 1048576 ]; then
    export TMPDIR=/dev/shm
fi

export LSAN_OPTIONS="suppressions=$PWD/tests/leaks.txt:print_suppressions=0"

# A locale with a decimal comma, made once for all programs where the system has its source (Debian's package locales).
comma=$(cd "$build" && pwd)/locale
if [ -d "$comma/de_DE.UTF-8" ] || { mkdir -p "$comma" && localedef -i de_DE -f UTF-8 "$comma/de_DE.UTF-8"; } >/dev/null 2>&1; then
    export LOCPATH="$comma"
fi

# The log of build/tests/test_pool is build/log/tests-test_pool; its exit status stands in build/log/tests-test_pool.exit, when it
# began and ended, in seconds, in build/log/tests-test_pool.time.
printf '%s\n' "$@" | xargs -P 2 -n 1 sh -c '
    log=$1/log/$(basename "$(dirname "$2")")-$(basename "$2")
    read -r began idle </proc/uptime
    LD_PRELOAD=$TEST_PRELOAD "$2" >"$log" 2>&1
    echo $? >"$log.exit"
    read -r ended idle </proc/uptime
    echo "$began $ended" >"$log.time"' run "$build"

# named WORD LOG: the tests that cmocka lists behind the word, each once.
named()
{
    sed -n "s/^\\[  $1 *\\] \\([A-Za-z0-9_]*\\)\$/\\1/p" "$2" | sort -u | paste -s -d ' ' -
}

passed=0 failed=0 skipped=0
for program in "$@"; do
    name=$(basename "$(dirname "$program")")-$(basename "$program")
    log=$build/log/$name
    status=$(cat "$log.exit")
    ok=$(grep -c '^\[       OK \]' "$log")
    bad=$(named FAILED "$log" | wc -w)
    left=$(named SKIPPED "$log")
    took=$(awk '{ printf "%.1f s", $2 - $1 }' "$log.time")
    if [ "$status" -ne 0 ] || [ "$ok" -eq 0 ]; then
        [ "$bad" -gt 0 ] || bad=1
        echo "FAILED $name (exit $status, $took)"
        grep -v '^\[       OK \]\|^\[ RUN' "$log"
    else
        echo "ok     $name: $ok tests, $took${left:+, skipped: $left}"
    fi
    skipped=$((skipped + $(echo "$left" | wc -w)))
    passed=$((passed + ok))
    failed=$((failed + bad))
done
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
