/* One line per scene, "name hash": what tools/check-bits.sh compares between compilers and options, and
 * tools/firmware-test.sh between machines. A scene computes with seeded inputs and hashes all bits of its results; a NaN is
 * never hashed. Prints through the board, so that it runs on a bare microcontroller, too. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/force_field.h"
#include "cairn/geometry.h"
#include "cairn/pool.h"
#include "cairn/random.h"
#include "cairn/small_matrix.h"
#include "firmware/board.h"

typedef uint64_t (*scene)(void);

/* FNV-1a over the bytes of a value. */
static uint64_t add_bytes(uint64_t hash, const void *data, size_t bytes)
{
    const unsigned char *byte = data;

    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ byte[i]) * UINT64_C(1099511628211);
    return hash;
}

static uint64_t add_real(uint64_t hash, cairn_real x)
{
    return x == x ? add_bytes(hash, &x, sizeof x) : add_bytes(hash, "nan", 3);
}

static const uint64_t START = UINT64_C(14695981039346656037);

/* 0: uniform within +-size; else a factor 2^-30 ... 2^30 on top. */
static cairn_real argument(cairn_random *random, cairn_real size, int wide)
{
    cairn_real x = cairn_random_uniform(random, -size, size);
    int32_t doublings = wide ? cairn_random_below(random, 61) - 30 : 0;

    for (; doublings > 0; doublings--)
        x *= 2;
    for (; doublings < 0; doublings++)
        x /= 2;
    return x;
}

static uint64_t elementary_functions(void)
{
    cairn_random random = cairn_random_seed(1, 1);
    uint64_t hash = START;

    for (int i = 0; i < 40000; i++) {
        cairn_real a = argument(&random, 100, 0), b = argument(&random, 4, i & 1), sine, cosine;

        cairn_sincos(a, &sine, &cosine);
        hash = add_real(hash, sine);
        hash = add_real(hash, cosine);
        hash = add_real(hash, cairn_sin(b));
        hash = add_real(hash, cairn_cos(b));
        hash = add_real(hash, cairn_atan2(a, b));
        hash = add_real(hash, cairn_exp(a));
        hash = add_real(hash, cairn_exp(b));
        hash = add_real(hash, cairn_log(cairn_abs(b)));
        hash = add_real(hash, cairn_erfc(b));
        hash = add_real(hash, cairn_wrap_angle(a));
        hash = add_real(hash, cairn_sqrt(cairn_abs(a)));
        hash = add_real(hash, (cairn_real)cairn_real_to_int(a));
    }
    return hash;
}

static uint64_t random_numbers(void)
{
    cairn_random random = cairn_random_seed(2, 1);
    uint64_t hash = START;

    for (int i = 0; i < 20000; i++) {
        uint32_t bits = cairn_random_bits(&random);

        hash = add_bytes(hash, &bits, sizeof bits);
        hash = add_real(hash, cairn_random_unit(&random));
        hash = add_real(hash, cairn_random_uniform(&random, -3, 7));
        hash = add_real(hash, cairn_random_normal(&random));
        hash = add_real(hash, (cairn_real)cairn_random_below(&random, 1000));
    }
    return hash;
}

static cairn_vec2 random_point(cairn_random *random)
{
    cairn_real x = argument(random, 10, 0);
    cairn_real y = argument(random, 10, 0);
    cairn_vec2 point = {x, y};

    return point;
}

static cairn_pose random_pose(cairn_random *random)
{
    cairn_vec2 p = random_point(random);
    cairn_pose pose = {p.x, p.y, argument(random, CAIRN_PI, 0)};

    return pose;
}

static uint64_t add_pose(uint64_t hash, cairn_pose pose)
{
    return add_real(add_real(add_real(hash, pose.x), pose.y), pose.theta);
}

static uint64_t add_point(uint64_t hash, cairn_vec2 point)
{
    return add_real(add_real(hash, point.x), point.y);
}

static uint64_t poses_and_segments(void)
{
    cairn_random random = cairn_random_seed(3, 1);
    uint64_t hash = START;
    cairn_pose walk = cairn_pose_identity();

    for (int i = 0; i < 5000; i++) {
        cairn_pose a = random_pose(&random), b = random_pose(&random);
        cairn_segment s, t;
        cairn_vec2 corners[4], point;
        cairn_real parameter;

        walk = cairn_pose_compose(walk, a);
        hash = add_pose(hash, walk);
        hash = add_pose(hash, cairn_pose_inverse(a));
        hash = add_pose(hash, cairn_pose_between(a, b));
        for (int k = 0; k < 4; k++)
            corners[k] = random_point(&random);
        s.a = corners[0], s.b = corners[1], t.a = corners[2], t.b = corners[3];
        hash = add_point(hash, cairn_segment_nearest(s, corners[2], &parameter));
        hash = add_real(hash, parameter);
        hash = add_real(hash, cairn_segment_distance(t, corners[0]));
        if (cairn_line_intersection(s, t, &point))
            hash = add_point(hash, point);
        hash = add_real(hash, (cairn_real)cairn_segments_cross(s, t));
        hash = add_real(hash, cairn_polygon_area(corners, 4));
        hash = add_point(hash, cairn_vec2_unit(corners[3]));
    }
    return hash;
}

static uint64_t small_matrices(void)
{
    cairn_random random = cairn_random_seed(4, 1);
    uint64_t hash = START;

    for (int i = 0; i < 5000; i++) {
        cairn_sym3 m = cairn_sym3_zero(), inverse;
        cairn_sym2 small;
        cairn_real values[3], vectors[3][3], v[3], x[3];
        cairn_vec2 minor, major;

        for (int k = 0; k < 4; k++) {
            for (int c = 0; c < 3; c++)
                v[c] = argument(&random, 3, 0);
            cairn_sym3_add_outer(&m, v, 1);
        }
        small.xx = m.xx, small.xy = m.xy, small.yy = m.yy;
        cairn_sym2_eigen(small, values, &minor, &major);
        hash = add_point(add_point(hash, minor), major);
        hash = add_real(add_real(hash, values[0]), values[1]);
        if (cairn_sym3_solve(m, v, x))
            for (int k = 0; k < 3; k++)
                hash = add_real(hash, x[k]);
        if (cairn_sym3_inverse(m, &inverse))
            hash = add_real(add_real(hash, inverse.xy), inverse.zz);
        cairn_sym3_eigen(m, values, vectors);
        for (int k = 0; k < 9; k++)
            hash = add_real(hash, vectors[k / 3][k % 3]);
        for (int k = 0; k < 3; k++)
            hash = add_real(hash, values[k]);
    }
    return hash;
}

/* Six scans of the corner of a room, some walls longer than others, aligned by 20 iterations. */
static uint64_t force_field(void)
{
    enum { SCANS = 6, WALLS = 2, POINTS = 12 };
    static _Alignas(
        CAIRN_ALIGN) unsigned char memory[CAIRN_FORCE_FIELD_BYTES(SCANS, SCANS * WALLS * POINTS, SCANS * WALLS, 128)];
    static const int32_t first_point[WALLS + 1] = {0, POINTS, WALLS * POINTS};
    cairn_force_field_params params = cairn_force_field_default();
    cairn_random random = cairn_random_seed(5, 1);
    cairn_force_field_state state;
    cairn_force_field *field;
    cairn_pool pool;
    uint64_t hash = START;

    params.max_scans = SCANS;
    params.max_segments = SCANS * WALLS;
    params.max_points = SCANS * WALLS * POINTS;
    params.max_corners = 128;
    params.max_steps = 20;
    if (cairn_pool_init(&pool, memory, sizeof memory) != CAIRN_OK ||
        cairn_force_field_create(&field, &pool, &params) != CAIRN_OK)
        return 0;
    for (int i = 0; i < SCANS; i++) {
        cairn_oriented_point points[WALLS * POINTS];
        cairn_segment walls[WALLS];
        cairn_scan_view view = {0};
        cairn_real size = 1 + argument(&random, CAIRN_REAL(0.3), 0);
        cairn_pose pose = {argument(&random, CAIRN_REAL(0.1), 0), 0, 0};

        pose.y = argument(&random, CAIRN_REAL(0.1), 0);
        pose.theta = argument(&random, CAIRN_REAL(0.1), 0);
        for (int k = 0; k < WALLS * POINTS; k++) {
            cairn_real place = size * (cairn_real)(k % POINTS) / (POINTS - 1);
            cairn_oriented_point upward = {{0, place - size}, {0, 1}}, leftward = {{-place, 0}, {-1, 0}};

            points[k] = k < POINTS ? upward : leftward;
        }
        for (int k = 0; k < WALLS; k++) {
            walls[k].a = points[k * POINTS].position;
            walls[k].b = points[(k + 1) * POINTS - 1].position;
        }
        view.segments = walls;
        view.first_point = first_point;
        view.points = points;
        view.segment_count = WALLS;
        view.point_count = WALLS * POINTS;
        view.sensor.x = view.sensor.y = -1;
        if (cairn_force_field_add_scan(field, &view, NULL, pose, NULL) != CAIRN_OK)
            return 0;
    }
    do {
        cairn_budget budget = {1000};

        if (cairn_force_field_step(field, &budget) < 0)
            return 0;
        state = cairn_force_field_read(field);
    } while (state.verdict == CAIRN_FORCE_FIELD_RUNNING);
    for (int i = 0; i < SCANS; i++)
        hash = add_pose(hash, cairn_force_field_pose(field, i));
    return add_real(hash, state.potential);
}

static const struct {
    const char *name;
    scene run;
} SCENES[] = {
    {"elementary_functions", elementary_functions},
    {"random_numbers", random_numbers},
    {"poses_and_segments", poses_and_segments},
    {"small_matrices", small_matrices},
    {"force_field", force_field},
};

static void print_line(const char *name, uint64_t hash)
{
    char line[64];
    size_t length = strlen(name);

    memcpy(line, name, length);
    line[length++] = ' ';
    for (int shift = 60; shift >= 0; shift -= 4)
        line[length++] = "0123456789abcdef"[hash >> shift & 15];
    line[length++] = '\n';
    line[length] = '\0';
    board_print(line);
}

int main(void)
{
    static _Alignas(CAIRN_ALIGN) unsigned char memory[CAIRN_ALIGN];
    cairn_pool pool;

    if (cairn_pool_init(&pool, memory, sizeof memory) != CAIRN_OK) {
        board_print("this build does not compute faithfully\n");
        return 1;
    }
    for (size_t i = 0; i < sizeof SCENES / sizeof *SCENES; i++)
        print_line(SCENES[i].name, SCENES[i].run());
    return 0;
}
