#include "bench/bench_score.h"

#include <math.h>

static double wrap(double angle)
{
    return remainder(angle, 6.283185307179586);
}

sim_pose bench_pose_compose(sim_pose a_b, sim_pose b_c)
{
    double c = cos(a_b.theta), s = sin(a_b.theta);
    sim_pose a_c = {a_b.x + c * b_c.x - s * b_c.y, a_b.y + s * b_c.x + c * b_c.y,
                    wrap(a_b.theta + b_c.theta)};

    return a_c;
}

sim_pose bench_pose_between(sim_pose a_b, sim_pose a_c)
{
    double c = cos(a_b.theta), s = sin(a_b.theta), x = a_c.x - a_b.x, y = a_c.y - a_b.y;
    sim_pose b_c = {c * x + s * y, c * y - s * x, wrap(a_c.theta - a_b.theta)};

    return b_c;
}

int32_t bench_pose_near(sim_pose a, sim_pose b, double metres, double radians)
{
    return hypot(a.x - b.x, a.y - b.y) <= metres && fabs(wrap(a.theta - b.theta)) <= radians;
}

static int32_t agreeing(const sim_pose *truth, const sim_pose *estimates, const int32_t *use,
                        int32_t count, sim_pose motion, double metres, double radians)
{
    int32_t agree = 0;

    for (int32_t i = 0; i < count; i++)
        agree += use[i] && bench_pose_near(truth[i], bench_pose_compose(motion, estimates[i]),
                                           metres, radians);
    return agree;
}

/* Least squares over positions (and over headings where positions do not determine the heading) of
 * the agreeing scans. */
static sim_pose refine(const sim_pose *truth, const sim_pose *estimates, const int32_t *use,
                       int32_t count, sim_pose motion, double metres, double radians)
{
    double ex = 0, ey = 0, tx = 0, ty = 0, sine = 0, cosine = 0;
    sim_pose fitted = motion;
    int32_t n = 0;

    for (int32_t i = 0; i < count; i++) {
        if (!use[i] ||
            !bench_pose_near(truth[i], bench_pose_compose(motion, estimates[i]), metres, radians))
            continue;
        ex += estimates[i].x;
        ey += estimates[i].y;
        tx += truth[i].x;
        ty += truth[i].y;
        n++;
    }
    if (n == 0)
        return motion;
    ex /= n;
    ey /= n;
    tx /= n;
    ty /= n;
    for (int32_t i = 0; i < count; i++) {
        double ax, ay, bx, by, turn;

        if (!use[i] ||
            !bench_pose_near(truth[i], bench_pose_compose(motion, estimates[i]), metres, radians))
            continue;
        ax = estimates[i].x - ex;
        ay = estimates[i].y - ey;
        bx = truth[i].x - tx;
        by = truth[i].y - ty;
        turn = truth[i].theta - estimates[i].theta;
        /* A heading counts as much as a position at 1 m from the middle. */
        sine += ax * by - ay * bx + sin(turn);
        cosine += ax * bx + ay * by + cos(turn);
    }
    fitted.theta = atan2(sine, cosine);
    fitted.x = tx - (cos(fitted.theta) * ex - sin(fitted.theta) * ey);
    fitted.y = ty - (sin(fitted.theta) * ex + cos(fitted.theta) * ey);
    return fitted;
}

int32_t bench_fit_common(const sim_pose *truth, const sim_pose *estimates, const int32_t *use,
                         int32_t count, double metres, double radians, sim_pose *moved)
{
    enum { ROUNDS = 12 };
    sim_pose best = {0, 0, 0};
    int32_t most = 0;

    for (int32_t i = 0; i < count; i++) {
        sim_pose origin = {0, 0, 0}, motion;
        int32_t agree;

        if (!use[i])
            continue;
        /* The motion that moves scan i onto its truth, refined ROUNDS times to the mean of all
         * agreeing scans. The motion before the refinement is never the result, even if more scans
         * agree with it. */
        motion = bench_pose_compose(truth[i], bench_pose_between(estimates[i], origin));
        for (int round = 0; round < ROUNDS; round++)
            motion = refine(truth, estimates, use, count, motion, metres, radians);
        agree = agreeing(truth, estimates, use, count, motion, metres, radians);
        if (agree > most) {
            most = agree;
            best = motion;
        }
    }
    for (int32_t i = 0; i < count; i++)
        moved[i] = bench_pose_compose(best, estimates[i]);
    return most;
}
