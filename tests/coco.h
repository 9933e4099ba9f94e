/* COCO files of the programs compared with the masks beside them. */
#ifndef CAIRN_TESTS_COCO_H
#define CAIRN_TESTS_COCO_H

#include "cairn/json_text.h"
#include "src/host/files/map_file_image.h"
#include "tests/programs.h"

/* tests/compare_coco.py reads file and masks by the PyPI package pycocotools. PYTHON: an
 * interpreter that has it. */
static inline void coco_compare(const char *coco, const char *masks)
{
    const char *python = getenv("PYTHON") != NULL ? getenv("PYTHON") : "python3";
    char file[512], command[2048];

    (void)snprintf(command, sizeof command,
                   "test -f tests/compare_coco.py && %s -c 'import pycocotools.coco' >'%s' 2>&1",
                   python, files_path("python"));
    if (system(command) != 0) {
        printf("skipped: %s has no package pycocotools, or this is not the folder of the sources\n",
               python);
        return;
    }
    (void)snprintf(file, sizeof file, "%s", files_path(coco));
    (void)snprintf(command, sizeof command, "%s tests/compare_coco.py '%s' '%s'", python, file,
                   files_path(masks));
    assert_int_equal(system(command), 0);
}

/* The number after a key, from `*at` on, which is moved behind it. */
static inline double coco_number(const char **at, const char *key)
{
    *at = strstr(*at, key);
    assert_non_null(*at);
    *at += strlen(key);
    return strtod(*at, NULL);
}

/* Reads the file back: well-formed, `count` annotations, and the area and box of the first one are
 * those of the mask of STEM, the box within a tolerance in pixels. */
static inline void assert_coco(const char *coco, const char *masks, const char *stem, int count,
                               double tolerance)
{
    char *text = files_read(files_path(coco), NULL), name[256];
    const char *at = text;
    cairn_json json;
    cairn_json_token token;
    cairn_file_error error;
    cairn_image mask;
    double area, box[4], bounds[4] = {1e9, 1e9, -1, -1}, inside = 0;
    int found = 0;

    assert_non_null(text);
    json = cairn_json_begin("json", text, strlen(text));
    do {
        assert_int_equal(cairn_json_next(&json, &token, &error), CAIRN_OK);
        found += token.kind == CAIRN_JSON_NAME && cairn_json_is(&token, "image_id");
    } while (token.kind != CAIRN_JSON_END);
    assert_int_equal(found, count);
    area = coco_number(&at, "\"area\": ");
    box[0] = coco_number(&at, "\"bbox\": [");
    for (int k = 1; k < 4; k++)
        box[k] = coco_number(&at, ", ");
    (void)snprintf(name, sizeof name, "%s/%s-mask-1.png", masks, stem);
    assert_int_equal(cairn_image_read(&mask, files_path(name), &error), CAIRN_OK);
    for (int32_t y = 0; y < mask.height; y++)
        for (int32_t x = 0; x < mask.width; x++)
            if (mask.pixel[y * mask.width + x] == 255) {
                inside++;
                bounds[0] = x < bounds[0] ? x : bounds[0];
                bounds[1] = y < bounds[1] ? y : bounds[1];
                bounds[2] = x + 1 > bounds[2] ? x + 1 : bounds[2];
                bounds[3] = y + 1 > bounds[3] ? y + 1 : bounds[3];
            }
    cairn_image_free(&mask);
    assert_near(area, inside, 0);
    assert_near(box[0], bounds[0], tolerance);
    assert_near(box[1], bounds[1], tolerance);
    assert_near(box[0] + box[2], bounds[2], tolerance);
    assert_near(box[1] + box[3], bounds[3], tolerance);
    free(text);
    coco_compare(coco, masks);
}

#endif
