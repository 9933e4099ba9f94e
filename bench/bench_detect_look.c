#include <stdio.h>
#include <string.h>

#include "bench/bench_detect_look.h"
#include "cairn/vision.h"

enum { PATH_ROOM = 4096 };

static int say(const cairn_file_error *error)
{
    fprintf(stderr, "bench/detect: %s\n", error->text);
    return 0;
}

static int read_grey(cairn_vision_image *grey, char path[PATH_ROOM], const char *folder,
                     const char *name)
{
    cairn_file_error error;

    (void)snprintf(path, PATH_ROOM, "%s/%s.jpg", folder, name);
    return cairn_vision_read_grey(grey, path, &error) == CAIRN_OK || say(&error);
}

static int add(cairn_appearance_trainer *trainer, const char *folder, const char *name,
               const char *class_name)
{
    double boxes[GROUP_INSTANCES][4];
    cairn_file_error error;
    cairn_vision_image grey;
    group_image image;
    char path[PATH_ROOM];
    int ok;

    if (!group_image_read(&image, folder, name, class_name))
        return 0;
    for (int32_t i = 0; i < image.instances; i++) {
        boxes[i][0] = image.box[i].left;
        boxes[i][1] = image.box[i].top;
        boxes[i][2] = image.box[i].right;
        boxes[i][3] = image.box[i].bottom;
    }
    ok = read_grey(&grey, path, folder, name);
    if (ok) {
        ok = cairn_appearance_trainer_add(trainer, grey.samples, grey.width, grey.height, boxes[0],
                                          image.instances, path, &error) == CAIRN_OK ||
             say(&error);
        cairn_vision_free(&grey);
    }
    group_image_free(&image);
    return ok;
}

int detect_look_train(cairn_appearance_model *model, const char *folder, const char *class_name,
                      int32_t count)
{
    cairn_appearance_train_params params = cairn_appearance_train_default();
    cairn_appearance_trainer *trainer = cairn_appearance_trainer_new();
    cairn_file_error error = {.text = "no memory"};
    group_names names;
    int ok = trainer != NULL || say(&error);

    memset(model, 0, sizeof *model);
    if (!group_names_read(&names, folder) || names.count <= count) {
        fprintf(stderr, "bench/detect: %s: %d images, expected more than --train %d\n", folder,
                (int)names.count, (int)count);
        ok = 0;
    }
    for (int32_t i = 0; i < count && ok; i++)
        ok = add(trainer, folder, names.name[i], class_name);
    ok = ok && (cairn_appearance_train(model, trainer, &params, folder, &error) == CAIRN_OK ||
                say(&error));
    cairn_appearance_trainer_free(trainer);
    group_names_free(&names);
    return ok;
}

int detect_look_field(cairn_appearance_image *words, const cairn_appearance_model *model,
                      const char *folder, const group_image *image)
{
    cairn_file_error error;
    cairn_vision_image grey;
    char path[PATH_ROOM];
    int ok;

    memset(words, 0, sizeof *words);
    if (!read_grey(&grey, path, folder, image->name))
        return 0;
    if (grey.width != image->width || grey.height != image->height) {
        fprintf(stderr, "bench/detect: %s: %d x %d, but its edges %d x %d\n", path, (int)grey.width,
                (int)grey.height, (int)image->width, (int)image->height);
        ok = 0;
    } else {
        ok = cairn_appearance_image_make(words, model, grey.samples, grey.width, grey.height, path,
                                         &error) == CAIRN_OK ||
             say(&error);
    }
    cairn_vision_free(&grey);
    return ok;
}
