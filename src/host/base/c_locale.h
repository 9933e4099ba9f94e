/* c_locale: a scope guard that switches the calling thread to the "C" locale, for
 * locale-independent conversion of numbers. */
#ifndef CAIRN_HOST_C_LOCALE_H
#define CAIRN_HOST_C_LOCALE_H

#include "src/host/base/posix.h"

typedef struct cairn_c_locale {
    locale_t c_locale; /* the "C" locale; 0: it could not be created */
    locale_t previous; /* the thread's locale before the scope */
} cairn_c_locale;

/* Switches the thread to the "C" locale. C libraries keep one constant object for "C", so the call
 * is cheap. If a library has to allocate one and is out of memory, the locale stays unchanged. */
static inline cairn_c_locale cairn_c_locale_enter(void)
{
    cairn_c_locale scope = {newlocale(LC_ALL_MASK, "C", (locale_t)0), (locale_t)0};

    if (scope.c_locale != (locale_t)0)
        scope.previous = uselocale(scope.c_locale);
    return scope;
}

/* Restores the thread's previous locale. */
static inline void cairn_c_locale_leave(cairn_c_locale scope)
{
    if (scope.c_locale == (locale_t)0)
        return;
    (void)uselocale(scope.previous);
    freelocale(scope.c_locale);
}

#endif
