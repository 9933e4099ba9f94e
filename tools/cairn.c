#include "tools/cairn.h"

#include <stdio.h>
#include <string.h>

#include "cairn/version.h"
#include "tools/console.h"

typedef struct command {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *about;
} command;

static const command commands[] = {
    {"align", cairn_align_main, "align all scans of a log at once, in any order"},
    {"map", cairn_map_main, "map a log, scan by scan"},
};

enum { COMMANDS = sizeof commands / sizeof *commands };

static void print_help(void)
{
    printf("usage: cairn COMMAND ... \n\nMaps from laser scans, in fixed memory.\n\ncommands:\n");
    for (int i = 0; i < COMMANDS; i++)
        printf("  %-10s %s\n", commands[i].name, commands[i].about);
    printf("\ncairn COMMAND --help explains a command, cairn --version tells which cairn this is.\n");
}

int main(int argc, char **argv)
{
    const char *word = argc > 1 ? argv[1] : "";

    if (strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0) {
        print_help();
        return EXIT_DONE;
    }
    if (strcmp(word, "--version") == 0) {
        printf("cairn %s\n", cairn_version_text());
        return EXIT_DONE;
    }
    for (int i = 0; i < COMMANDS; i++)
        if (strcmp(word, commands[i].name) == 0)
            return commands[i].run(argc - 1, argv + 1);
    if (word[0] == '\0')
        return console_bad_input("cairn", "no command, expected one of those that --help lists");
    return console_bad_input("cairn", "unknown command '%s', expected one of those that --help lists", word);
}
