/* The cairn command: looks up the subcommand by name and runs it. One file for each subcommand. */
#include <stdio.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/version.h"
#include "cairn/vision.h"
#include "src/host/base/posix.h"
#include "tools/cairn_tool.h"

typedef struct tool_command {
    const char *name;
    const char *summary;
    int (*run)(int argc, char **argv);
} tool_command;

static const tool_command commands[] = {
    {"align", "align all scans of a log at once, in any order", tool_align},
    {"map", "map a log, scan by scan", tool_map},
    {"eval", "evaluate a map, its poses or relative poses", tool_eval},
    {"graph", "solve a pose graph (g2o), report outlier links", tool_graph},
    {"match", "match two scans: relative pose, covariance, ambiguity", tool_match},
    {"merge", "merge occupancy maps of several robots, without a prior", tool_merge},
    {"detect", "detect objects of a class in images by a model of their outline", tool_detect},
    {"group", "group contours of a known object in images", tool_group},
    {"skeleton", "group contours and axes of symmetric parts, without a model", tool_skeleton},
    {"model", "build the model of a shape from a silhouette or a drawing", tool_model},
    {"symmetry", "find the axes of symmetry (self-similarity) of shapes", tool_symmetry},
    {"train", "train the appearance of a class from bounding boxes in images", tool_train},
    {"info", "summarize a CARMEN log: scans, beams, time, path, damage", tool_info},
    {"replay", "replay a recorded run of a robot, bit by bit", tool_replay},
};

#define COMMANDS (sizeof commands / sizeof *commands)

static void print_help(FILE *stream)
{
    fprintf(stream, "usage: cairn COMMAND [options] ...\n\ncommands:\n");
    for (size_t i = 0; i < COMMANDS; i++)
        fprintf(stream, "  %-10s %s\n", commands[i].name, commands[i].summary);
    fprintf(stream,
            "\n  cairn COMMAND --help   what a command takes (or cairn help COMMAND)\n"
            "  cairn --version        the version\n\n"
            "exit codes: 0 done, 1 out of memory or standard output failed, 2 bad input, output "
            "folder or command line\n");
}

/* Flushes standard output and returns the exit code: TOOL_FAILED when a write failed, such as on a
 * full disk. */
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
    char pixels[16], help[] = "--help";

    cairn_output_clean_up_on_signals();
    /* OpenCV's decoders have the limit of those before them. */
    (void)snprintf(pixels, sizeof pixels, "%d", CAIRN_VISION_MAX_PIXELS);
    (void)setenv("OPENCV_IO_MAX_IMAGE_PIXELS", pixels, 0);
    if (strcmp(name, "help") == 0 && argc > 2) {
        /* cairn help COMMAND is cairn COMMAND --help. */
        name = argv[2];
        argv[1] = argv[2];
        argv[2] = help;
        argc = 3;
    }
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
