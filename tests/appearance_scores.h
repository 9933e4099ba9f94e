/* Scores of boxes in images whose words are computed; the plug-in, where it is there. */
#ifndef CAIRN_TESTS_APPEARANCE_SCORES_H
#define CAIRN_TESTS_APPEARANCE_SCORES_H

#include "cairn/appearance_image.h"
#include "tests/test.h"

static inline void need_library(void)
{
    cairn_file_error error;

    if (cairn_appearance_image_load(&error) == CAIRN_UNSUPPORTED) {
        print_message("%s: skipped\n", error.text);
        skip();
    }
}

/* The scores of a box. */
static inline cairn_appearance_result appearance_of(const cairn_appearance_image *image,
                                                    const cairn_real box[4])
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_appearance_begin_box(image->field, box));
    assert_ok(cairn_appearance_step(image->field, &budget));
    return cairn_appearance_read(image->field);
}

#endif
