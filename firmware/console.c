/* Output of the loops and cost statistics of their ticks. */
#include "src/base/build.h"

#include "firmware/board.h"
#include "firmware/console.h"

static char *put_text(char *at, const char *text)
{
    while (*text != '\0')
        *at++ = *text++;
    *at = '\0';
    return at;
}

static char *put_number(char *at, int32_t value)
{
    char digits[10];
    int count = 0;
    uint32_t rest = value < 0 ? 0U - (uint32_t)value : (uint32_t)value;

    if (value < 0)
        *at++ = '-';
    do
        digits[count++] = (char)('0' + rest % 10);
    while ((rest /= 10) > 0);
    while (count > 0)
        *at++ = digits[--count];
    *at = '\0';
    return at;
}

static char *put_hex(char *at, uint32_t value)
{
    for (int shift = 28; shift >= 0; shift -= 4)
        *at++ = "0123456789abcdef"[value >> shift & 15];
    *at = '\0';
    return at;
}

void console_numbers(const char *what, const char *of_what, const int32_t *number, int32_t count)
{
    char line[160], *at = put_text(put_text(put_text(line, what), " "), of_what);

    for (int32_t i = 0; i < count; i++)
        at = put_number(put_text(at, " "), number[i]);
    (void)put_text(at, "\n");
    board_print(line);
}

_Noreturn void console_give_up(const char *what, cairn_status status)
{
    char line[160], *at = put_text(put_text(put_text(line, what), ": "), cairn_status_text(status));

    (void)put_text(at, "\n");
    board_print(line);
    board_exit(1);
}

/* Divides bit by bit, as the code of the compiler's 64-bit division would be a tenth of the size of
 * the whole loop. */
static uint32_t mean_of(const console_measure *m)
{
    uint64_t rest = m->sum, part = (uint64_t)m->ticks << 31;
    uint32_t mean = 0;

    for (int bit = 31; bit >= 0 && m->ticks > 0; bit--, part >>= 1)
        if (rest >= part) {
            rest -= part;
            mean |= 1U << bit;
        }
    return mean;
}

void console_count(console_measure *m, uint32_t instructions, int32_t units)
{
    m->ticks++;
    m->sum += instructions;
    m->worst = instructions > m->worst ? instructions : m->worst;
    m->worst_units = units > m->worst_units ? units : m->worst_units;
}

void console_measured(const char *what, const console_measure *m)
{
    int32_t number[4] = {(int32_t)m->ticks, (int32_t)mean_of(m), (int32_t)m->worst, m->worst_units};

    console_numbers("measure ticks,mean,worst,units", what, number, 4);
}

void console_hash(const char *name, uint32_t hash)
{
    char line[64], *at = put_hex(put_text(put_text(put_text(line, "hash "), name), " "), hash);

    (void)put_text(at, "\n");
    board_print(line);
}
