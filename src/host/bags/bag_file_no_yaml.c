/* Bag folders without libyaml: refused. It takes the place of bag_file_folder.c where libyaml is
 * missing; the files of a folder are read one by one without it. */
#include "src/base/build.h"

#include <string.h>

#include "src/host/bags/bag_file_work.h"

cairn_status cairn_bag_list_files(cairn_bag_files *files, const char *folder,
                                  cairn_file_error *error)
{
    memset(files, 0, sizeof *files);
    return cairn_file_error_set(error, CAIRN_UNSUPPORTED, folder, 0,
                                "bag folders cannot be read: this program was built without "
                                "libyaml; expected one of the folder's files");
}

void cairn_bag_free_files(cairn_bag_files *files)
{
    memset(files, 0, sizeof *files);
}
