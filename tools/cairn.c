/* The cairn command: looks up the subcommand by name and runs it. One file for each subcommand. */
#include <stdio.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/vision.h"
#include "src/host/base/posix.h"
#include "tools/cairn_tool.h"

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
    {"info", "summarize a log: scans, beams, time, path, damage", tool_info},
    {"replay", "replay a recorded run of a robot, bit by bit", tool_replay},
};

#define COMMANDS (sizeof commands / sizeof *commands)

#define ABOUT                                                                                      \
    "Maps of robots from range scans, and contours of objects in images.\n\n"                      \
    "cairn help COMMAND prints what a command takes."

static void print_help(FILE *stream)
{
    fprintf(stream, "usage: cairn COMMAND [options] ...\n\ncommands:\n");
    tool_commands_print(commands, COMMANDS, stream);
    fprintf(stream,
            "\n  cairn COMMAND --help   what a command takes (or cairn help COMMAND)\n"
            "  cairn --version        the version\n\n"
            "exit codes: 0 done, 1 out of memory or standard output failed, 2 bad input, output "
            "folder or command line\n");
}

/* Turns "cairn help COMMAND ..." into "cairn COMMAND ... --help". */
static void move_help(int argc, char **argv)
{
    static char help[] = "--help";

    for (int i = 1; i + 1 < argc; i++)
        argv[i] = argv[i + 1];
    argv[argc - 1] = help;
}

static int is_help(const char *word)
{
    return strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0 || strcmp(word, "help") == 0;
}

int main(int argc, char **argv)
{
    const tool_command *command;
    char pixels[16];

    cairn_output_clean_up_on_signals();
    /* OpenCV's decoders have the limit of those before them. */
    (void)snprintf(pixels, sizeof pixels, "%d", CAIRN_VISION_MAX_PIXELS);
    (void)setenv("OPENCV_IO_MAX_IMAGE_PIXELS", pixels, 0);
    if (argc < 2) {
        fprintf(stderr, "cairn: no command, expected one of these\n\n");
        print_help(stderr);
        return TOOL_BAD;
    }
    if (argc > 2 && strcmp(argv[1], "help") == 0)
        move_help(argc, argv);
    if (is_help(argv[1])) {
        print_help(stdout);
        return options_end("cairn", TOOL_OK);
    }
    if (strcmp(argv[1], "--version") == 0) {
        options_version();
        return options_end("cairn", TOOL_OK);
    }
    if (strcmp(argv[1], OPTIONS_TABLE) == 0) {
        tool_commands_table("cairn", ABOUT, commands, COMMANDS);
        return options_end("cairn", TOOL_OK);
    }
    command = tool_command_find(commands, COMMANDS, argv[1]);
    if (command != NULL)
        return options_end("cairn", command->run(argc - 1, argv + 1));
    fprintf(stderr, "cairn: unknown command '%s', expected one of these\n\n", argv[1]);
    print_help(stderr);
    return TOOL_BAD;
}
