/* Command line parser of all programs. */
#include "tools/options.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/version.h"

/* bytes of the text of a default */
#define DEFAULT_TEXT 64

/* The default, from the value as it stands; empty for 0 and NaN, whose meaning the help text
 * says. */
static void default_text(const option *o, char *text, size_t size)
{
    const double *pair = o->value;

    text[0] = '\0';
    switch (o->kind) {
    case OPTION_IS_INTEGER:
        if (*(const int64_t *)o->value != 0)
            snprintf(text, size, "%" PRId64, *(const int64_t *)o->value);
        break;
    case OPTION_IS_COUNT:
        if (*(const int32_t *)o->value != 0)
            snprintf(text, size, "%" PRId32, *(const int32_t *)o->value);
        break;
    case OPTION_IS_SEED:
        snprintf(text, size, "%" PRIu64, *(const uint64_t *)o->value);
        break;
    case OPTION_IS_NUMBER:
        if (fabs(pair[0]) > 0)
            snprintf(text, size, "%.9g", pair[0]);
        break;
    case OPTION_IS_PAIR:
        if (fabs(pair[0]) > 0 || fabs(pair[1]) > 0)
            snprintf(text, size, "%.9g,%.9g", pair[0], pair[1]);
        break;
    default:
        break;
    }
}

/* What every program takes besides its table. */
static const option common[] = {
    OPTION_FLAG("--help", NULL, "this text"),
    OPTION_FLAG("--version", NULL, "the version"),
};

/* Columns of a line of help, and the first of the texts of options. */
enum { HELP_COLUMNS = 80, HELP_INDENT = 25 };

/* Prints words in lines of HELP_COLUMNS that begin at `indent`; the first line continues at `column`.
 * A line end is a blank, but for an empty line and one before blanks. Returns the last column. */
static int print_words(const char *text, int column, int indent)
{
    while (*text != '\0') {
        int blanks = (int)strspn(text, " "), breaks = (int)strspn(text + blanks, "\n");
        int is_break = breaks > 1 || (breaks == 1 && text[blanks + 1] == ' ');
        int word;

        text += blanks + breaks;
        word = (int)strcspn(text, is_break && breaks == 1 ? "\n" : " \n");
        if (is_break)
            for (int k = 0; k < breaks; k++)
                putchar('\n');
        if (is_break || (column > indent && column + 1 + word > HELP_COLUMNS)) {
            printf("%s%*s", is_break ? "" : "\n", indent, "");
            column = indent;
        } else if (column > indent) {
            putchar(' ');
            column++;
        }
        column += printf("%.*s", word, text);
        text += word;
    }
    return column;
}

static void print_help_line(const option *o)
{
    char left[64], value[DEFAULT_TEXT];
    int column;

    snprintf(left, sizeof left, "%s%s%s", o->name, o->placeholder[0] != '\0' ? " " : "",
             o->placeholder);
    default_text(o, value, sizeof value);
    column = print_words(o->help, printf("  %-22s ", left), HELP_INDENT);
    if (value[0] != '\0') {
        char brackets[DEFAULT_TEXT + 2];

        snprintf(brackets, sizeof brackets, "[%s]", value);
        (void)print_words(brackets, column, HELP_INDENT);
    }
    putchar('\n');
}

void options_help(const option_set *set)
{
    for (size_t i = 0; i < set->count; i++)
        print_help_line(&set->table[i]);
    for (size_t i = 0; i < sizeof common / sizeof *common; i++)
        print_help_line(&common[i]);
}

/* A field of a row, with a blank in place of each line end. */
static void print_field(const char *text)
{
    for (; *text != '\0'; text++)
        putchar(*text == '\n' ? ' ' : *text);
}

static void print_row(const option *o)
{
    char value[DEFAULT_TEXT];

    default_text(o, value, sizeof value);
    printf("option\t%s\t%s\t%s\t", o->name, o->placeholder, value);
    print_field(o->help);
    putchar('\n');
}

void options_table(const option_set *set)
{
    printf("program\t%s\nsynopsis\t", set->program);
    print_field(set->synopsis);
    printf("\nabout\t");
    for (const char *c = set->about; *c != '\0'; c++)
        if (*c == '\n')
            printf("\nabout\t");
        else
            putchar(*c);
    putchar('\n');
    for (size_t i = 0; i < set->count; i++)
        print_row(&set->table[i]);
    for (size_t i = 0; i < sizeof common / sizeof *common; i++)
        print_row(&common[i]);
}

void options_version(void)
{
    printf("cairn %s\n", cairn_version_text());
}

static void print_help(const option_set *set)
{
    printf("usage: %s %s\n\n", set->program, set->synopsis);
    (void)print_words(set->about, 0, 0);
    printf("\n\noptions:\n");
    options_help(set);
}

int options_refuse(const char *program, const char *format, ...)
{
    va_list arguments;

    fprintf(stderr, "%s: ", program);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
    return 2;
}

int options_end(const char *program, int code)
{
    if (fflush(stdout) == 0 && !ferror(stdout))
        return code;
    (void)options_refuse(program, "standard output: %s", strerror(errno));
    return code == 0 ? 1 : code;
}

static option_result bad(const option_set *set, const char *what, const char *word,
                         const char *expected)
{
    (void)options_refuse(set->program, "%s '%s', expected %s", what, word, expected);
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

/* Decimal digits up to the greatest uint64_t. */
static int read_seed(const char *text, uint64_t *seed)
{
    uint64_t sum = 0;

    if (text[0] == '\0')
        return 0;
    for (; *text != '\0'; text++) {
        uint64_t digit = (uint64_t)(*text - '0');

        if (*text < '0' || *text > '9' || sum > (UINT64_MAX - digit) / 10)
            return 0;
        sum = 10 * sum + digit;
    }
    *seed = sum;
    return 1;
}

/* Parses and stores the value of an option. Returns 1 when the text is valid. */
static int store(const option *o, const char *text)
{
    double a, b;
    int64_t integer;
    size_t middle;

    switch (o->kind) {
    case OPTION_IS_INTEGER:
        if (!cairn_number_read_integer(text, strlen(text), &integer) ||
            !in_range(o, (double)integer))
            return 0;
        *(int64_t *)o->value = integer;
        return 1;
    case OPTION_IS_COUNT:
        if (!cairn_number_read_integer(text, strlen(text), &integer) ||
            !in_range(o, (double)integer))
            return 0;
        *(int32_t *)o->value = (int32_t)integer;
        return 1;
    case OPTION_IS_SEED:
        return read_seed(text, o->value);
    case OPTION_IS_NUMBER:
        if (!cairn_number_read(text, strlen(text), &a) || !in_range(o, a))
            return 0;
        *(double *)o->value = a;
        return 1;
    case OPTION_IS_PAIR:
        middle = strcspn(text, ",x");
        if (text[middle] == '\0' || !cairn_number_read(text, middle, &a) ||
            !cairn_number_read(text + middle + 1, strlen(text + middle + 1), &b) ||
            !in_range(o, a) || !in_range(o, b))
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
    static const char *const names[] = {
        [OPTION_IS_FLAG] = "nothing",
        [OPTION_IS_INTEGER] = "a whole number",
        [OPTION_IS_COUNT] = "a whole number",
        [OPTION_IS_SEED] = "a whole number from 0 to 18446744073709551615",
        [OPTION_IS_NUMBER] = "a number",
        [OPTION_IS_PAIR] = "two numbers A,B",
        [OPTION_IS_TEXT] = "a word",
    };
    const char *what = names[o->kind];

    if (o->kind == OPTION_IS_TEXT || o->kind == OPTION_IS_SEED)
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
        (void)options_refuse(set->program, "%s is '%s', expected %s", o->name, text, expected);
        return OPTIONS_BAD;
    }
    return OPTIONS_READ;
}

option_result options_read(const option_set *set, int argc, char **argv, const char **words,
                           size_t *word_count)
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
        } else if (!only_words && strcmp(argv[i], "--version") == 0) {
            options_version();
            return OPTIONS_HELPED;
        } else if (!only_words && strcmp(argv[i], OPTIONS_TABLE) == 0) {
            options_table(set);
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
