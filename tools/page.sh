#!/bin/sh
# Prints the page of the player, src/host/pictures/report_player.html, as the C strings that the library holds: tools/page.sh
export LC_ALL=C
cat <<'END'
/* The page of the player, line by line. Made by tools/page.sh from src/host/pictures/report_player.html. */
#include "src/base/build.h"

#include "src/host/pictures/report_player.h"

/* clang-format off */
const char *const cairn_report_player_page[] = {
END
sed 's/[\\"]/\\&/g; s/.*/    "&\\n",/' src/host/pictures/report_player.html
printf '    NULL\n};\n'
