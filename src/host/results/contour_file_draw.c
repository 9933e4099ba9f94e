/* Contours over their image, as SVG. */
#include "src/base/build.h"

#include <stdio.h>

#include "cairn/contour_file.h"
#include "src/host/pictures/report_overlay.h"

static const char *const side_names[3] = {"left", "right", "other"};

/* Returns the side of a segment: 0 left, 1 right, 2 neither. */
static int32_t side_of(const cairn_contour_file_picture *picture,
                       const cairn_contour_search_object *object, int32_t segment)
{
    for (int32_t k = 0; k < object->disc_count; k++)
        for (int32_t side = 0; side < 2; side++)
            if (picture->result->discs[object->first_disc + k].side[side] == segment)
                return side;
    return 2;
}

static void print_segments(cairn_output *output, const cairn_contour_file_picture *picture,
                           const cairn_contour_search_object *object)
{
    for (int32_t side = 0; side < 3; side++) {
        cairn_output_print(output, "<path class=\"%s\" d=\"", side_names[side]);
        for (int32_t i = 0; i < object->found.count; i++) {
            int32_t segment = picture->result->segments[object->found.first + i];
            cairn_segment line = picture->tokens->lines[segment];

            if (side_of(picture, object, segment) == side)
                cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)line.a.x,
                                   (double)line.a.y, (double)line.b.x, (double)line.b.y);
        }
        cairn_output_print(output, "\"/>\n");
    }
}

static void print_skeleton(cairn_output *output, const cairn_contour_file_picture *picture,
                           const cairn_contour_search_object *object)
{
    const cairn_shape_model_path walk = {.count = object->disc_count};
    int32_t count = object->outline_count > 0 ? picture->model->path_count : 1;

    for (int32_t i = 0; i < count; i++) {
        const cairn_shape_model_path *path =
            object->outline_count > 0 ? &picture->model->paths[i] : &walk;
        const cairn_contour_search_disc *discs =
            &picture->result->discs[object->first_disc + path->first];

        cairn_output_print(output, "<path class=\"axis\" d=\"");
        for (int32_t k = 0; k < path->count; k++)
            cairn_output_print(output, "%s%.1f %.1f", k == 0 ? "M" : "L", (double)discs[k].centre.x,
                               (double)discs[k].centre.y);
        cairn_output_print(output, "\"/>\n");
        for (int32_t k = 0; k < path->count; k++)
            if (discs[k].side[0] >= 0 && discs[k].side[1] >= 0)
                cairn_output_print(
                    output, "<circle class=\"disc\" cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>\n",
                    (double)discs[k].centre.x, (double)discs[k].centre.y, (double)discs[k].radius);
    }
}

/* Draws the deformed outline for display only, dashed where the contour is not observed. */
static void print_model(cairn_output *output, const cairn_contour_file_picture *picture,
                        const cairn_contour_search_object *object)
{
    const cairn_contour_search_place *outline = &picture->result->outline[object->first_outline];
    int32_t first, count;

    cairn_output_print(output, "<path class=\"model\" d=\"");
    for (int32_t i = 0; i < object->outline_count; i++)
        cairn_output_print(output, "M%.1f %.1fh0", (double)outline[i].point.position.x,
                           (double)outline[i].point.position.y);
    cairn_output_print(output, "\"/>\n<path class=\"completed\" d=\"");
    for (int32_t from = 0;
         cairn_contour_search_completed(picture->result, object, from, &first, &count);
         from = first + count)
        for (int32_t i = first; i < first + count; i++)
            cairn_output_print(output, "%s%.1f %.1f", i == first ? "M" : "L",
                               (double)outline[i].point.position.x,
                               (double)outline[i].point.position.y);
    cairn_output_print(output, "\"/>\n");
}

static void print_object(cairn_output *output, const cairn_contour_file_picture *picture,
                         const cairn_contour_search_object *object)
{
    print_skeleton(output, picture, object);
    print_model(output, picture, object);
    print_segments(output, picture, object);
    cairn_output_print(output, "<text class=\"score\" x=\"%.1f\" y=\"%.1f\">%.2f</text>\n",
                       (double)object->found.origin.x, (double)object->found.origin.y,
                       (double)object->found.score);
}

cairn_status cairn_contour_file_draw(const cairn_contour_file_picture *picture, const char *path,
                                     cairn_file_error *error)
{
    static const cairn_report_key keys[] = {
        {"left side", "stroke=\"#2563eb\""},
        {"right side", "stroke=\"#ea580c\""},
        {"ends and others", "stroke=\"#16a34a\""},
        {"skeleton", "stroke=\"#dc2626\""},
        {"deformed outline, dashed: unseen", "stroke=\"#7c3aed\""}};
    char subtitle[256], style[640];
    const cairn_report_overlay overlay = {.title = picture->image,
                                          .subtitle = subtitle,
                                          .grey = picture->grey,
                                          .width = picture->tokens->width,
                                          .height = picture->tokens->height,
                                          .min_width = 960,
                                          .keys = keys,
                                          .key_count = sizeof keys / sizeof *keys,
                                          .key_step = 160};
    double scale = cairn_report_overlay_scale(&overlay);
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    (void)snprintf(subtitle, sizeof subtitle,
                   "%d of %.120s, best score %.2f; %d segments of %d chains",
                   (int)picture->result->object_count, picture->model_name,
                   (double)picture->result->best_score, (int)picture->tokens->count,
                   (int)picture->tokens->chain_count);
    (void)snprintf(style, sizeof style,
                   "path{fill:none}.left,.right,.other{stroke-width:%.2f;stroke-linecap:round}"
                   ".left{stroke:#2563eb}.right{stroke:#ea580c}.other{stroke:#16a34a}.axis{stroke:#"
                   "dc2626;stroke-width:%.2f}"
                   ".completed{stroke:#7c3aed;stroke-width:%.2f;stroke-dasharray:%.2f}.disc{fill:"
                   "none;stroke:#dc2626;stroke-width:"
                   "%.2f;opacity:.35}.model{stroke:#7c3aed;stroke-width:%.2f;"
                   "stroke-linecap:round}.score{font-size:%.1fpx;fill:#dc2626}",
                   2.6 / scale, 2 / scale, 2 / scale, 6 / scale, 1 / scale, 2 / scale, 18 / scale);
    status = cairn_report_overlay_begin(output, &overlay, style);
    for (int32_t i = 0; i < picture->result->object_count; i++)
        print_object(output, picture, &picture->result->objects[i]);
    return cairn_report_overlay_end(output, &overlay, status, path, error);
}
