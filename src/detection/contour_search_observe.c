/* Steps of the grouping of a search, between which its filter is observed. */
#include "src/base/build.h"

#include "src/detection/contour_search_object.h"

int cairn_contour_search_step_observed(cairn_contour_search *search, cairn_budget *budget,
                                       int32_t units_per_callback,
                                       int32_t (*observe_filter)(cairn_contour_search *))
{
    search->status = CAIRN_MORE;
    while (search->status == CAIRN_MORE && budget->left > 0) {
        int32_t units =
            search->units_to_callback < budget->left ? search->units_to_callback : budget->left;
        cairn_budget part = {units};

        search->status = cairn_contour_grouping_step(search->grouping, &part);
        budget->left -= units - part.left;
        search->units_to_callback -= units - part.left;
        if (search->status == CAIRN_OK || search->units_to_callback <= 0) {
            budget->left -= observe_filter(search);
            search->units_to_callback = units_per_callback;
        }
    }
    return search->status == CAIRN_OK;
}
