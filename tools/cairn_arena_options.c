#include "tools/cairn_arena_options.h"

#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

int options_fault(const char *program, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    fprintf(stderr, "%s: ", program);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return 2;
}

static int32_t in_range(const option *o, double value)
{
    if (o->low > o->high)
        return value - value == 0;
    return value >= o->low && value <= o->high;
}

/* A decimal number in range that ends before `end` or at the end of the text; *text moves on. */
static int32_t read_number(const option *o, const char **text, double *value)
{
    char *end;

    if (strchr("+-.0123456789", **text) == NULL || **text == '\0')
        return 0;
    *value = strtod(*text, &end);
    if (end == *text || !in_range(o, *value))
        return 0;
    *text = end;
    return 1;
}

static int32_t read_two(const option *o, const char *text, char between, double *pair)
{
    double first, second;

    if (!read_number(o, &text, &first) || *text++ != between || !read_number(o, &text, &second) || *text != '\0')
        return 0;
    pair[0] = first;
    pair[1] = second;
    return 1;
}

static int32_t read_value(const option *o, const char *text)
{
    double number;
    char *end;
    uint64_t seed;

    switch (o->kind) {
    case OPTION_FLAG:
        break;
    case OPTION_INTEGER:
        if (!read_number(o, &text, &number) || *text != '\0' || number < INT32_MIN || number > INT32_MAX ||
            number != (double)(int32_t)number)
            return 0;
        *(int32_t *)o->target = (int32_t)number;
        break;
    case OPTION_SEED:
        if (strspn(text, "0123456789") != strlen(text) || *text == '\0')
            return 0;
        errno = 0;
        seed = strtoull(text, &end, 10);
        if (errno != 0)
            return 0;
        *(uint64_t *)o->target = seed;
        break;
    case OPTION_NUMBER:
        if (!read_number(o, &text, &number) || *text != '\0')
            return 0;
        *(double *)o->target = number;
        break;
    case OPTION_PAIR:
        return read_two(o, text, ',', o->target);
    case OPTION_SIZE:
        return read_two(o, text, 'x', o->target);
    case OPTION_TEXT:
        if (*text == '\0')
            return 0;
        *(const char **)o->target = text;
        break;
    }
    return 1;
}

static void fault_of_value(const char *program, const option *o, const char *text)
{
    char range[80] = "";

    if (o->low <= o->high && o->kind != OPTION_SEED && o->kind != OPTION_TEXT)
        snprintf(range, sizeof range, " in %.9g to %.9g", o->low, o->high);
    switch (o->kind) {
    case OPTION_FLAG:
        options_fault(program, "--%s=%s: it takes no value, expected --%s", o->name, text, o->name);
        break;
    case OPTION_INTEGER:
        options_fault(program, "--%s is '%s', expected a whole number%s", o->name, text, range);
        break;
    case OPTION_SEED:
        options_fault(program, "--%s is '%s', expected a whole number in 0 to 18446744073709551615", o->name, text);
        break;
    case OPTION_NUMBER:
        options_fault(program, "--%s is '%s', expected a number%s (%s)", o->name, text, range, o->unit);
        break;
    case OPTION_PAIR:
    case OPTION_SIZE:
        options_fault(program, "--%s is '%s', expected two numbers%s as %s", o->name, text, range, o->unit);
        break;
    case OPTION_TEXT:
        options_fault(program, "--%s is empty, expected %s", o->name, o->unit);
        break;
    }
}

/* The option that the argument names, or NULL; *value: behind '=', else NULL. */
static const option *find(const option *table, int32_t count, const char *argument, const char **value)
{
    const char *equals = strchr(argument, '=');
    size_t length;

    *value = NULL;
    if (argument[1] != '-') {
        for (int32_t i = 0; i < count; i++)
            if (table[i].letter != 0 && argument[1] == table[i].letter && argument[2] == '\0')
                return &table[i];
        return NULL;
    }
    length = equals ? (size_t)(equals - argument) - 2 : strlen(argument + 2);
    for (int32_t i = 0; i < count; i++)
        if (strlen(table[i].name) == length && strncmp(argument + 2, table[i].name, length) == 0) {
            *value = equals ? equals + 1 : NULL;
            return &table[i];
        }
    return NULL;
}

int32_t options_parse(const char *program, const option *table, int32_t count, int argc, char **argv,
                      const char **positional, int32_t most, const char *wanted)
{
    int32_t given = 0, all_positional = 0;

    for (int i = 1; i < argc; i++) {
        const char *argument = argv[i], *value;
        const option *o;

        if (all_positional || argument[0] != '-' || argument[1] == '\0') {
            if (given == most) {
                options_fault(program, "'%s' is one argument too many, expected %s", argument, wanted);
                return -1;
            }
            positional[given++] = argument;
            continue;
        }
        if (strcmp(argument, "--") == 0) {
            all_positional = 1;
            continue;
        }
        o = find(table, count, argument, &value);
        if (o == NULL) {
            options_fault(program, "there is no option '%s', expected one of those that --help lists", argument);
            return -1;
        }
        if (o->kind == OPTION_FLAG && value == NULL) {
            *(int32_t *)o->target = 1;
            continue;
        }
        if (value == NULL && i + 1 < argc)
            value = argv[++i];
        if (value == NULL) {
            options_fault(program, "--%s has no value, expected %s", o->name, o->unit);
            return -1;
        }
        if (o->kind == OPTION_FLAG || !read_value(o, value)) {
            fault_of_value(program, o, value);
            return -1;
        }
    }
    return given;
}

void options_help(FILE *file, const option *table, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const option *o = &table[i];
        const double *numbers = o->target;
        char left[64];

        if (o->letter != 0)
            snprintf(left, sizeof left, "-%c, --%s %s", o->letter, o->name, o->unit);
        else
            snprintf(left, sizeof left, "--%s %s", o->name, o->unit);
        fprintf(file, "  %-24s %s", left, o->help);
        switch (o->kind) {
        case OPTION_INTEGER:
            fprintf(file, " [%d]", (int)*(int32_t *)o->target);
            break;
        case OPTION_SEED:
            fprintf(file, " [%llu]", (unsigned long long)*(uint64_t *)o->target);
            break;
        case OPTION_NUMBER:
            if (*numbers == *numbers)
                fprintf(file, " [%.9g]", *numbers);
            break;
        case OPTION_PAIR:
            fprintf(file, " [%.9g,%.9g]", numbers[0], numbers[1]);
            break;
        case OPTION_TEXT:
            if (*(const char **)o->target != NULL)
                fprintf(file, " [%s]", *(const char **)o->target);
            break;
        case OPTION_FLAG:
        case OPTION_SIZE:
            break;
        }
        fputc('\n', file);
    }
}
