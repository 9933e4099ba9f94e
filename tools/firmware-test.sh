#!/bin/sh
# Runs the firmware in an emulator and compares it with the desktop, bit by bit: tools/firmware-test.sh BUILD/firmware MISSION...
#
# (tools/firmware-test.sh BUILD/firmware --emulate CPU MISSION is one run of an emulator: all of them are run two at a time, in the
# order given, best the longest first.)
# Every program prints poses and hashes; lines that begin with "measure" depend on the machine and are ignored. Stores the
# output of each as NAME.txt, for tools/footprint.sh. The environment variable LAPS is the number of laps of a survey; with
# SOFT_DOUBLE set, double runs in software, too, on CPUs without a double FPU; with QUICK set, all run in
# float on the M7 alone.
fw=${1:?usage: tools/firmware-test.sh BUILD/firmware MISSION...}
shift
cairn=$fw/../cairn
failed=0

# With -icount one instruction is a nanosecond of the clock that the program reads. Its exit status is stored in NAME.exit.
emulate()
{
    case $1 in
    m4) machine=mps2-an386 ;;
    *) machine=mps2-an500 ;;
    esac
    limit=$((600 + ${LAPS:-0} * 60)) # s; double in software takes three times as long
    [ -z "$SOFT_DOUBLE" ] || limit=$((3 * limit))
    mkdir -p "$fw/$1/$2.run"
    (
        cd "$fw/$1/$2.run" &&
            timeout $limit qemu-system-arm -M $machine -nographic -icount shift=0 \
                -semihosting-config "enable=on,target=native${LAPS:+,arg=$2,arg=$LAPS}" -kernel "../$2.elf" </dev/null
    ) >"$fw/$1/$2.txt" 2>&1
    echo $? >"$fw/$1/$2.exit"
}
if [ "$1" = --emulate ]; then
    emulate "$2" "$3"
    exit 0
fi

# The missions do not use the double FPU.
cpus()
{
    case $1 in
    golden-double) echo $([ -n "$QUICK" ] || echo m7d) ${SOFT_DOUBLE:+m7 m4} ;;
    *) echo m7 $([ -n "$QUICK" ] || echo m4) ;;
    esac
}

# Replays the flight recording on the desktop.
replay()
{
    "$cairn" replay --quiet "$1" >"$fw/replayed" 2>&1 || {
        failed=1
        echo "FAILED firmware: replay of $1:"
        cat "$fw/replayed"
    }
}

for mission in "$@"; do
    case $mission in golden-*) continue ;; esac
    if arm-none-eabi-nm "$fw/m7/$mission.elf" | grep -E '__aeabi_(c?d|[a-z]+2d)'; then
        failed=1
        echo "FAILED firmware: $mission computes in double"
    fi
done
for cpu in $(cpus stack); do
    sh tools/check-stack.sh "$fw/$cpu/float" >"$fw/$cpu/stack.txt" || {
        failed=1
        grep -v bytes "$fw/$cpu/stack.txt"
        echo "FAILED firmware: stack on $cpu"
    }
done

rm -f "$fw"/m*/*.exit
for name in "$@"; do
    for cpu in $(cpus "$name"); do
        echo "$cpu $name"
    done
done | xargs -P 2 -n 2 sh "$0" "$fw" --emulate

for name in "$@"; do
    "$fw/host/$name" >"$fw/host/$name.txt" || {
        echo "FAILED firmware: $name on the desktop"
        cat "$fw/host/$name.txt"
        exit 1
    }
    grep -v '^measure' "$fw/host/$name.txt" >"$fw/expected"
    for cpu in $(cpus "$name"); do
        status=$(cat "$fw/$cpu/$name.exit")
        grep -v '^measure' "$fw/$cpu/$name.txt" >"$fw/found"
        if [ $status -eq 0 ] && [ -s "$fw/found" ] && cmp -s "$fw/expected" "$fw/found"; then
            echo "ok     firmware: $name on $cpu, same bits"
            [ ! -f "$fw/$cpu/$name.run/flight.rec" ] || replay "$fw/$cpu/$name.run/flight.rec"
        else
            failed=1
            echo "FAILED firmware: $name on $cpu (exit $status):"
            diff "$fw/expected" "$fw/found"
        fi
    done
done
exit $failed
