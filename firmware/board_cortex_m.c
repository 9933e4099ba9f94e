/* A bare Cortex-M4F or M7 as the board: vectors, startup, clock, and semihosting for output.
 *
 * Method: reset switches the FPU on, copies .data, clears .bss, paints the stack and calls main().
 * The clock is SysTick, which counts down 24 bits at 25 MHz; with one instruction per nanosecond
 * (qemu -icount shift=0) a tick is 40 of them. Every fault ends the program with status 3. */
#include "firmware/board.h"

int main(void);
_Noreturn void board_reset(void);

/* Symbols of the linker script. */
extern uint32_t board_data_load[], board_data_start[], board_data_end[], board_bss_start[],
    board_bss_end[];
extern uint32_t board_stack_bottom[], board_stack_top[];

#define REGISTER(address)  (*(volatile uint32_t *)(address))
#define SYSTICK_CONTROL    REGISTER(0xE000E010u)
#define SYSTICK_RELOAD     REGISTER(0xE000E014u)
#define SYSTICK_VALUE      REGISTER(0xE000E018u)
#define COPROCESSOR_ACCESS REGISTER(0xE000ED88u)

enum { SYSTICK_ON = 5, SYSTICK_LAST = 0xFFFFFF };
enum { STACK_PAINT = 0x5AFE57AC };
enum {
    SEMIHOSTING_OPEN = 0x01,
    SEMIHOSTING_WRITE0 = 0x04,
    SEMIHOSTING_WRITE = 0x05,
    SEMIHOSTING_COMMAND_LINE = 0x15,
    SEMIHOSTING_EXIT_EXTENDED = 0x20
};
enum { OPEN_WRITE_BINARY = 5, APPLICATION_EXIT = 0x20026 };

static uint32_t semihosting(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;

    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void board_print(const char *text)
{
    (void)semihosting(SEMIHOSTING_WRITE0, text);
}

void board_record(const void *data, uint32_t bytes)
{
    static const char name[] = "flight.rec";
    static uint32_t file;
    const uint32_t open[3] = {(uint32_t)(uintptr_t)name, OPEN_WRITE_BINARY, sizeof name - 1};
    uint32_t write[3];

    if (file == 0)
        file = semihosting(SEMIHOSTING_OPEN, open);
    write[0] = file;
    write[1] = (uint32_t)(uintptr_t)data;
    write[2] = bytes;
    if (file == UINT32_MAX || semihosting(SEMIHOSTING_WRITE, write) != 0) {
        board_print("flight.rec: cannot be written\n");
        board_exit(2);
    }
}

int32_t board_number(int32_t otherwise)
{
    char line[128] = {0};
    uint32_t block[2] = {(uint32_t)(uintptr_t)line, sizeof line};
    uint32_t from, end;
    int32_t number = 0;

    if (semihosting(SEMIHOSTING_COMMAND_LINE, block) != 0)
        return otherwise;
    from = end = block[1];
    while (from > 0 && line[from - 1] != ' ')
        from--;
    if (from == end || end - from > 6)
        return otherwise;
    for (; from < end; from++) {
        if (line[from] < '0' || line[from] > '9')
            return otherwise;
        number = 10 * number + (line[from] - '0');
    }
    return number > 0 ? number : otherwise;
}

_Noreturn void board_exit(int status)
{
    uint32_t block[2] = {APPLICATION_EXIT, (uint32_t)status};

    (void)semihosting(SEMIHOSTING_EXIT_EXTENDED, block);
    for (;;) {
    }
}

uint32_t board_clock(void)
{
    static uint32_t last = SYSTICK_LAST, ticks;
    uint32_t now;

    /* Keeps the timed code between both readings: a compiler may move a pure call across a plain
     * one. */
    __asm__ volatile("" ::: "memory");
    now = SYSTICK_VALUE;
    ticks += (last - now) & SYSTICK_LAST;
    last = now;
    __asm__ volatile("" ::: "memory");
    return ticks * BOARD_CLOCK_STEP;
}

uint32_t board_stack_peak(void)
{
    const uint32_t *word = board_stack_bottom;

    while (word != board_stack_top && *word == STACK_PAINT)
        word++;
    return (uint32_t)((uintptr_t)board_stack_top - (uintptr_t)word);
}

uint32_t board_data_bytes(void)
{
    return (uint32_t)((uintptr_t)board_bss_end - (uintptr_t)board_data_start);
}

static _Noreturn void fault(void)
{
    board_print("fault\n");
    board_exit(3);
}

_Noreturn void board_reset(void)
{
    const uint32_t *load = board_data_load;
    uint32_t *painted;

    COPROCESSOR_ACCESS |= 0xFu << 20; /* full access to the FPU */
    __asm__ volatile("dsb\n\tisb" ::: "memory");
    for (uint32_t *word = board_data_start; word != board_data_end; word++)
        *word = *load++;
    for (uint32_t *word = board_bss_start; word != board_bss_end; word++)
        *word = 0;
    /* The stack above this address is already in use and is not painted. */
    __asm__ volatile("mov %0, sp" : "=r"(painted));
    for (uint32_t *word = board_stack_bottom; word < painted; word++)
        *word = STACK_PAINT;
    SYSTICK_RELOAD = SYSTICK_LAST;
    SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = SYSTICK_ON;
    board_exit(main());
}

/* Stack, reset, NMI, and the faults of the core; no interrupts. */
static const struct {
    uint32_t *stack;
    void (*handler[15])(void);
} vectors __attribute__((section(".vectors"), used)) = {
    board_stack_top,
    {board_reset, fault, fault, fault, fault, fault},
};
