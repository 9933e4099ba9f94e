#!/bin/sh
# Memory and time of the library on a microcontroller: tools/footprint.sh [--check] BUILD FILE
#
# Measures the programs in BUILD/firmware after `make firmware-test` (code, stack, instructions, memory; float, Cortex-M7, -Os), and
# pool bytes with tools/pool_formulas.c (with the float library of the desktop), and writes it between the two markers in
# FILE. With --check FILE is not changed: exits with 1 when a figure has grown by more than 5 % (and by more than 16) over the
# one in FILE, or when a row is missing.
check=
[ "$1" != --check ] || {
    check=1
    shift
}
[ $# -eq 2 ] || {
    echo "usage: tools/footprint.sh [--check] BUILD FILE" >&2
    exit 2
}
fw=$1/firmware
file=$2
[ -f "$file" ] || {
    echo "footprint.sh: $file: expected a document" >&2
    exit 2
}
begin='<!-- measured: begin -->'
end='<!-- measured: end -->'
table=$fw/footprint.md
export LC_ALL=C
cc -std=c11 -DCAIRN_FLOAT -I. -Iinclude tools/pool_formulas.c tools/pool_objects.c "$1/libcairn-float.a" -lm -o "$fw/pool_formulas" || exit 1

# code_bytes ELF: bytes of code and constants, without the scans that a mission carries
code_bytes()
{
    arm-none-eabi-nm -S "$1" | awk '
        function value(hex,    i, n) { n = 0; for (i = 1; i <= length(hex); i++) n = 16 * n + index("0123456789abcdef", substr(hex, i, 1)) - 1; return n }
        NF == 4 && $3 ~ /[tTrR]/ && $4 !~ /^(range_|recorded)/ { sum += value($2) } END { print sum }'
}

# What the linker keeps of the library for a program of one module, from its amalgamation.
for module in icp mapper; do
    sh tools/link-module.sh $module "$fw/alone" || exit 1
done

# name of the module of an object: the longest module whose name begins it (modules.txt); parts belong to their modules.
{
    echo
    echo '| mission | code bytes in the image | pool bytes used | pool, state and data, bytes | stack bytes, painted |'
    echo '|---|---|---|---|---|'
    for elf in "$fw"/m7/*.elf; do
        name=$(basename "$elf" .elf)
        case $name in golden-*) continue ;; esac
        code=$(code_bytes "$elf")
        awk -v name="$name" -v code="$code" '/^measure pool_peak/ { print "| " name " | " code " | " $(NF - 3) " | " $(NF - 1) " | " $NF " |" }' "$fw/m7/$name.txt"
    done
    for module in icp mapper; do
        echo "| $module alone | $(code_bytes "$fw/alone/$module.elf") | – | – | – |"
        echo "| $module alone, whole image | $(arm-none-eabi-size "$fw/alone/$module.elf" | awk 'NR == 2 { print $1 }') | – | – | – |"
    done
    echo
    echo '| tick | ticks | mean instructions | worst | most units |'
    echo '|---|---|---|---|---|'
    for text in "$fw"/m7/*.txt; do
        name=$(basename "$text" .txt)
        awk -v name="$name" '/^measure ticks/ { print "| " name ": " $(NF - 4) " | " $(NF - 3) " | " $(NF - 2) " | " $(NF - 1) " | " $NF " |" }' "$text"
    done
    echo
    echo '| module | code bytes |'
    echo '|---|---|'
    arm-none-eabi-size "$fw"/m7/float/src/*/*.o | awk '
        NR == FNR { if ($1 !~ /^#/ && NF == 2) module[++modules] = $2; next }
        $1 != "text" {
            name = $6
            sub(/.*\//, "", name)
            sub(/\.c\.o$/, "", name)
            best = name
            for (i = 1; i <= modules; i++) if (name == module[i] || index(name, module[i] "_") == 1) if (best == name || length(module[i]) > length(best)) best = module[i]
            for (i = 1; i <= modules; i++) if (name == module[i]) best = name
            size[best] += $1
        }
        END { for (i = 1; i <= modules; i++) if (module[i] in size) print "| " module[i] " | " size[module[i]] " |" }' tools/modules.txt -
    echo
    echo '| function | worst stack, bytes |'
    echo '|---|---|'
    sh tools/check-stack.sh --all "$fw/m7/float/src"
    echo
    echo '| pool of | bytes |'
    echo '|---|---|'
    "$fw/pool_formulas"
} >"$table" || exit 1

if [ -n "$check" ]; then
    sed -n "/^$begin/,/^$end/p" "$file" | awk -F'|' -v file="$file" '
    function trim(s) { gsub(/^ +| +$/, "", s); return s }
    NF < 4 || $2 ~ /^-/ { next }
    FNR == NR { for (i = 3; i < NF; i++) was[trim($2), i] = trim($i); known[trim($2)] = 1; next }
    {
        key = trim($2)
        if (!(key in known)) { print "FAILED footprint: " key " is not in " file " (make footprint writes it)"; bad = 1; next }
        for (i = 3; i < NF; i++) {
            now = trim($i)
            if (now + 0 > 1.05 * was[key, i] && now + 0 > was[key, i] + 16) {
                print "FAILED footprint: " key ": " now ", in " file " " was[key, i] " (make footprint writes it)"
                bad = 1
            }
        }
    }
    END { if (!bad) print "ok     footprint: no figure has grown"; exit bad }' - "$table"
    exit
fi
awk -v begin="$begin" -v end="$end" -v table="$table" '
$0 == begin { print; while ((getline line < table) > 0) print line; print ""; inside = 1; next }
$0 == end { inside = 0 }
!inside' "$file" >"$file.part" && mv "$file.part" "$file" && echo "wrote $file" && sh tools/document-figures.sh
