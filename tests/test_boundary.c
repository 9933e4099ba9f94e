/* Boundaries of regions: strengths, cuts and merges compared with the definition, closed at every
 * level, colours of equal brightness, texture, budgets, capacities. */
#include "tests/test.h"

#include <math.h>

#include "cairn/boundary.h"

enum { WIDTH = 48, HEIGHT = 36, PIXELS = WIDTH * HEIGHT, BINS_MOST = 16, SIDES = 2 * PIXELS };

static uint8_t picture[4 * PIXELS];

static cairn_boundary_params small_params(void)
{
    cairn_boundary_params params = cairn_boundary_default();

    params.max_width = WIDTH;
    params.max_height = HEIGHT;
    params.max_regions = PIXELS / 2;
    params.max_corners = 2 * SIDES;
    return params;
}

/* Small windows, many regions. */
static cairn_boundary_params narrow_params(void)
{
    cairn_boundary_params params = small_params();

    params.fine_half_width = 1;
    params.coarse_half_width = 2;
    return params;
}

struct fixture {
    cairn_pool pool;
    cairn_boundary *boundary;
};

static struct fixture boundary_with(cairn_boundary_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_boundary_memory(&params));
    assert_ok(cairn_boundary_create(&f.boundary, &f.pool, &params));
    return f;
}

static cairn_boundary_image image_of(int32_t channels)
{
    cairn_boundary_image image = {picture, WIDTH, HEIGHT, channels, (ptrdiff_t)WIDTH * channels};

    return image;
}

static cairn_boundary_result find(struct fixture *f, cairn_boundary_image image)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status;

    assert_ok(cairn_boundary_begin(f->boundary, &image));
    while ((status = cairn_boundary_step(f->boundary, &budget)) == CAIRN_MORE)
        budget.left = CAIRN_UNBOUNDED;
    assert_ok(status);
    return cairn_boundary_read(f->boundary);
}

/* Patches of colour, and noise. */
static void draw_blots(uint64_t seed, int32_t noise)
{
    cairn_random random = cairn_random_seed(seed, 7);

    for (int32_t i = 0; i < 3 * PIXELS; i++)
        picture[i] = 110;
    for (int32_t k = 0; k < 6; k++) {
        double x = WIDTH * (double)cairn_random_uniform(&random, 0, 1),
               y = HEIGHT * (double)cairn_random_uniform(&random, 0, 1);
        double r = 4 + 8 * (double)cairn_random_uniform(&random, 0, 1);

        for (int32_t c = 0; c < 3; c++) {
            uint8_t value = (uint8_t)(40 + 180 * (double)cairn_random_uniform(&random, 0, 1));

            for (int32_t i = 0; i < PIXELS; i++) {
                int32_t column = i % WIDTH, row = i / WIDTH;

                if (hypot(column - x, row - y) < r)
                    picture[3 * i + c] = value;
            }
        }
    }
    for (int32_t i = 0; i < 3 * PIXELS; i++)
        picture[i] = (uint8_t)(picture[i] + noise * (double)cairn_random_uniform(&random, 0, 1));
}

/* ---- Reference implementation of the strengths: windows pixel by pixel, colours by libm ---- */

static double reference_light(uint8_t sample)
{
    double s = sample / 255.0;

    return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

static double reference_root(double t)
{
    return t > 216.0 / 24389 ? cbrt(t) : (24389.0 / 27 * t + 16) / 116;
}

static void reference_colour(const uint8_t *bgr, double lab[3])
{
    double b = reference_light(bgr[0]), g = reference_light(bgr[1]), r = reference_light(bgr[2]);
    double x = reference_root((0.412453 * r + 0.357580 * g + 0.180423 * b) / 0.950456);
    double y = reference_root(0.212671 * r + 0.715160 * g + 0.072169 * b);
    double z = reference_root((0.019334 * r + 0.119193 * g + 0.950227 * b) / 1.088754);

    lab[0] = 116 * y - 16;
    lab[1] = 500 * (x - y);
    lab[2] = 200 * (y - z);
}

static int32_t reflected(int32_t i, int32_t count)
{
    return i < 0 ? -1 - i : i >= count ? 2 * count - 1 - i : i;
}

/* Box averages, three times. */
static void reference_average(double *map, int32_t half)
{
    static double to[PIXELS];

    for (int pass = 0; pass < 3; pass++) {
        for (int32_t i = 0; i < PIXELS; i++) {
            to[i] = 0;
            for (int32_t v = -half; v <= half; v++)
                for (int32_t u = -half; u <= half; u++)
                    to[i] += map[reflected(i / WIDTH + v, HEIGHT) * WIDTH +
                                 reflected(i % WIDTH + u, WIDTH)];
            to[i] /= (2 * half + 1) * (2 * half + 1);
        }
        memcpy(map, to, sizeof to);
    }
}

static void reference_add(const double *map, double weight, double tensor[PIXELS][3])
{
    for (int32_t i = 0; i < PIXELS; i++) {
        int32_t x = i % WIDTH, y = i / WIDTH;
        double u = (map[x + 1 < WIDTH ? i + 1 : i] - map[x > 0 ? i - 1 : i]) / 2;
        double v = (map[y + 1 < HEIGHT ? i + WIDTH : i] - map[y > 0 ? i - WIDTH : i]) / 2;

        tensor[i][0] += weight * u * u;
        tensor[i][1] += weight * u * v;
        tensor[i][2] += weight * v * v;
    }
}

/* Of a channel: its values by windows of `half`, or the bins of its histogram. */
static void reference_channel(double lab[PIXELS][3], int32_t c, int32_t half, int of_bins,
                              double weight, double tensor[PIXELS][3])
{
    double least = c == 0 ? 0 : -45, most = c == 0 ? 100 : 45, scale = (half + 0.5) * (half + 0.5);
    int32_t bins = c == 0 ? 16 : 13;
    static double map[PIXELS];

    for (int32_t bin = 0; bin < (of_bins ? bins : 1); bin++) {
        for (int32_t i = 0; i < PIXELS; i++) {
            double at = (fmin(fmax(lab[i][c], least), most) - least) / (most - least) * (bins - 1);

            map[i] = of_bins ? fmax(0, 1 - fabs(at - bin)) : lab[i][c] / 10;
        }
        reference_average(map, half);
        for (int32_t i = 0; i < PIXELS && of_bins; i++)
            map[i] = sqrt(map[i] + 1e-3);
        reference_add(map, weight * scale, tensor);
    }
}

static void strengths_agree_with_the_definition(void **state)
{
    static double lab[PIXELS][3], tensor[PIXELS][3];
    cairn_boundary_params params = small_params();
    struct fixture f = boundary_with(params);
    cairn_boundary_result r;
    double most = 0;

    (void)state;
    draw_blots(3, 12);
    r = find(&f, image_of(3));
    memset(tensor, 0, sizeof tensor);
    for (int32_t i = 0; i < PIXELS; i++)
        reference_colour(&picture[3 * i], lab[i]);
    for (int32_t c = 0; c < 3; c++) {
        reference_channel(lab, c, params.fine_half_width, 1, (double)params.histogram_weight,
                          tensor);
        reference_channel(lab, c, params.coarse_half_width, 1, (double)params.histogram_weight,
                          tensor);
        reference_channel(lab, c, params.fine_half_width, 0, 1, tensor);
        reference_channel(lab, c, (params.fine_half_width + params.coarse_half_width) / 2, 0, 1,
                          tensor);
        reference_channel(lab, c, params.fine_half_width + params.coarse_half_width, 0, 1, tensor);
    }
    for (int32_t i = 0; i < PIXELS; i++) {
        double xx = tensor[i][0], xy = tensor[i][1], yy = tensor[i][2];
        double strength = sqrt((xx + yy) / 2 + hypot((xx - yy) / 2, xy));

        assert_near(r.strengths.data[i], strength, NUMBER(1e-9, 2e-3));
        most = fmax(most, strength);
    }
    assert_true(most > 1);
    test_pool_free(&f.pool);
}

/* ---- Reference implementation of the merges: all borders are summed anew before each ---- */

/* The side of a pixel to the right (0) or below (1): its level; -1: none. */
static double level_at[2][PIXELS];

static void fill_levels(const cairn_boundary_result *r)
{
    for (int32_t i = 0; i < SIDES; i++)
        level_at[i / PIXELS][i % PIXELS] = -1;
    for (int32_t k = 0; k < r->contour_count; k++) {
        const cairn_boundary_contour *c = &r->contours[k];
        const cairn_boundary_corner *q = &r->corners[c->first];

        for (int32_t i = 0; i + !c->closed < c->count; i++) {
            const cairn_boundary_corner *a = &q[i], *b = &q[(i + 1) % c->count];
            int32_t x = a->x < b->x ? a->x : b->x, y = a->y < b->y ? a->y : b->y,
                    upright = a->x == b->x;
            int32_t pixel = upright ? y * WIDTH + x - 1 : (y - 1) * WIDTH + x;

            assert_int_equal(abs(a->x - b->x) + abs(a->y - b->y), 1);
            assert_true(level_at[!upright][pixel] < 0); /* no side twice */
            level_at[!upright][pixel] = (double)c->level;
        }
    }
}

static int32_t other_of(int32_t down, int32_t pixel)
{
    if (down)
        return pixel + WIDTH < PIXELS ? pixel + WIDTH : -1;
    return (pixel + 1) % WIDTH != 0 ? pixel + 1 : -1;
}

static int32_t label[PIXELS], first_label[PIXELS];

/* Regions: pixels with no contour between them. */
static int32_t label_regions(void)
{
    int32_t count = 0, changed = 1;

    for (int32_t i = 0; i < PIXELS; i++)
        label[i] = i;
    while (changed) {
        changed = 0;
        for (int32_t i = 0; i < SIDES; i++) {
            int32_t pixel = i % PIXELS, other = other_of(i / PIXELS, pixel);

            if (other >= 0 && level_at[i / PIXELS][pixel] < 0 && label[pixel] != label[other]) {
                label[pixel] = label[other] =
                    label[pixel] < label[other] ? label[pixel] : label[other];
                changed = 1;
            }
        }
    }
    for (int32_t i = 0; i < PIXELS; i++)
        count += label[i] == i;
    return count;
}

/* Weight of a side between two pixels of different regions; histograms of pixels. */
static double side_weight[2][PIXELS], pixel_bins[PIXELS][23];

static void fill_pixel_bins(void)
{
    for (int32_t i = 0; i < PIXELS; i++) {
        double lab[3];

        reference_colour(&picture[3 * i], lab);
        for (int32_t k = 0; k < 23; k++) {
            int32_t c = k < 9 ? 0 : 1 + (k - 9) / 7, bins = c == 0 ? 9 : 7,
                    bin = c == 0 ? k : (k - 9) % 7;
            double least = c == 0 ? 0 : -45, most = c == 0 ? 100 : 45;
            double at = (fmin(fmax(lab[c], least), most) - least) / (most - least) * (bins - 1);

            pixel_bins[i][k] = fmax(0, 1 - fabs(at - bin));
        }
    }
}

/* The Hellinger distance of the colours of regions p and q. */
static double reference_apart(int32_t p, int32_t q)
{
    double bins[2][23], size[2] = {0, 0}, sum = 0;

    memset(bins, 0, sizeof bins);
    for (int32_t i = 0; i < PIXELS; i++)
        if (label[i] == p || label[i] == q) {
            size[label[i] == q]++;
            for (int32_t k = 0; k < 23; k++)
                bins[label[i] == q][k] += pixel_bins[i][k];
        }
    for (int32_t k = 0; k < 23; k++)
        sum += sqrt(bins[0][k] / (3 * size[0]) * (bins[1][k] / (3 * size[1])));
    return sqrt(fmax(0, 1 - sum));
}

/* The weakest border: its key and its regions. 0: none. */
static int reference_weakest(double small, double contrast, double *key, int32_t pair[2])
{
    static double sum[PIXELS], length[PIXELS];
    double size[PIXELS], found = 1e300;

    memset(size, 0, sizeof size);
    for (int32_t i = 0; i < PIXELS; i++)
        size[label[i]]++;
    for (int32_t p = 0; p < PIXELS; p++) {
        if (size[p] <= 0)
            continue;
        memset(sum, 0, sizeof sum);
        memset(length, 0, sizeof length);
        for (int32_t i = 0; i < SIDES; i++) {
            int32_t a = i % PIXELS, b = other_of(i / PIXELS, a), q;

            if (b < 0 || label[a] == label[b] || (label[a] != p && label[b] != p))
                continue;
            q = label[a] + label[b] - p;
            sum[q] += side_weight[i / PIXELS][a];
            length[q]++;
        }
        for (int32_t q = p + 1; q < PIXELS; q++)
            if (length[q] > 0) {
                double k = sum[q] / length[q] * pow(fmin(size[p], size[q]) / PIXELS, small);

                if (contrast > 0)
                    k *= pow(reference_apart(p, q) * length[q] / sum[q], contrast);
                if (k < found) {
                    found = k;
                    pair[0] = p;
                    pair[1] = q;
                }
            }
    }
    *key = found;
    return found < 1e300;
}

/* Merges all regions: the level of each side. Returns the number of merges. */
static int32_t reference_join(double small, double contrast, double level[2][PIXELS])
{
    double joined = 0, key;
    int32_t pair[2], joints = 0;

    memcpy(label, first_label, sizeof label);
    while (reference_weakest(small, contrast, &key, pair)) {
        joined = fmax(joined, key);
        joints++;
        for (int32_t i = 0; i < SIDES; i++) {
            int32_t a = i % PIXELS, b = other_of(i / PIXELS, a);

            if (b >= 0 && first_label[a] != first_label[b] &&
                ((label[a] == pair[0] && label[b] == pair[1]) ||
                 (label[a] == pair[1] && label[b] == pair[0])))
                level[i / PIXELS][a] = joined;
        }
        for (int32_t i = 0; i < PIXELS; i++)
            if (label[i] == pair[1])
                label[i] = pair[0];
    }
    return joints;
}

/* The first regions and their borders: sums and numbers of sides. */
enum { REGIONS_MOST = 200 };
static int32_t number[PIXELS], region_count;
static double border_sum[REGIONS_MOST][REGIONS_MOST], border_sides[REGIONS_MOST][REGIONS_MOST],
    cuts[REGIONS_MOST][REGIONS_MOST];

static void sum_borders(const cairn_boundary_result *r)
{
    region_count = 0;
    memset(border_sum, 0, sizeof border_sum);
    memset(border_sides, 0, sizeof border_sides);
    for (int32_t i = 0; i < PIXELS; i++)
        if (first_label[i] == i) {
            assert_true(region_count < REGIONS_MOST);
            number[i] = region_count++;
        }
    for (int32_t i = 0; i < SIDES; i++) {
        int32_t a = i % PIXELS, b = other_of(i / PIXELS, a), p, q;

        if (b < 0 || first_label[a] == first_label[b])
            continue;
        p = number[first_label[a]];
        q = number[first_label[b]];
        border_sum[p][q] += fmax((double)r->strengths.data[a], (double)r->strengths.data[b]);
        border_sum[q][p] = border_sum[p][q] = fmax(border_sum[p][q], border_sum[q][p]);
        border_sides[p][q] = border_sides[q][p] = fmax(border_sides[p][q], border_sides[q][p]) + 1;
    }
}

/* All eigenvectors of m, by Jacobi's method: the columns of v. */
static void reference_eigen(double m[REGIONS_MOST][REGIONS_MOST],
                            double v[REGIONS_MOST][REGIONS_MOST])
{
    int32_t n = region_count;

    for (int32_t p = 0; p < n; p++)
        for (int32_t q = 0; q < n; q++)
            v[p][q] = p == q;
    for (int32_t sweep = 0; sweep < 30; sweep++)
        for (int32_t p = 0; p < n; p++)
            for (int32_t q = p + 1; q < n; q++) {
                double angle = 0.5 * atan2(2 * m[p][q], m[q][q] - m[p][p]), c = cos(angle),
                       s = sin(angle);

                if (m[p][q] == 0)
                    continue;
                for (int32_t k = 0; k < n; k++) {
                    double x = m[k][p], y = m[k][q];

                    m[k][p] = c * x - s * y;
                    m[k][q] = s * x + c * y;
                }
                for (int32_t k = 0; k < n; k++) {
                    double x = m[p][k], y = m[q][k];

                    m[p][k] = c * x - s * y;
                    m[q][k] = s * x + c * y;
                    x = v[k][p];
                    y = v[k][q];
                    v[k][p] = c * x - s * y;
                    v[k][q] = s * x + c * y;
                }
            }
}

/* The eight best cuts across each border: the generalized eigenvectors of D - W, of unit mean
 * square, divided by the square roots of their eigenvalues. */
static void reference_cuts(double mean)
{
    static double laplacian[REGIONS_MOST][REGIONS_MOST], v[REGIONS_MOST][REGIONS_MOST];
    double degree[REGIONS_MOST], pixels[REGIONS_MOST];
    int32_t n = region_count, used[REGIONS_MOST] = {0};

    memset(laplacian, 0, sizeof laplacian);
    memset(cuts, 0, sizeof cuts);
    memset(pixels, 0, sizeof pixels);
    for (int32_t i = 0; i < PIXELS; i++)
        pixels[number[first_label[i]]]++;
    for (int32_t p = 0; p < n; p++) {
        degree[p] = 0;
        for (int32_t q = 0; q < n; q++)
            if (border_sides[p][q] > 0) {
                laplacian[p][q] = -border_sides[p][q] *
                                  exp(-border_sum[p][q] / border_sides[p][q] / (0.5 * mean));
                degree[p] -= laplacian[p][q];
            }
    }
    for (int32_t p = 0; p < n; p++)
        for (int32_t q = 0; q < n; q++)
            laplacian[p][q] = (p == q) + laplacian[p][q] / sqrt(degree[p] * degree[q]);
    reference_eigen(laplacian, v);
    for (int32_t k = 0; k < 9; k++) {
        int32_t best = -1;
        double square = 0;

        for (int32_t j = 0; j < n; j++)
            if (!used[j] && (best < 0 || laplacian[j][j] < laplacian[best][best]))
                best = j;
        used[best] = 1;
        for (int32_t p = 0; p < n; p++)
            square += pixels[p] / PIXELS * v[p][best] * v[p][best] / degree[p];
        for (int32_t p = 0; p < n && k > 0; p++)
            for (int32_t q = 0; q < n; q++)
                cuts[p][q] += fabs(v[p][best] / sqrt(degree[p]) - v[q][best] / sqrt(degree[q])) /
                              sqrt(square * laplacian[best][best]);
    }
}

/* The mean strength of each border of the first regions plus that of the cuts becomes the weight of
 * its sides. */
static void weigh_sides(const cairn_boundary_result *r, double global)
{
    double mean = 0, mean_cut = 0, count = 0;

    sum_borders(r);
    for (int32_t p = 0; p < region_count; p++)
        for (int32_t q = 0; q < p; q++)
            if (border_sides[p][q] > 0) {
                mean += border_sum[p][q] / border_sides[p][q];
                count++;
            }
    mean /= count;
    if (global > 0)
        reference_cuts(mean);
    for (int32_t p = 0; p < region_count; p++)
        for (int32_t q = 0; q < p; q++)
            mean_cut += border_sides[p][q] > 0 ? cuts[p][q] / count : 0;
    for (int32_t i = 0; i < SIDES; i++) {
        int32_t a = i % PIXELS, b = other_of(i / PIXELS, a), p, q;

        if (b < 0 || first_label[a] == first_label[b])
            continue;
        p = number[first_label[a]];
        q = number[first_label[b]];
        side_weight[i / PIXELS][a] = border_sum[p][q] / border_sides[p][q] +
                                     (global > 0 ? global * mean / mean_cut * cuts[p][q] : 0);
    }
}

/* The levels of all sides compared with those of the reference implementation. */
static void compare_levels(double global, double tolerance)
{
    static const double powers[5][2] = {{0, 0}, {1, 0}, {2, 0}, {0.5, 1}, {1.5, 1}};
    static double level[2][PIXELS], logs[2][PIXELS];
    cairn_boundary_params params = narrow_params();
    struct fixture f;
    cairn_boundary_result r;
    int32_t compared = 0;

    draw_blots(5, 30);
    params.size_exponent = CAIRN_REAL(0.2);
    params.contrast_exponent = CAIRN_REAL(0.4);
    params.spectral_weight = (cairn_real)global;
    f = boundary_with(params);
    r = find(&f, image_of(3));
    fill_levels(&r);
    assert_int_equal(label_regions(), r.region_count);
    assert_true(r.region_count >= 24);
    memcpy(first_label, label, sizeof label);
    fill_pixel_bins();
    weigh_sides(&r, global);
    memset(logs, 0, sizeof logs);
    for (int32_t way = 0; way < 5; way++) {
        assert_int_equal(reference_join(powers[way][0] * (double)params.size_exponent,
                                        powers[way][1] * (double)params.contrast_exponent, level),
                         r.region_count - 1);
        for (int32_t i = 0; i < SIDES; i++)
            if (level_at[i / PIXELS][i % PIXELS] >= 0)
                logs[i / PIXELS][i % PIXELS] += log(level[i / PIXELS][i % PIXELS]);
    }
    for (int32_t i = 0; i < SIDES; i++)
        side_weight[i / PIXELS][i % PIXELS] = exp(logs[i / PIXELS][i % PIXELS] / 5);
    (void)reference_join(0, 0, level);
    for (int32_t i = 0; i < SIDES; i++)
        if (level_at[i / PIXELS][i % PIXELS] >= 0) {
            assert_near(level_at[i / PIXELS][i % PIXELS], level[i / PIXELS][i % PIXELS], tolerance);
            compared++;
        }
    assert_true(compared > 200);
    test_pool_free(&f.pool);
}

static void merges_agree_with_the_definition(void **state)
{
    (void)state;
    compare_levels(0, NUMBER(1e-8, 1e-2));
}

static void cuts_agree_with_the_definition(void **state)
{
    (void)state;
    compare_levels(0.5, NUMBER(1e-6, 3e-2));
}

/* ---- Invariants of any image ---- */

/* Contours above any level have no loose ends within the image. */
static void contours_close_at_every_level(void **state)
{
    struct fixture f = boundary_with(small_params());
    int32_t compared = 0;

    (void)state;
    for (uint64_t seed = 1; seed <= 4; seed++) {
        cairn_boundary_result r;

        draw_blots(seed, 25);
        r = find(&f, image_of(3));
        fill_levels(&r);
        for (int32_t k = 0; k < r.contour_count; k++)
            for (int32_t y = 1; y < HEIGHT; y++)
                for (int32_t x = 1; x < WIDTH; x++) {
                    int32_t at = y * WIDTH + x;
                    double least = (double)r.contours[k].level;
                    int32_t sides =
                        (level_at[0][at - 1] >= least) + (level_at[0][at - WIDTH - 1] >= least) +
                        (level_at[1][at - WIDTH] >= least) + (level_at[1][at - WIDTH - 1] >= least);

                    assert_int_not_equal(sides, 1);
                    compared += sides > 1;
                }
    }
    assert_true(compared > 100);
    test_pool_free(&f.pool);
}

static void the_strongest_come_first(void **state)
{
    cairn_boundary_params params = narrow_params();
    cairn_boundary_result r;
    struct fixture f;
    int32_t all, strong;

    (void)state;
    draw_blots(2, 20);
    f = boundary_with(params);
    r = find(&f, image_of(3));
    all = r.contour_count;
    for (int32_t i = 0; i < all; i++) {
        const cairn_boundary_contour *c = &r.contours[i];

        assert_near(c->strength, (double)c->level * sqrt((double)c->mean_strength),
                    NUMBER(1e-12, 1e-5));
        assert_true(i == 0 || c->strength <= r.contours[i - 1].strength);
    }
    strong = all / 2;
    params.min_strength = (r.contours[strong].strength + r.contours[strong - 1].strength) / 2;
    test_pool_free(&f.pool);
    f = boundary_with(params);
    r = find(&f, image_of(3));
    assert_int_equal(r.contour_count, strong);
    assert_true(strong > 10);
    test_pool_free(&f.pool);
}

/* A disc of one colour on another. */
static void draw_disc(const uint8_t inside[3], const uint8_t outside[3])
{
    for (int32_t i = 0; i < 3 * PIXELS; i++) {
        int32_t column = i / 3 % WIDTH, row = i / 3 / WIDTH;

        picture[i] = hypot(column - 23.5, row - 17.5) < 10 ? inside[i % 3] : outside[i % 3];
    }
}

/* Contours above half of the highest level are those of the disc, all around it. */
static void assert_disc(const cairn_boundary_result *r, double least)
{
    double highest = 0;
    int32_t sides = 0;

    for (int32_t k = 0; k < r->contour_count; k++)
        highest = fmax(highest, (double)r->contours[k].level);
    assert_true(highest > least);
    for (int32_t k = 0; k < r->contour_count; k++) {
        const cairn_boundary_contour *c = &r->contours[k];

        if ((double)c->level <= highest / 2)
            continue;
        sides += c->count - !c->closed;
        for (int32_t i = 0; i < c->count; i++) {
            const cairn_boundary_corner *q = &r->corners[c->first + i];

            assert_near(hypot(q->x - 24, q->y - 18), 10, 1.5);
        }
    }
    assert_near(sides, 80, 10); /* of the bounding square */
}

static void a_disc_has_its_contour(void **state)
{
    static const uint8_t inside[3] = {60, 60, 60}, outside[3] = {180, 180, 180};
    struct fixture f = boundary_with(narrow_params());
    cairn_boundary_result r;

    (void)state;
    draw_disc(inside, outside);
    r = find(&f, image_of(3));
    assert_disc(&r, 2);
    test_pool_free(&f.pool);
}

/* Red and green of equal brightness: invisible in grey. */
static void colours_of_equal_brightness_are_separated(void **state)
{
    static const uint8_t red[3] = {60, 60, 200}, green[3] = {60, 123, 60};
    struct fixture f = boundary_with(narrow_params());
    cairn_boundary_result r;
    double lab[2][3];

    (void)state;
    reference_colour(red, lab[0]);
    reference_colour(green, lab[1]);
    assert_near(lab[0][0], lab[1][0], 1);
    draw_disc(red, green);
    r = find(&f, image_of(3));
    assert_disc(&r, 2);
    for (int32_t i = 0; i < PIXELS; i++)
        picture[i] = 118;
    r = find(&f, image_of(1));
    assert_int_equal(r.region_count, 1);
    assert_int_equal(r.contour_count, 0);
    test_pool_free(&f.pool);
}

/* Left: stripes of two greys; right: uniform grey of their mean. Means differ little, histograms do
 * at the border. */
static void histograms_see_where_a_texture_ends(void **state)
{
    double strength[2] = {0, 0};

    (void)state;
    for (int32_t i = 0; i < PIXELS; i++)
        picture[i] = (uint8_t)(i % WIDTH >= WIDTH / 2 ? 119 : i / WIDTH % 2 ? 150 : 88);
    for (int with = 0; with < 2; with++) {
        cairn_boundary_params params = small_params();
        cairn_boundary_result r;
        struct fixture f;

        params.histogram_weight = with ? params.histogram_weight : 0;
        f = boundary_with(params);
        r = find(&f, image_of(1));
        for (int32_t k = 0; k < r.contour_count; k++)
            for (int32_t i = 0; i < r.contours[k].count; i++)
                if (abs(r.corners[r.contours[k].first + i].x - WIDTH / 2) <= 2)
                    strength[with] = fmax(strength[with], (double)r.contours[k].strength);
        if (with)
            assert_true(
                r.contour_count > 0 &&
                abs(r.corners[r.contours[0].first + r.contours[0].count / 2].x - WIDTH / 2) <= 2);
        test_pool_free(&f.pool);
    }
    assert_true(strength[1] > 1 && strength[1] > 5 * strength[0]);
}

/* ---- Budgets, views, capacities ---- */

static uint64_t hash_of(const cairn_boundary_result *r)
{
    uint64_t hash = TEST_HASH_START;

    for (int32_t i = 0; i < r->contour_count; i++) {
        const cairn_boundary_contour *c = &r->contours[i];

        hash = test_hash(hash, &c->strength, sizeof c->strength);
        hash = test_hash(hash, &c->level, sizeof c->level);
        hash = test_hash(hash, &r->corners[c->first], (size_t)c->count * sizeof *r->corners);
    }
    return hash;
}

static cairn_boundary_image stepped_image;

static cairn_status begin_it(void *context)
{
    return cairn_boundary_begin(context, &stepped_image);
}

static cairn_status step_it(void *context, cairn_budget *budget)
{
    return cairn_boundary_step(context, budget);
}

static uint64_t hash_it(void *context)
{
    cairn_boundary_result r = cairn_boundary_read(context);

    return hash_of(&r);
}

static void budgets_change_nothing(void **state)
{
    struct fixture f = boundary_with(small_params());
    cairn_boundary_result r;
    test_stepped stepped = {begin_it, step_it, hash_it, f.boundary};
    uint64_t whole;
    cairn_status status;

    (void)state;
    draw_blots(9, 25);
    stepped_image = image_of(3);
    r = find(&f, stepped_image);
    whole = hash_of(&r);
    assert_ok(cairn_boundary_begin(f.boundary, &stepped_image));
    do {
        cairn_budget budget = {7};

        r = cairn_boundary_read(f.boundary);
        assert_int_equal(r.contour_count, 0);
        status = cairn_boundary_step(f.boundary, &budget);
    } while (status == CAIRN_MORE);
    assert_ok(status);
    r = cairn_boundary_read(f.boundary);
    assert_true(hash_of(&r) == whole);
    test_begins_anew(&stepped, 20);
    test_pool_free(&f.pool);
}

/* Units of all steps of a picture, with regions enough for the spectral strengths. */
static void units_stay_as_they_are(void **state)
{
    struct fixture f = boundary_with(narrow_params());
    cairn_boundary_image image = image_of(3);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    (void)state;
    draw_blots(5, 30);
    assert_ok(cairn_boundary_begin(f.boundary, &image));
    assert_ok(cairn_boundary_step(f.boundary, &budget));
    assert_int_equal(CAIRN_UNBOUNDED - budget.left, NUMBER(353668, 417022));
    test_pool_free(&f.pool);
}

static void bits_stay_as_they_are(void **state)
{
    struct fixture f = boundary_with(small_params());
    cairn_boundary_result r;

    (void)state;
    draw_blots(21, 30);
    r = find(&f, image_of(3));
    assert_golden(hash_of(&r), UINT64_C(0x5b3f257848bb7575), UINT64_C(0xd875f004d202d8a4));
    test_pool_free(&f.pool);
    /* With regions enough for the spectral strengths. */
    f = boundary_with(narrow_params());
    draw_blots(5, 30);
    r = find(&f, image_of(3));
    assert_golden(hash_of(&r), UINT64_C(0xd26428346210e41f), UINT64_C(0xf377fad0e9e4cafa));
    test_pool_free(&f.pool);
}

/* A fourth channel is ignored, rows may have gaps, grey images equal grey colours. */
static void views_of_one_picture_agree(void **state)
{
    static uint8_t other[4 * PIXELS + 8 * HEIGHT];
    cairn_boundary_image image = {other, WIDTH, HEIGHT, 4, 4 * WIDTH + 8};
    struct fixture f = boundary_with(small_params());
    cairn_boundary_result r;
    uint64_t hash;

    (void)state;
    draw_blots(4, 10);
    r = find(&f, image_of(3));
    hash = hash_of(&r);
    for (int32_t i = 0; i < 3 * PIXELS; i++)
        other[i / 3 / WIDTH * (4 * WIDTH + 8) + i / 3 % WIDTH * 4 + i % 3] = picture[i];
    r = find(&f, image);
    assert_true(hash_of(&r) == hash);
    test_pool_free(&f.pool);
}

static void capacities_hold(void **state)
{
    cairn_boundary_params params = small_params();
    cairn_boundary_image image = image_of(3);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_boundary_result r;
    struct fixture f;

    (void)state;
    draw_blots(6, 40);
    params.max_regions = 5;
    f = boundary_with(params);
    r = find(&f, image);
    assert_int_equal(r.region_count, 5);
    assert_true(r.contour_count >= 4);
    image = image_of(1);
    image.stride = image.width = WIDTH + 1;
    assert_status(cairn_boundary_begin(f.boundary, &image), CAIRN_FULL);
    image.stride = image.width = CAIRN_RASTER_MAX_SIDE;
    assert_status(cairn_boundary_begin(f.boundary, &image), CAIRN_FULL);
    image = image_of(1);
    image.height = HEIGHT + 1;
    assert_status(cairn_boundary_begin(f.boundary, &image), CAIRN_FULL);
    test_pool_free(&f.pool);
    params = small_params();
    params.max_corners = 10;
    f = boundary_with(params);
    image = image_of(3);
    assert_ok(cairn_boundary_begin(f.boundary, &image));
    assert_status(cairn_boundary_step(f.boundary, &budget), CAIRN_FULL);
    r = cairn_boundary_read(f.boundary);
    assert_int_equal(r.contour_count, 0);
    assert_ok(cairn_boundary_step(f.boundary, &budget));
    test_pool_free(&f.pool);
}

static void the_least_pictures_are_one_region(void **state)
{
    struct fixture f = boundary_with(small_params());
    cairn_boundary_image image = image_of(3);

    (void)state;
    draw_blots(6, 0);
    image.width = image.height = 1;
    assert_int_equal(find(&f, image).region_count, 1);
    image.width = WIDTH;
    assert_int_equal(find(&f, image).corner_count,
                     2 * find(&f, image).contour_count); /* one pixel high: sides across */
    test_pool_free(&f.pool);
}

/* Dark and bright halves along the longest side that a picture may have. */
static void the_longest_pictures_are_taken(void **state)
{
    enum { LONGEST = 8192 };
    static uint8_t samples[LONGEST];
    cairn_boundary_image image = {samples, LONGEST, 1, 1, LONGEST};

    (void)state;
    memset(samples + LONGEST / 2, 200, LONGEST / 2);
    for (int turned = 0; turned < 2; turned++) {
        cairn_boundary_params params = small_params();
        cairn_boundary_result r;
        struct fixture f;

        params.max_width = image.width;
        params.max_height = image.height;
        f = boundary_with(params);
        r = find(&f, image);
        assert_int_equal(r.region_count, 2);
        assert_int_equal(r.contour_count, 1);
        test_pool_free(&f.pool);
        image.width = 1;
        image.stride = 1;
        image.height = LONGEST;
    }
}

static cairn_status create_it(void *context, cairn_pool *pool)
{
    cairn_boundary *made;

    return cairn_boundary_create(&made, pool, context);
}

static void bad_arguments_are_refused(void **state)
{
    cairn_boundary_params params = small_params();
    cairn_boundary_image image = image_of(3);
    struct fixture f = boundary_with(params);

    (void)state;
    image.channels = 2;
    assert_status(cairn_boundary_begin(f.boundary, &image), CAIRN_BAD_ARGUMENT);
    image = image_of(3);
    image.stride--;
    assert_status(cairn_boundary_begin(f.boundary, &image), CAIRN_BAD_ARGUMENT);
    image = image_of(3);
    image.samples = NULL;
    assert_status(cairn_boundary_begin(f.boundary, &image), CAIRN_BAD_ARGUMENT);
    image = image_of(3);
    image.width = 0;
    assert_status(cairn_boundary_begin(f.boundary, &image), CAIRN_BAD_ARGUMENT);
    image = image_of(3);
    image.height = -1;
    assert_status(cairn_boundary_begin(f.boundary, &image), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_boundary_begin(f.boundary, NULL), CAIRN_BAD_ARGUMENT);
    test_pool_free(&f.pool);
    params.max_width = params.max_height = 4;
    params.max_regions = params.max_corners = 4;
    test_every_pool_size(create_it, &params, cairn_boundary_memory(&params));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(strengths_agree_with_the_definition),
        cmocka_unit_test(merges_agree_with_the_definition),
        cmocka_unit_test(cuts_agree_with_the_definition),
        cmocka_unit_test(contours_close_at_every_level),
        cmocka_unit_test(the_strongest_come_first),
        cmocka_unit_test(a_disc_has_its_contour),
        cmocka_unit_test(colours_of_equal_brightness_are_separated),
        cmocka_unit_test(histograms_see_where_a_texture_ends),
        cmocka_unit_test(budgets_change_nothing),
        cmocka_unit_test(bits_stay_as_they_are),
        cmocka_unit_test(units_stay_as_they_are),
        cmocka_unit_test(views_of_one_picture_agree),
        cmocka_unit_test(capacities_hold),
        cmocka_unit_test(the_least_pictures_are_one_region),
        cmocka_unit_test(the_longest_pictures_are_taken),
        cmocka_unit_test(bad_arguments_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
