/* cairn: one command, one file per subcommand. */
#include <stdio.h>
#include <string.h>

#include "cairn/version.h"
#include "tools/cairn_tool.h"

typedef struct tool_command {
    const char *name;
    const char *summary;
    int (*run)(int argc, char **argv);
} tool_command;

static const tool_command commands[] = {
    {"align", "align all scans of a log at once, in any order", tool_align},
    {"map", "map a log, scan by scan", tool_map},
    {"eval", "how good a map, its poses and relations are", tool_eval},
    {"graph", "solve a pose graph (g2o), bad links named", tool_graph},
    {"match", "find where one scan was taken, as seen from another", tool_match},
    {"merge", "put the maps of many robots together, with no guess", tool_merge},
    {"detect", "objects of a class in images, by one model of their outline", tool_detect},
    {"group", "the contours of a known object in images", tool_group},
    {"skeleton", "contours and axes of symmetric parts of images, with no model", tool_skeleton},
    {"model", "the model of a shape, from a silhouette or a drawing", tool_model},
    {"symmetry", "the axes that divide a shape into two parts most alike", tool_symmetry},
    {"train", "what a class of objects looks like, from boxes in images", tool_train},
    {"info", "what a CARMEN log holds: scans, beams, time, path, damage", tool_info},
    {"replay", "a robot's recorded run once more, bit by bit", tool_replay},
};

#define COMMANDS (sizeof commands / sizeof *commands)

static void print_help(FILE *stream)
{
    fprintf(stream, "usage: cairn COMMAND [options] ...\n\ncommands:\n");
    for (size_t i = 0; i < COMMANDS; i++)
        fprintf(stream, "  %-10s %s\n", commands[i].name, commands[i].summary);
    fprintf(stream, "\n  cairn COMMAND --help   what a command takes\n"
                    "  cairn --version        the version\n\n"
                    "exit codes: 0 done, 1 no memory or nowhere to print, 2 bad input, output "
                    "folder or command line\n");
}

/* What was printed must have arrived: a full disk behind a pipe is a failure. */
static int close_output(int code)
{
    if (fflush(stdout) != 0 || ferror(stdout)) {
        perror("cairn: standard output");
        return code == TOOL_OK ? TOOL_FAILED : code;
    }
    return code;
}

int main(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "";

    if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0 || strcmp(name, "help") == 0) {
        print_help(stdout);
        return close_output(TOOL_OK);
    }
    if (strcmp(name, "--version") == 0) {
        printf("cairn %s\n", cairn_version_text());
        return close_output(TOOL_OK);
    }
    for (size_t i = 0; i < COMMANDS; i++)
        if (strcmp(name, commands[i].name) == 0)
            return close_output(commands[i].run(argc - 1, argv + 1));
    if (argc < 2)
        fprintf(stderr, "cairn: no command, expected one of these\n\n");
    else
        fprintf(stderr, "cairn: unknown command '%s', expected one of these\n\n", name);
    print_help(stderr);
    return TOOL_BAD;
}
