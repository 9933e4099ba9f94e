/* Text and JSON output of a scan match. */
#include <inttypes.h>
#include <math.h>

#include "src/host/base/degrees.h"
#include "src/host/base/json_writer.h"
#include "src/host/base/posix.h"
#include "tools/cairn_match.h"

const char *match_verdict_text(cairn_scan_match_verdict verdict)
{
    return verdict == CAIRN_SCAN_MATCH_FOUND       ? "found"
           : verdict == CAIRN_SCAN_MATCH_AMBIGUOUS ? "ambiguous"
                                                   : "none";
}

/* ---- text ---- */

static void print_side(FILE *out, const char *name, const match_side *side)
{
    fprintf(out, "%s%s:%" PRId64 ", %" PRId32 " beams, %" PRId32 " points on %" PRId32 " walls\n",
            name, side->input.path, side->input.line, side->input.scan.count,
            side->view.point_count, side->view.segment_count);
}

static double deviation(const cairn_scan_match_hypothesis *h, int which)
{
    return sqrt((double)h->covariance[4 * which]);
}

/* The standard deviation of headings that are equally likely all round, degrees: a larger value
 * means an unknown heading. */
#define UNIFORM_HEADING_SD_DEG 103.92

static void print_hypothesis(FILE *out, const cairn_scan_match_hypothesis *h, int32_t rank)
{
    double heading = deviation(h, 2) * CAIRN_DEGREES_PER_RADIAN;

    fprintf(out, "%4" PRId32 "  %9.4f %9.4f %9.3f  %9.4f %8.4f ", rank, (double)h->target_query.x,
            (double)h->target_query.y, (double)h->target_query.theta * CAIRN_DEGREES_PER_RADIAN,
            deviation(h, 0), deviation(h, 1));
    if (heading < UNIFORM_HEADING_SD_DEG)
        fprintf(out, "%8.3f", heading);
    else
        fprintf(out, "%8s", "any");
    fprintf(out, "  %7.3f %7.3f %6.3f  %3" PRId32 "\n", (double)h->overlap,
            (double)h->free_space_violation, (double)h->score, h->observable_dof);
}

/* Prints the unobservable direction of the best hypothesis (eigenvector of the smallest eigenvalue
 * of its information), if it has one. */
static void print_unobservable(FILE *out, const cairn_scan_match_hypothesis *h)
{
    double x = (double)h->weak_direction[0], y = (double)h->weak_direction[1],
           turn = (double)h->weak_direction[2], shift = hypot(x, y);

    if (h->observable_dof >= 3)
        return;
    if (shift >= fabs(turn))
        fprintf(out,
                "unobserved motion along (%.2f, %.2f)%s: information %.2g of the best direction\n",
                x / shift, y / shift, fabs(turn) > 0.2 ? " with a rotation" : "",
                (double)h->weak_ratio);
    else
        fprintf(
            out,
            "unobserved rotation about the centre of B: information %.2g of the best direction\n",
            (double)h->weak_ratio);
}

static void print_text(FILE *out, const match_record *record)
{
    const cairn_scan_match_result *result = &record->result;

    print_side(out, "A          ", &record->target);
    print_side(out, "B          ", &record->query);
    fprintf(out, "verdict    %s\n", match_verdict_text(result->verdict));
    if (result->count > 0) {
        print_unobservable(out, &result->hypotheses[0]);
        fprintf(out, "rank        x (m)     y (m) theta (deg)    sd x     sd y  sd (deg)  overlap "
                     " viola-  score   dof\n"
                     "                                            (m)      (m)                     "
                     "   tion\n");
    }
    for (int32_t i = 0; i < result->count; i++)
        print_hypothesis(out, &result->hypotheses[i], i + 1);
}

/* ---- JSON ---- */

static void write_side(cairn_json_writer *json, const char *name, const match_side *side)
{
    cairn_json_write_object(json, name);
    cairn_json_write_text(json, "file", side->input.path);
    cairn_json_write_integer(json, "index", side->input.index);
    cairn_json_write_integer(json, "line", side->input.line);
    cairn_json_write_integer(json, "beams", side->input.scan.count);
    cairn_json_write_integer(json, "points", side->view.point_count);
    cairn_json_write_integer(json, "walls", side->view.segment_count);
    cairn_json_write_object_end(json);
}

static void write_hypothesis(cairn_json_writer *json, const cairn_scan_match_hypothesis *h)
{
    cairn_json_write_object(json, NULL);
    cairn_json_write_number(json, "x", (double)h->target_query.x);
    cairn_json_write_number(json, "y", (double)h->target_query.y);
    cairn_json_write_number(json, "theta", (double)h->target_query.theta);
    cairn_json_write_numbers(json, "covariance", h->covariance, 9);
    cairn_json_write_number(json, "overlap", (double)h->overlap);
    cairn_json_write_number(json, "contradiction", (double)h->free_space_violation);
    cairn_json_write_number(json, "score", (double)h->score);
    cairn_json_write_number(json, "sigma", (double)h->sigma);
    cairn_json_write_integer(json, "pairs", h->pairs);
    cairn_json_write_integer(json, "observable", h->observable_dof);
    cairn_json_write_numbers(json, "weak", h->weak_direction, 3);
    cairn_json_write_number(json, "weak_ratio", (double)h->weak_ratio);
    cairn_json_write_number(json, "radius", (double)h->radius);
    cairn_json_write_object_end(json);
}

static void print_json(FILE *out, const match_record *record)
{
    const cairn_scan_match_result *result = &record->result;
    cairn_json_writer json = cairn_json_write_begin(out);

    write_side(&json, "a", &record->target);
    write_side(&json, "b", &record->query);
    cairn_json_write_text(&json, "method", record->method);
    if (record->has_start) {
        const cairn_real start[3] = {record->start.x, record->start.y, record->start.theta};

        cairn_json_write_numbers(&json, "start", start, 3);
    }
    cairn_json_write_text(&json, "verdict", match_verdict_text(result->verdict));
    cairn_json_write_array(&json, "hypotheses");
    for (int32_t i = 0; i < result->count; i++)
        write_hypothesis(&json, &result->hypotheses[i]);
    cairn_json_write_array_end(&json);
    cairn_json_write_integer(&json, "units", record->measure.units);
    cairn_json_write_integer(&json, "worst_step", record->measure.worst_step);
    cairn_json_write_integer(&json, "candidates", record->measure.candidates);
    cairn_json_write_integer(&json, "fits", record->measure.refinements);
    cairn_json_write_end(&json);
}

/* ---- to the heap ---- */

static char *printed(const match_record *record,
                     void (*print)(FILE *out, const match_record *record))
{
    cairn_text_stream text;

    if (!cairn_text_stream_open(&text))
        return NULL;
    print(text.stream, record);
    return cairn_text_stream_close(&text);
}

char *match_text(const match_record *record)
{
    return printed(record, print_text);
}

char *match_json(const match_record *record)
{
    return printed(record, print_json);
}
