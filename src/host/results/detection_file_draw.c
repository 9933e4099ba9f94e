/* Drawing of detections over their image; as written with the matched parts of the model (Adluru
 * 2008, fig. 5.6). */
#include "src/base/build.h"

#include <math.h>
#include <stdio.h>

#include "cairn/detection_file.h"
#include "cairn/output.h"
#include "src/host/images/shape_model_file_parts.h"
#include "src/host/pictures/report_overlay.h"

/* The inset: side relative to the longer side of the image, greatest side relative to the shorter
 * one, margin and size of the model relative to its side. */
#define INSET_SIDE     0.18
#define INSET_MAX_SIDE 0.5
#define INSET_MARGIN   0.06
#define INSET_MODEL    0.85
/* Points of a segment that an inset may cover, besides the first. */
enum { POINTS_PER_SEGMENT = 8 };

typedef struct detections_drawing {
    const cairn_detection_file_picture *picture;
    int32_t has_parts;             /* 1: parts are drawn */
    cairn_shape_model_parts parts; /* of the model */
} detections_drawing;

/* ---- One detection ---- */

/* Returns 1 when the side of the outline that ends at a sample lies in a fragment. */
static int covers(const cairn_part_bundle_fragment *fragment, int32_t sample)
{
    return fragment->from < fragment->to ? sample > fragment->from && sample <= fragment->to
                                         : sample > fragment->from || sample <= fragment->to;
}

/* Returns 1 when the side of the outline that ends at a sample is matched. */
static int is_seen(const detections_drawing *drawing, const cairn_object_detection *detection,
                   int32_t sample)
{
    const cairn_object_detections *all = drawing->picture->detections;

    if (!drawing->has_parts)
        return all->outline[detection->first_outline + sample].segment >= 0;
    for (int32_t i = 0; i < detection->part_count && sample < drawing->parts.outline; i++)
        if (covers(&drawing->parts.found.fragments[all->parts[detection->first_part + i].fragment],
                   sample))
            return 1;
    return 0;
}

/* Draws the matched sides of the outline, or the unmatched ones: consecutive ones as one line, so
 * that dashes continue. */
static void draw_outline(cairn_output *output, const detections_drawing *drawing,
                         const cairn_object_detection *detection, int seen)
{
    const cairn_contour_search_place *outline =
        &drawing->picture->detections->outline[detection->first_outline];
    int is_drawn = 0;

    cairn_output_print(output, "<path class=\"%s\" d=\"", seen ? "seen" : "missing");
    for (int32_t i = 1; i < detection->outline_count; i++) {
        int was_drawn = is_drawn;

        is_drawn = outline[i].outline_index == outline[i - 1].outline_index &&
                   is_seen(drawing, detection, i) == seen;
        if (is_drawn && !was_drawn)
            cairn_output_print(output, "M%.1f %.1f", (double)outline[i - 1].point.position.x,
                               (double)outline[i - 1].point.position.y);
        if (is_drawn)
            cairn_output_print(output, "L%.1f %.1f", (double)outline[i].point.position.x,
                               (double)outline[i].point.position.y);
    }
    cairn_output_print(output, "\"/>\n");
}

/* Draws the segments of a detection along a chain; -1: all its segments. */
static void draw_segments(cairn_output *output, const cairn_detection_file_picture *picture,
                          const cairn_object_detection *detection, int32_t chain)
{
    const int32_t *segments = &picture->detections->segments[detection->first_segment];

    for (int32_t i = 0; i < detection->segment_count; i++) {
        cairn_segment line = picture->tokens->lines[segments[i]];

        if (chain < 0 || picture->tokens->chain[segments[i]] == chain)
            cairn_output_print(output, "M%.1f %.1fL%.1f %.1f", (double)line.a.x, (double)line.a.y,
                               (double)line.b.x, (double)line.b.y);
    }
    cairn_output_print(output, "\"/>\n");
}

/* Draws the edge fragment of each part in the colour of the part. */
static void draw_matched(cairn_output *output, const detections_drawing *drawing,
                         const cairn_object_detection *detection)
{
    const cairn_detection_file_picture *picture = drawing->picture;

    for (int32_t i = 0; i < detection->part_count; i++) {
        const cairn_object_detect_part *part =
            &picture->detections->parts[detection->first_part + i];

        cairn_output_print(output, "<path class=\"fragment\" stroke=\"%s\" d=\"",
                           cairn_shape_model_parts_colour(part->bundle));
        draw_segments(output, picture, detection, part->chain);
    }
}

static void draw_detection(cairn_output *output, const detections_drawing *drawing,
                           const cairn_object_detection *detection)
{
    const cairn_detection_file_picture *picture = drawing->picture;

    if (drawing->has_parts && detection == picture->detections->found) {
        draw_matched(output, drawing, detection);
    } else {
        cairn_output_print(output, "<path class=\"segment\" d=\"");
        draw_segments(output, picture, detection, -1);
    }
    draw_outline(output, drawing, detection, 1);
    draw_outline(output, drawing, detection, 0);
    cairn_output_print(
        output,
        "<rect class=\"box\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n"
        "<text class=\"score\" x=\"%.1f\" y=\"%.1f\">%.2f</text>\n",
        (double)detection->left, (double)detection->top,
        (double)(detection->right - detection->left), (double)(detection->bottom - detection->top),
        (double)detection->left, (double)detection->top, (double)detection->score);
}

/* Draws all, the best last; of detections with parts the others are paler. */
static void draw_all(cairn_output *output, const detections_drawing *drawing)
{
    const cairn_object_detections *all = drawing->picture->detections;

    if (drawing->has_parts)
        cairn_output_print(output, "<g class=\"others\">\n");
    for (int32_t i = all->count - 1; i >= 0; i--) {
        if (i == 0 && drawing->has_parts)
            cairn_output_print(output, "</g>\n");
        draw_detection(output, drawing, &all->found[i]);
    }
}

/* ---- The matched parts of the model ---- */

static int is_covered(cairn_box square, cairn_vec2 point)
{
    cairn_box box = {point, point};

    return cairn_box_overlap(square, box);
}

/* Returns the points of a detection's segments and outline that a square covers. */
static int32_t covered_points(const cairn_detection_file_picture *picture,
                              const cairn_object_detection *detection, cairn_box square)
{
    const cairn_object_detections *all = picture->detections;
    int32_t count = 0;

    for (int32_t i = 0; i < detection->outline_count; i++)
        count += is_covered(square, all->outline[detection->first_outline + i].point.position);
    for (int32_t i = 0; i < detection->segment_count; i++) {
        cairn_segment line = picture->tokens->lines[all->segments[detection->first_segment + i]];

        for (int32_t k = 0; k <= POINTS_PER_SEGMENT; k++)
            count += is_covered(
                square, cairn_vec2_interpolate(line.a, line.b,
                                               (cairn_real)k / (cairn_real)POINTS_PER_SEGMENT));
    }
    return count;
}

static double overlap_of(double from, double to, cairn_real other_from, cairn_real other_to)
{
    return fmax(0, fmin(to, (double)other_to) - fmax(from, (double)other_from));
}

/* Returns the area of a square that boxes of detections cover, px^2. */
static double covered_area(const cairn_object_detections *all, cairn_box square)
{
    double area = 0;

    for (int32_t i = 0; i < all->count; i++)
        area += overlap_of((double)square.min.x, (double)square.max.x, all->found[i].left,
                           all->found[i].right) *
                overlap_of((double)square.min.y, (double)square.max.y, all->found[i].top,
                           all->found[i].bottom);
    return area;
}

/* Returns the square of the inset: in the corner where it covers least of the best detection, of
 * equal ones least of all boxes, of equal ones the first from the top left. */
static cairn_box inset_of(const cairn_detection_file_picture *picture)
{
    double width = picture->tokens->width, height = picture->tokens->height,
           side = fmin(INSET_SIDE * fmax(width, height), INSET_MAX_SIDE * fmin(width, height)),
           margin = INSET_MARGIN * side, least_area = 0;
    int32_t least_points = INT32_MAX;
    cairn_box inset = cairn_box_empty();

    for (int32_t corner = 0; corner < 4; corner++) {
        double left = corner % 2 == 0 ? margin - 0.5 : width - 0.5 - margin - side,
               top = corner < 2 ? margin - 0.5 : height - 0.5 - margin - side, area;
        cairn_box square = {{(cairn_real)left, (cairn_real)top},
                            {(cairn_real)(left + side), (cairn_real)(top + side)}};
        int32_t points = covered_points(picture, &picture->detections->found[0], square);

        area = covered_area(picture->detections, square);
        if (points < least_points || (points == least_points && area < least_area)) {
            inset = square;
            least_points = points;
            least_area = area;
        }
    }
    return inset;
}

/* Returns the parts of a detection that are drawn before one of them: longer fragments, so that
 * none hides another. */
static int32_t count_longer(const detections_drawing *drawing,
                            const cairn_object_detection *detection, int32_t part)
{
    const cairn_object_detect_part *parts =
        &drawing->picture->detections->parts[detection->first_part];
    const cairn_part_bundle_fragment *fragments = drawing->parts.found.fragments;
    int32_t count = 0;

    for (int32_t i = 0; i < detection->part_count; i++) {
        cairn_real own = fragments[parts[part].fragment].length,
                   other = fragments[parts[i].fragment].length;

        count += other > own || (i < part && !(other < own));
    }
    return count;
}

/* Draws the model with the parts of the best detection. */
static void draw_inset(cairn_output *output, const detections_drawing *drawing)
{
    const cairn_detection_file_picture *picture = drawing->picture;
    const cairn_object_detection *best = picture->detections->found;
    cairn_box inset = inset_of(picture);
    double side = (double)(inset.max.x - inset.min.x);
    cairn_shape_model_view view = {.x = (double)inset.min.x + side / 2,
                                   .y = (double)inset.min.y + side / 2,
                                   .size = INSET_MODEL * side,
                                   .mirrored = best->mirrored};

    cairn_output_print(
        output, "<rect class=\"inset\" x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\"/>\n",
        (double)inset.min.x, (double)inset.min.y, side, side);
    cairn_shape_model_parts_print_outline(output, &drawing->parts, picture->model, &view);
    for (int32_t turn = 0; turn < best->part_count; turn++)
        for (int32_t i = 0; i < best->part_count; i++)
            if (count_longer(drawing, best, i) == turn)
                cairn_shape_model_parts_print_fragment(
                    output, &drawing->parts, picture->model,
                    picture->detections->parts[best->first_part + i].fragment, &view);
}

/* ---- The picture ---- */

static cairn_status draw(const detections_drawing *drawing, const char *path,
                         cairn_file_error *error)
{
    static const cairn_report_key keys[] = {
        {"edge segments along it", "stroke=\"#ea580c\""},
        {"deformed outline; dashed where no edge matches", "stroke=\"#7c3aed\""},
        {"box and score", "stroke=\"#dc2626\""}};
    static const cairn_report_key written_keys[] = {
        {"edge fragments; of the best in the colours of its parts", "stroke=\"#475569\""},
        {"model at the detected pose; dashed where no part matches", "stroke=\"#7c3aed\""},
        {"box and score", "stroke=\"#dc2626\""}};
    const cairn_detection_file_picture *picture = drawing->picture;
    int is_written = picture->mode == CAIRN_MODE_AS_WRITTEN;
    char subtitle[256], style[640];
    const cairn_report_overlay overlay = {.title = picture->image,
                                          .subtitle = subtitle,
                                          .grey = picture->grey,
                                          .width = picture->tokens->width,
                                          .height = picture->tokens->height,
                                          .min_width = is_written ? 1080 : 920,
                                          .keys = is_written ? written_keys : keys,
                                          .key_count = sizeof keys / sizeof *keys,
                                          .key_step = is_written ? 450 : 370};
    double scale = cairn_report_overlay_scale(&overlay);
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    (void)snprintf(subtitle, sizeof subtitle, "%d of %.120s; %d segments of %d chains",
                   (int)picture->detections->count, picture->model_name,
                   (int)picture->tokens->count, (int)picture->tokens->chain_count);
    (void)snprintf(style, sizeof style,
                   "path,.box{fill:none}.segment{stroke:%s;stroke-width:%.2f;stroke-linecap:round}"
                   ".seen,.missing{stroke:#7c3aed;stroke-width:%.2f}.missing{stroke-dasharray:%.2f}"
                   ".box{stroke:#dc2626;stroke-width:%.2f}.score{font-size:%.1fpx;fill:#dc2626}"
                   ".others{opacity:0.45}.fragment{stroke-width:%.2f;stroke-linecap:round}"
                   ".inset{fill:#fff;fill-opacity:0.9;stroke:#475569;stroke-width:%.2f}"
                   ".outline{stroke:#94a3b8;stroke-width:%.2f}",
                   is_written ? "#475569" : "#ea580c", 2.6 / scale, 1.5 / scale, 4 / scale,
                   2 / scale, 18 / scale, 4 / scale, 1.5 / scale, 1.5 / scale);
    status = cairn_report_overlay_begin(output, &overlay, style);
    draw_all(output, drawing);
    if (drawing->has_parts)
        draw_inset(output, drawing);
    return cairn_report_overlay_end(output, &overlay, status, path, error);
}

cairn_status cairn_detection_file_draw(const cairn_detection_file_picture *picture,
                                       const char *path, cairn_file_error *error)
{
    detections_drawing drawing = {.picture = picture};
    cairn_status status = CAIRN_OK;

    drawing.has_parts = picture->mode == CAIRN_MODE_AS_WRITTEN && picture->detections->count > 0;
    if (drawing.has_parts && picture->model == NULL)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "no model, expected that of the search");
    if (drawing.has_parts)
        status = cairn_shape_model_parts_find(&drawing.parts, picture->model, picture->cuts,
                                              picture->cut_count);
    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "parts of the model: %s",
                                    cairn_status_text(status));
    status = draw(&drawing, path, error);
    cairn_shape_model_parts_free(&drawing.parts);
    return status;
}
