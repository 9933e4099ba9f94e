/* c_locale: the calling thread under the "C" locale for the length of one conversion. */
#ifndef CAIRN_HOST_C_LOCALE_H
#define CAIRN_HOST_C_LOCALE_H

#include <locale.h>

typedef struct cairn_c_locale {
    locale_t own;
    locale_t before;
} cairn_c_locale;

/* libcs keep one constant object for "C", so this costs next to nothing. When there is no memory
 * for one where a libc does make a new object, the locale stays as it is. */
static inline cairn_c_locale cairn_c_locale_enter(void)
{
    cairn_c_locale scope = {newlocale(LC_ALL_MASK, "C", (locale_t)0), (locale_t)0};

    if (scope.own != (locale_t)0)
        scope.before = uselocale(scope.own);
    return scope;
}

static inline void cairn_c_locale_leave(cairn_c_locale scope)
{
    if (scope.own == (locale_t)0)
        return;
    (void)uselocale(scope.before);
    freelocale(scope.own);
}

#endif
