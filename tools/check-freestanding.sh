#!/bin/sh
# Checks from the object files that a library is freestanding: tools/check-freestanding.sh LIBRARY.a...
#
# Rejected are: an undefined symbol that is not in the list below, a global symbol without the prefix cairn_, and writable
# data. Read-only data that the loader relocates (.data.rel.ro, tables of pointers built with -fPIC) is allowed.
# NM and SIZE name the tools of another target.
nm=${NM:-nm}
size=${SIZE:-size}

# Of string.h and math.h: functions that every libc has and every libm computes exactly.
allowed='memcpy memset memmove memcmp
sqrt fabs floor ceil rint fmin fmax copysign ldexp frexp
sqrtf fabsf floorf ceilf rintf fminf fmaxf copysignf ldexpf frexpf
_GLOBAL_OFFSET_TABLE_'
# The compiler's own: 64-bit integers on 32-bit targets, and the same under their names in the ARM ABI.
helpers='__(div|udiv|mod|umod|mul|ashl|ashr|lshr|cmp|ucmp|clz|ctz|popcount)[sd]i[23]
__(divmod|udivmod)[sd]i4
__float(un)?di[sd]f
__fix(uns)?[sd]fdi
__aeabi_(u?ldivmod|lmul|llsl|llsr|lasr|lcmp|ulcmp|u?idiv|u?idivmod|u?l2[df]|[df]2u?lz)
__aeabi_mem(cpy|move|set|clr)[48]?
__gnu_thumb1_case_[su](qi|hi|si)'
# Where double has no hardware, the double library needs it in software; in the float library it would be an error.
soft_double='__aeabi_(d.*|cd.*|[iuf]i?2d)
__(add|sub|mul|div|neg|eq|ne|lt|le|gt|ge|unord)df[23]
__(float(un)?sidf|fix(uns)?dfsi|extendsfdf2|truncdfsf2)'

[ $# -gt 0 ] || {
    echo "usage: tools/check-freestanding.sh LIBRARY.a..." >&2
    exit 2
}

failed=0
for library in "$@"; do
    symbols=$($nm -A -g "$library") && sections=$($size -A "$library") || exit 2
    patterns=$helpers
    case $symbols in
    *cairn_pool_init_float*) ;;
    *) patterns="$helpers
$soft_double" ;;
    esac
    {
        echo "$allowed" | tr ' ' '\n' | sed 's/^/allowed /'
        echo "$patterns" | sed 's/^/pattern /'
        echo "$symbols" | sed 's/^/symbol /'
        echo "$sections" | sed 's/^/section /'
    } | awk -v library="$library" '
    function refuse(text) { print library ": " text; bad = 1 }
    $1 == "allowed" { allowed[$2] = 1 }
    $1 == "pattern" { pattern[++patterns] = "^" $2 "$" }
    $1 == "symbol" {
        # libcairn.a:pool.c.o:0000000000000040 T cairn_pool_take, or ...:                 U memset
        name = $NF
        kind = $(NF - 1)
        file = $2
        sub(/^[^:]*:/, "", file)
        sub(/:.*/, "", file)
        if (kind == "U" || kind == "w") {
            if (!((name, file) in seen)) { seen[name, file] = 1; used[++uses] = name; by[uses] = file }
        } else {
            defined[name] = 1
            count++
            if (name !~ /^cairn_/) refuse(file " defines the global " name ", which lacks the prefix cairn_")
        }
    }
    $1 == "section" && $2 !~ /^\./ { object = $2 }
    $1 == "section" && $3 > 0 && ($2 ~ /^\.(data|bss|tdata|tbss|sdata|sbss)/ || $2 == "COMMON") {
        if ($2 !~ /^\.data\.rel\.ro/) refuse(object " has " $3 " bytes of writable data in " $2)
    }
    END {
        for (i = 1; i <= uses; i++) {
            if (used[i] in defined || used[i] in allowed) continue
            for (p = 1; p <= patterns; p++) if (used[i] ~ pattern[p]) break
            if (p > patterns) refuse(by[i] " needs " used[i] ", which a freestanding library may not")
        }
        if (!count) refuse("defines nothing")
        if (!bad) print "ok     freestanding: " library ", " count " global symbols, nothing writable"
        exit bad
    }' || failed=1
done
exit $failed
