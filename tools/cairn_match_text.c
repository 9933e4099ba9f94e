/* Text and JSON output of a scan match. */
#include <inttypes.h>
#include <math.h>

#include "cairn/json_text.h"
#include "src/host/base/posix.h"
#include "tools/cairn_match.h"

#define DEGREES (180 / 3.14159265358979323846)

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
    double heading = deviation(h, 2) * DEGREES;

    fprintf(out, "%4" PRId32 "  %9.4f %9.4f %9.3f  %9.4f %8.4f ", rank, (double)h->target_query.x,
            (double)h->target_query.y, (double)h->target_query.theta * DEGREES, deviation(h, 0),
            deviation(h, 1));
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

static void print_string(FILE *out, const char *text)
{
    char form[CAIRN_JSON_CHARACTER_BYTES];

    fputc('"', out);
    while (*text != '\0') {
        size_t count = cairn_json_character(&text, form);

        fwrite(form, 1, count, out);
    }
    fputc('"', out);
}

static void print_numbers(FILE *out, const char *name, const cairn_real *value, int count)
{
    fprintf(out, ", \"%s\": [", name);
    for (int i = 0; i < count; i++)
        fprintf(out, "%s%.9g", i > 0 ? ", " : "", (double)value[i]);
    fputc(']', out);
}

static void print_json_side(FILE *out, const char *name, const match_side *side)
{
    fprintf(out, "  \"%s\": {\"file\": ", name);
    print_string(out, side->input.path);
    fprintf(out,
            ", \"index\": %" PRId64 ", \"line\": %" PRId64 ", \"beams\": %" PRId32
            ", \"points\": %" PRId32 ", \"walls\": %" PRId32 "},\n",
            side->input.index, side->input.line, side->input.scan.count, side->view.point_count,
            side->view.segment_count);
}

static void print_json_hypothesis(FILE *out, const cairn_scan_match_hypothesis *h)
{
    fprintf(out, "    {\"x\": %.9g, \"y\": %.9g, \"theta\": %.9g", (double)h->target_query.x,
            (double)h->target_query.y, (double)h->target_query.theta);
    print_numbers(out, "covariance", h->covariance, 9);
    fprintf(out,
            ", \"overlap\": %.9g, \"contradiction\": %.9g, \"score\": %.9g, \"sigma\": %.9g, "
            "\"pairs\": %" PRId32 ", \"observable\": %" PRId32,
            (double)h->overlap, (double)h->free_space_violation, (double)h->score, (double)h->sigma,
            h->pairs, h->observable_dof);
    print_numbers(out, "weak", h->weak_direction, 3);
    fprintf(out, ", \"weak_ratio\": %.9g, \"radius\": %.9g}", (double)h->weak_ratio,
            (double)h->radius);
}

static void print_json(FILE *out, const match_record *record)
{
    const cairn_scan_match_result *result = &record->result;

    fputs("{\n", out);
    print_json_side(out, "a", &record->target);
    print_json_side(out, "b", &record->query);
    fprintf(out, "  \"method\": \"%s\",\n", record->method);
    if (record->has_start)
        fprintf(out, "  \"start\": [%.9g, %.9g, %.9g],\n", (double)record->start.x,
                (double)record->start.y, (double)record->start.theta);
    fprintf(out, "  \"verdict\": \"%s\",\n  \"hypotheses\": [",
            match_verdict_text(result->verdict));
    for (int32_t i = 0; i < result->count; i++) {
        fputs(i > 0 ? ",\n" : "\n", out);
        print_json_hypothesis(out, &result->hypotheses[i]);
    }
    fprintf(out,
            "],\n  \"units\": %" PRId64 ", \"worst_step\": %" PRId32 ", \"candidates\": %" PRId32
            ", \"fits\": %" PRId32 "\n}\n",
            record->measure.units, record->measure.worst_step, record->measure.candidates,
            record->measure.refinements);
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
