#!/bin/sh
# Writes a library of Arduino, which computes in float: tools/arduino.sh FOLDER [MODULE]...
#
# Arduino compiles all that lies under src/ of a library, without options of its own: so it gets the amalgamation.
set -e
folder=${1:?usage: tools/arduino.sh FOLDER [MODULE]...}
shift
mkdir -p "$folder/src"
sh tools/amalgamate.sh "$folder/src" "$@"
{
    printf '#ifndef CAIRN_FLOAT\n#define CAIRN_FLOAT\n#endif\n'
    cat "$folder/src/cairn.h"
} >"$folder/src/cairn.h.new"
mv "$folder/src/cairn.h.new" "$folder/src/cairn.h"
cp packaging/arduino/library.properties LICENSE "$folder/"
