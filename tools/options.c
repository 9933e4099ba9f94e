#include "tools/options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cairn/number_text.h"

static void print_help(const option_set *set)
{
    printf("usage: %s %s\n\n%s\n", set->program, set->synopsis, set->about);
    if (set->count > 0)
        printf("\noptions:\n");
    for (size_t i = 0; i < set->count; i++) {
        const option *o = &set->table[i];
        char left[64];

        snprintf(left, sizeof left, "%s%s%s", o->name, o->placeholder[0] != '\0' ? " " : "", o->placeholder);
        printf("  %-22s %s\n", left, o->help);
    }
    printf("  %-22s %s\n", "--help", "this text");
}

static option_result bad(const option_set *set, const char *what, const char *word, const char *expected)
{
    fprintf(stderr, "%s: %s '%s', expected %s\n", set->program, what, word, expected);
    return OPTIONS_BAD;
}

/* The option that `word` names, up to '=' when there is one. */
static const option *find(const option_set *set, const char *word)
{
    size_t length = strcspn(word, "=");

    for (size_t i = 0; i < set->count; i++)
        if (strlen(set->table[i].name) == length && strncmp(set->table[i].name, word, length) == 0)
            return &set->table[i];
    return NULL;
}

static int in_range(const option *o, double value)
{
    return value >= o->least && value <= o->most;
}

/* 1 when the text is what the option takes and is stored. */
static int store(const option *o, const char *text)
{
    double a, b;
    int64_t integer;
    size_t middle;

    switch (o->kind) {
    case OPTION_IS_INTEGER:
        if (!cairn_number_read_integer(text, strlen(text), &integer) || !in_range(o, (double)integer))
            return 0;
        *(int64_t *)o->value = integer;
        return 1;
    case OPTION_IS_NUMBER:
        if (!cairn_number_read(text, strlen(text), &a) || !in_range(o, a))
            return 0;
        *(double *)o->value = a;
        return 1;
    case OPTION_IS_PAIR:
        middle = strcspn(text, ",x");
        if (text[middle] == '\0' || !cairn_number_read(text, middle, &a) ||
            !cairn_number_read(text + middle + 1, strlen(text + middle + 1), &b) || !in_range(o, a) || !in_range(o, b))
            return 0;
        ((double *)o->value)[0] = a;
        ((double *)o->value)[1] = b;
        return 1;
    default:
        if (text[0] == '\0')
            return 0;
        *(const char **)o->value = text;
        return 1;
    }
}

static void describe(const option *o, char *text, size_t size)
{
    const char *what = o->kind == OPTION_IS_INTEGER  ? "a whole number"
                       : o->kind == OPTION_IS_NUMBER ? "a number"
                       : o->kind == OPTION_IS_PAIR   ? "two numbers A,B"
                                                     : "a word";

    if (o->kind == OPTION_IS_TEXT)
        snprintf(text, size, "%s", what);
    else if (o->most >= 9e15)
        snprintf(text, size, "%s from %.9g", what, o->least);
    else
        snprintf(text, size, "%s from %.9g to %.9g", what, o->least, o->most);
}

static option_result read_option(const option_set *set, int argc, char **argv, int *at)
{
    const char *word = argv[*at], *equals = strchr(word, '='), *text;
    const option *o = find(set, word);
    char expected[128];

    if (o == NULL)
        return bad(set, "unknown option", word, "one of those that --help lists");
    if (o->given != NULL)
        *o->given = 1;
    if (o->kind == OPTION_IS_FLAG) {
        if (equals != NULL)
            return bad(set, "value for", word, "none: the option stands alone");
        *(int32_t *)o->value = 1;
        return OPTIONS_READ;
    }
    describe(o, expected, sizeof expected);
    text = equals != NULL ? equals + 1 : *at + 1 < argc ? argv[++*at] : NULL;
    if (text == NULL)
        return bad(set, "nothing after", o->name, expected);
    if (!store(o, text)) {
        fprintf(stderr, "%s: %s is '%s', expected %s\n", set->program, o->name, text, expected);
        return OPTIONS_BAD;
    }
    return OPTIONS_READ;
}

option_result options_read(const option_set *set, int argc, char **argv, const char **words, size_t *word_count)
{
    size_t capacity = *word_count;
    int only_words = 0;

    *word_count = 0;
    for (int i = 1; i < argc; i++) {
        if (!only_words && strcmp(argv[i], "--") == 0) {
            only_words = 1;
        } else if (!only_words && (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0)) {
            print_help(set);
            return OPTIONS_HELPED;
        } else if (!only_words && argv[i][0] == '-' && argv[i][1] != '\0') {
            if (read_option(set, argc, argv, &i) != OPTIONS_READ)
                return OPTIONS_BAD;
        } else if (*word_count < capacity) {
            words[(*word_count)++] = argv[i];
        } else {
            return bad(set, "one word too many,", argv[i], set->synopsis);
        }
    }
    return OPTIONS_READ;
}
