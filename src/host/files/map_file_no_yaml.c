/* Map files without libyaml: reading is refused. It takes the place of map_file_yaml.c where
 * libyaml is missing; maps are written without it. */
#include "src/base/build.h"

#include "src/host/files/map_file_work.h"

cairn_status cairn_map_file_read(cairn_map_file *map, const char *yaml_path,
                                 cairn_file_error *error)
{
    *map = cairn_map_file_default();
    return cairn_file_error_set(error, CAIRN_UNSUPPORTED, yaml_path, 0,
                                "map files cannot be read: this program was built without libyaml");
}
