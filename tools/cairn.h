/* The subcommands of cairn. Each takes its own command line, argv[0] being its name, and returns the exit code. */
#ifndef CAIRN_TOOLS_CAIRN_H
#define CAIRN_TOOLS_CAIRN_H

int cairn_align_main(int argc, char **argv);
int cairn_map_main(int argc, char **argv);

#endif
