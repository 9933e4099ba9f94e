/* Edge linking: drawn images with known chains, random ones compared with a reference
 * implementation; budgets, refusals. */
#include "tests/test.h"

#include "cairn/edge_chain.h"

enum { SIDE = 40, PIXELS = SIDE * SIDE };

/* An image drawn by hand, or at random. */
typedef struct picture {
    uint8_t data[PIXELS];
    int32_t width, height;
} picture;

/* Rows separated by '\n': '#' is 200, a digit 10 times itself plus 5, all else 0. */
static picture draw(const char *rows)
{
    picture p;
    int32_t x = 0;

    memset(&p, 0, sizeof p);
    p.height = 1;
    for (; *rows != '\0'; rows++) {
        if (*rows == '\n') {
            p.height++;
            x = 0;
            continue;
        }
        p.data[(p.height - 1) * SIDE + x] = *rows == '#' ? 200
                                            : *rows >= '0' && *rows <= '9'
                                                ? (uint8_t)(10 * (*rows - '0') + 5)
                                                : 0;
        x++;
        p.width = x > p.width ? x : p.width;
    }
    return p;
}

/* Blobs and lines: a share of pixels in 256ths, of up to `levels` strengths. */
static picture scatter(uint64_t seed, int32_t share, int32_t levels)
{
    cairn_random random = cairn_random_seed(seed, 7);
    picture p;

    memset(&p, 0, sizeof p);
    p.width = SIDE - (int32_t)cairn_random_below(&random, 12);
    p.height = SIDE - (int32_t)cairn_random_below(&random, 12);
    for (int32_t y = 0; y < p.height; y++)
        for (int32_t x = 0; x < p.width; x++)
            if (cairn_random_below(&random, 256) < share)
                p.data[y * SIDE + x] =
                    (uint8_t)(1 + cairn_random_below(&random, levels) * (254 / levels));
    return p;
}

static cairn_raster_u8_view view_of(const picture *p)
{
    cairn_raster_u8_view view = {p->data, p->width, p->height, SIDE};

    return view;
}

static cairn_edge_chain_params small_params(void)
{
    cairn_edge_chain_params params = cairn_edge_chain_default();

    params.max_width = params.max_height = SIDE;
    params.max_edges = PIXELS;
    params.max_chains = PIXELS;
    params.min_length = 2;
    params.max_spur = 0;
    return params;
}

struct fixture {
    cairn_pool pool;
    cairn_edge_chain_set *set;
};

static struct fixture set_with(cairn_edge_chain_params params)
{
    struct fixture f;

    f.pool = test_pool(cairn_edge_chain_memory(&params));
    assert_ok(cairn_edge_chain_create(&f.set, &f.pool, &params));
    return f;
}

static cairn_edge_chain_result search(cairn_edge_chain_set *set, const picture *p)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_edge_chain_begin(set, view_of(p)));
    assert_ok(cairn_edge_chain_step(set, &budget));
    return cairn_edge_chain_read(set);
}

/* ---- Reference implementation ---- */

static int at(const picture *p, int32_t x, int32_t y)
{
    return x >= 0 && y >= 0 && x < p->width && y < p->height && p->data[y * SIDE + x] != 0;
}

/* Steps round a pixel, clockwise on the screen, from the east. */
static const int32_t ring_x[8] = {1, 1, 0, -1, -1, -1, 0, 1},
                     ring_y[8] = {0, 1, 1, 1, 0, -1, -1, -1};

static int near(const picture *p, int32_t x, int32_t y, int32_t k)
{
    return at(p, x + ring_x[k % 8], y + ring_y[k % 8]);
}

static int32_t neighbour_count(const picture *p, int32_t x, int32_t y)
{
    int32_t count = 0;

    for (int32_t k = 0; k < 8; k++)
        count += near(p, x, y, k);
    return count;
}

static int touch(int32_t j, int32_t k)
{
    return abs(ring_x[j] - ring_x[k]) <= 1 && abs(ring_y[j] - ring_y[k]) <= 1;
}

/* Connected groups of neighbours without the pixel itself. */
static int32_t group_count(const picture *p, int32_t x, int32_t y)
{
    int32_t label[8], groups = 0;

    for (int32_t k = 0; k < 8; k++)
        label[k] = near(p, x, y, k) ? k : -1;
    for (int32_t round = 0; round < 8; round++)
        for (int32_t j = 0; j < 8; j++)
            for (int32_t k = 0; k < 8; k++)
                if (label[j] >= 0 && label[k] >= 0 && touch(j, k) && label[k] < label[j])
                    label[j] = label[k];
    for (int32_t k = 0; k < 8; k++)
        groups += label[k] == k;
    return groups;
}

static int on_border(const picture *p, int32_t x, int32_t y)
{
    return !near(p, x, y, 0) || !near(p, x, y, 2) || !near(p, x, y, 4) || !near(p, x, y, 6);
}

static int may_go(const picture *p, int32_t x, int32_t y)
{
    int32_t count = neighbour_count(p, x, y);

    if (count < 2 || !on_border(p, x, y) || group_count(p, x, y) != 1)
        return 0;
    for (int32_t k = 0; k < 8; k++)
        if (count == 2 && near(p, x, y, k) && near(p, x, y, k + 1))
            return 0;
    return 1;
}

static int32_t capped_distance(const picture *p, int32_t x, int32_t y)
{
    int32_t least = 7;

    for (int32_t v = -1; v <= p->height; v++)
        for (int32_t u = -1; u <= p->width; u++)
            if (!at(p, u, v) && abs(u - x) + abs(v - y) < least)
                least = abs(u - x) + abs(v - y);
    return least;
}

/* The next pixel in the queue is searched among all pixels, by rank and then by the time of
 * entry. */
static picture slow_thin(const picture *input)
{
    static int32_t rank[PIXELS], since[PIXELS];
    picture p = *input;
    int32_t clock = 0;

    for (int32_t i = 0; i < PIXELS; i++) {
        int32_t x = i % SIDE, y = i / SIDE;

        since[i] = at(&p, x, y) ? clock++ : -1;
        rank[i] = since[i] < 0 ? 0 : 8 * p.data[i] + capped_distance(input, x, y);
    }
    for (;;) {
        int32_t next = -1, x, y;

        for (int32_t i = 0; i < PIXELS; i++)
            if (since[i] >= 0 && (next < 0 || rank[i] < rank[next] ||
                                  (rank[i] == rank[next] && since[i] < since[next])))
                next = i;
        if (next < 0)
            return p;
        x = next % SIDE;
        y = next / SIDE;
        since[next] = -1;
        if (!may_go(&p, x, y))
            continue;
        p.data[next] = 0;
        for (int32_t k = 0; k < 8; k++) {
            int32_t i = (y + ring_y[k]) * SIDE + x + ring_x[k];

            if (near(&p, x, y, k) && since[i] < 0) {
                rank[i] = rank[next];
                since[i] = clock++;
            }
        }
    }
}

static int32_t degree(const picture *p, int32_t x, int32_t y)
{
    int32_t count = 0;

    for (int32_t k = 0; k < 8; k++)
        count +=
            near(p, x, y, k) && (k % 2 == 0 || (!near(p, x, y, k + 7) && !near(p, x, y, k + 1)));
    return count;
}

static int linked(const picture *p, cairn_edge_chain_pixel a, cairn_edge_chain_pixel b)
{
    int32_t dx = b.x - a.x, dy = b.y - a.y;

    if (abs(dx) > 1 || abs(dy) > 1 || (dx == 0 && dy == 0))
        return 0;
    return dx == 0 || dy == 0 || (!at(p, a.x + dx, a.y) && !at(p, a.x, a.y + dy));
}

/* Every link of the thinned image is in exactly one chain; chains end at every pixel that is not of
 * degree two, and report it. */
static void check_chains(const picture *thin, const cairn_edge_chain_result *r, int32_t min_length)
{
    int32_t links = 0, in_chains = 0, end = 0;

    for (int32_t y = 0; y < thin->height; y++)
        for (int32_t x = 0; x < thin->width; x++)
            links += at(thin, x, y) ? degree(thin, x, y) : 0;
    for (int32_t i = 0; i < r->chain_count; i++) {
        const cairn_edge_chain *c = &r->chains[i];
        const cairn_edge_chain_pixel *pixel = &r->pixels[c->first];
        int closed = c->from == CAIRN_EDGE_CHAIN_CLOSED;

        assert_int_equal(c->first, end);
        assert_true(c->count >= min_length);
        end = c->first + c->count;
        for (int32_t k = 0; k < c->count; k++) {
            int32_t own = degree(thin, pixel[k].x, pixel[k].y);
            int is_end = !closed && (k == 0 || k == c->count - 1);

            assert_true(at(thin, pixel[k].x, pixel[k].y));
            assert_true(k == 0 || linked(thin, pixel[k - 1], pixel[k]));
            assert_int_equal(own == 2, !is_end);
            if (is_end)
                assert_int_equal(k == 0 ? c->from : c->to,
                                 own == 1 ? CAIRN_EDGE_CHAIN_OPEN : CAIRN_EDGE_CHAIN_JUNCTION);
        }
        assert_int_equal(closed, c->to == CAIRN_EDGE_CHAIN_CLOSED);
        assert_true(!closed || linked(thin, pixel[0], pixel[c->count - 1]));
        in_chains += 2 * (c->count - !closed);
    }
    assert_int_equal(end, r->pixel_count);
    if (min_length == 2)
        assert_int_equal(in_chains, links);
}

/* All pixels of chains, as an image. */
static picture chains_drawn(const picture *like, const cairn_edge_chain_result *r)
{
    picture p = *like;

    memset(p.data, 0, sizeof p.data);
    for (int32_t i = 0; i < r->pixel_count; i++)
        p.data[r->pixels[i].y * SIDE + r->pixels[i].x] =
            like->data[r->pixels[i].y * SIDE + r->pixels[i].x];
    return p;
}

static void agrees_with_the_reference(void **state)
{
    static const int32_t shares[] = {20, 60, 110, 160, 220, 256};
    static const int32_t levels[] = {1, 3, 254};
    struct fixture f = set_with(small_params());

    (void)state;
    for (uint64_t seed = 0; seed < 36; seed++) {
        picture p = scatter(seed, shares[seed % 6], levels[seed / 6 % 3]);
        cairn_edge_chain_result r = search(f.set, &p);
        picture thin = slow_thin(&p), drawn = chains_drawn(&p, &r);

        check_chains(&thin, &r, 2);
        for (int32_t i = 0; i < PIXELS; i++)
            if (degree(&thin, i % SIDE, i / SIDE) > 0 || drawn.data[i] != 0)
                assert_int_equal(drawn.data[i], thin.data[i]);
    }
    test_pool_free(&f.pool);
}

/* ---- Images with a known answer ---- */

/* `expected` is the result of thinning and pruning; compared without isolated pixels. */
static void expect_thinned(const char *rows, const char *expected)
{
    cairn_edge_chain_params params = small_params();
    picture p = draw(rows), wanted = draw(expected), drawn;
    cairn_edge_chain_result r;
    struct fixture f;

    params.max_spur = 3;
    f = set_with(params);
    r = search(f.set, &p);
    drawn = chains_drawn(&p, &r);
    for (int32_t i = 0; i < PIXELS; i++)
        assert_int_equal(drawn.data[i] != 0, wanted.data[i] != 0);
    test_pool_free(&f.pool);
}

/* To within a pixel at the ends. */
static void thick_lines_keep_their_middle_and_length(void **state)
{
    (void)state;
    expect_thinned(".########.\n"
                   "##########\n"
                   ".########.",
                   "..........\n"
                   "##########\n"
                   "..........");
    expect_thinned("##########\n"
                   "##########\n"
                   "##########",
                   "..........\n"
                   ".########.\n"
                   "#........#");
    expect_thinned("##\n##\n##\n##\n##\n##", ".#\n.#\n.#\n.#\n.#\n#.");
    expect_thinned("##########\n"
                   "##########",
                   ".........#\n"
                   "#########.");
}

static void lines_run_along_the_crest(void **state)
{
    (void)state;
    expect_thinned("1111111111\n"
                   "4444444444\n"
                   "9999999999\n"
                   "2222222222",
                   "..........\n"
                   "..........\n"
                   "#########.\n"
                   ".........#");
    expect_thinned("95........\n"
                   "595.......\n"
                   ".595......\n"
                   "..595.....\n"
                   "...5999999\n"
                   "....555555",
                   "#.........\n"
                   ".#........\n"
                   "..#.......\n"
                   "...#......\n"
                   "....#####.\n"
                   ".........#");
}

static void corners_of_stairs_go(void **state)
{
    (void)state;
    expect_thinned("##....\n"
                   ".##...\n"
                   "..##..\n"
                   "...##.",
                   "#.....\n"
                   ".#....\n"
                   "..#...\n"
                   "...##.");
}

static void expect_chain(const cairn_edge_chain_result *r, int32_t i, cairn_edge_chain_end from,
                         cairn_edge_chain_end to, int32_t count)
{
    assert_true(i < r->chain_count);
    assert_int_equal(r->chains[i].from, from);
    assert_int_equal(r->chains[i].to, to);
    assert_int_equal(r->chains[i].count, count);
}

static void lines_part_at_junctions(void **state)
{
    struct fixture f = set_with(small_params());
    picture p = draw(".......\n"
                     ".#...#.\n"
                     "..#.#..\n"
                     "...#...\n"
                     "...#...\n"
                     "...#...");
    cairn_edge_chain_result r = search(f.set, &p);

    (void)state;
    assert_int_equal(r.chain_count, 3);
    expect_chain(&r, 0, CAIRN_EDGE_CHAIN_OPEN, CAIRN_EDGE_CHAIN_JUNCTION, 3);
    expect_chain(&r, 1, CAIRN_EDGE_CHAIN_OPEN, CAIRN_EDGE_CHAIN_JUNCTION, 3);
    expect_chain(&r, 2, CAIRN_EDGE_CHAIN_JUNCTION, CAIRN_EDGE_CHAIN_OPEN, 3);
    for (int32_t i = 0; i < 3; i++) {
        const cairn_edge_chain_pixel *end = &r.pixels[r.chains[i].first + (i < 2 ? 2 : 0)];

        assert_int_equal(end->x, 3);
        assert_int_equal(end->y, 3);
    }
    assert_int_equal(r.pixels[0].x, 1);
    assert_int_equal(r.pixels[r.chains[1].first].x, 5);
    test_pool_free(&f.pool);
}

static void a_ring_is_closed_and_its_tail_is_not(void **state)
{
    struct fixture f = set_with(small_params());
    picture ring = draw("..###..\n"
                        ".#...#.\n"
                        ".#...#.\n"
                        "..###..");
    picture tail = draw("..###......\n"
                        ".#...#.....\n"
                        ".#...######\n"
                        "..###......");
    cairn_edge_chain_result r = search(f.set, &ring);

    (void)state;
    assert_int_equal(r.chain_count, 1);
    expect_chain(&r, 0, CAIRN_EDGE_CHAIN_CLOSED, CAIRN_EDGE_CHAIN_CLOSED, 10);
    assert_int_equal(r.pixels[0].x, 2);
    assert_int_equal(r.pixels[0].y, 0);
    assert_int_equal(r.pixels[1].x, 3);

    r = search(f.set, &tail);
    assert_int_equal(r.chain_count, 2);
    assert_int_equal(r.chains[0].from, CAIRN_EDGE_CHAIN_JUNCTION);
    assert_int_equal(r.chains[0].to, CAIRN_EDGE_CHAIN_OPEN);
    assert_int_equal(r.chains[1].from, CAIRN_EDGE_CHAIN_JUNCTION);
    assert_int_equal(r.chains[1].to, CAIRN_EDGE_CHAIN_JUNCTION);
    assert_memory_equal(&r.pixels[r.chains[1].first],
                        &r.pixels[r.chains[1].first + r.chains[1].count - 1],
                        sizeof(cairn_edge_chain_pixel));
    test_pool_free(&f.pool);
}

/* Two loops that share one pixel need the most memory per pixel. */
static void loops_through_one_junction(void **state)
{
    cairn_edge_chain_params params = small_params();
    picture p = draw(".##.##.\n"
                     "#..#..#\n"
                     ".##.##.");
    cairn_edge_chain_result r;
    struct fixture f;
    cairn_budget budget = {CAIRN_UNBOUNDED};

    (void)state;
    params.max_edges = 11;
    params.max_chains = 2;
    f = set_with(params);
    r = search(f.set, &p);
    assert_int_equal(r.edge_count, 11);
    assert_int_equal(r.chain_count, 2);
    assert_int_equal(r.pixel_count, 14);
    test_pool_free(&f.pool);

    params.max_chains = 1;
    f = set_with(params);
    assert_ok(cairn_edge_chain_begin(f.set, view_of(&p)));
    assert_status(cairn_edge_chain_step(f.set, &budget), CAIRN_FULL);
    r = cairn_edge_chain_read(f.set);
    assert_int_equal(r.chain_count, 0);
    assert_null(r.chains);
    assert_ok(cairn_edge_chain_step(f.set, &budget));
    test_pool_free(&f.pool);
}

static void spurs_go_and_branches_stay(void **state)
{
    cairn_edge_chain_params params = small_params();
    picture p = draw("...#......#....\n"
                     "...#......#....\n"
                     "...#......#....\n"
                     "###############\n"
                     "..........#....\n"
                     "...............\n"
                     "##.............");
    cairn_edge_chain_result r;
    struct fixture f;

    (void)state;
    /* Branches of two pixels at a pixel that lines share stay at 1 and are removed at 2; a short
     * separate line is not a branch. */
    params.max_spur = 1;
    f = set_with(params);
    r = search(f.set, &p);
    assert_int_equal(r.chain_count, 6);
    expect_chain(&r, 0, CAIRN_EDGE_CHAIN_OPEN, CAIRN_EDGE_CHAIN_JUNCTION, 3);
    expect_chain(&r, 5, CAIRN_EDGE_CHAIN_OPEN, CAIRN_EDGE_CHAIN_OPEN, 2);
    test_pool_free(&f.pool);

    params.max_spur = 2;
    f = set_with(params);
    r = search(f.set, &p);
    assert_int_equal(r.chain_count, 2);
    expect_chain(&r, 0, CAIRN_EDGE_CHAIN_OPEN, CAIRN_EDGE_CHAIN_OPEN, 15);
    expect_chain(&r, 1, CAIRN_EDGE_CHAIN_OPEN, CAIRN_EDGE_CHAIN_OPEN, 2);
    test_pool_free(&f.pool);
}

static void long_branches_stay(void **state)
{
    cairn_edge_chain_params params = small_params();
    picture p = draw(".....#.....\n"
                     ".....#.....\n"
                     ".....#.....\n"
                     ".....#.....\n"
                     "....#.#....\n"
                     "...#...#...\n"
                     "..#.....#..\n"
                     ".#.......#.\n"
                     "#.........#");
    cairn_edge_chain_result r;
    struct fixture f;

    (void)state;
    params.max_spur = 2;
    f = set_with(params);
    r = search(f.set, &p);
    assert_int_equal(r.chain_count, 3);
    expect_chain(&r, 0, CAIRN_EDGE_CHAIN_OPEN, CAIRN_EDGE_CHAIN_JUNCTION, 4);
    expect_chain(&r, 1, CAIRN_EDGE_CHAIN_JUNCTION, CAIRN_EDGE_CHAIN_OPEN, 6);
    expect_chain(&r, 2, CAIRN_EDGE_CHAIN_JUNCTION, CAIRN_EDGE_CHAIN_OPEN, 6);
    test_pool_free(&f.pool);
    params.max_spur = 3;
    f = set_with(params);
    assert_int_equal(search(f.set, &p).chain_count, 1);
    test_pool_free(&f.pool);
}

static void weak_pixels_and_short_chains_are_left_out(void **state)
{
    cairn_edge_chain_params params = small_params();
    picture p = draw("5555555\n"
                     ".......\n"
                     "6666666\n"
                     ".......\n"
                     "999.99.\n"
                     "......."
                     "\n9......");
    cairn_edge_chain_result r;
    struct fixture f;

    (void)state;
    params.min_strength = 56;
    params.min_length = 3;
    f = set_with(params);
    r = search(f.set, &p);
    assert_int_equal(r.edge_count, 13);
    assert_int_equal(r.chain_count, 2);
    assert_int_equal(r.short_count, 1);
    assert_near(r.chains[0].strength, 65, 0);
    assert_int_equal(r.chains[0].count, 7);
    assert_near(r.chains[1].strength, 95, 0);
    assert_int_equal(r.chains[1].count, 3);
    check_chains(&p, &r, 3);
    test_pool_free(&f.pool);
}

static void strength_is_the_mean_of_the_chain(void **state)
{
    struct fixture f = set_with(small_params());
    picture p = draw("1234");
    cairn_edge_chain_result r = search(f.set, &p);

    (void)state;
    assert_int_equal(r.chain_count, 1);
    assert_near(r.chains[0].strength, 30, 0);
    test_pool_free(&f.pool);
}

/* ---- Degenerate images, budgets, refusals ---- */

static void nothing_and_everything(void **state)
{
    struct fixture f = set_with(small_params());
    picture empty = draw("....\n....");
    picture one = draw("#"), full = scatter(1, 256, 1);
    cairn_edge_chain_result r = search(f.set, &empty);

    (void)state;
    assert_int_equal(r.chain_count + r.pixel_count + r.edge_count, 0);
    r = search(f.set, &one);
    assert_int_equal(r.edge_count, 1);
    assert_int_equal(r.chain_count, 0);
    r = search(f.set, &full);
    assert_int_equal(r.edge_count, full.width * full.height);
    assert_true(r.chain_count > 0);
    test_pool_free(&f.pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_edge_chain_params params = small_params();
    picture p = scatter(5, 110, 254);
    struct fixture f, other;
    cairn_edge_chain_result r;

    (void)state;
    params.max_spur = 3;
    f = set_with(params);
    other = set_with(params);
    r = search(f.set, &p);
    for (size_t k = 0; k < sizeof budgets / sizeof *budgets; k++) {
        cairn_edge_chain_result again;
        cairn_status status = CAIRN_MORE;

        assert_ok(cairn_edge_chain_begin(other.set, view_of(&p)));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {budgets[k]};

            assert_int_equal(cairn_edge_chain_read(other.set).chain_count, 0);
            status = cairn_edge_chain_step(other.set, &budget);
            assert_true(budget.left >= 0 && (status != CAIRN_MORE || budget.left == 0));
        }
        assert_ok(status);
        again = cairn_edge_chain_read(other.set);
        assert_int_equal(again.chain_count, r.chain_count);
        assert_int_equal(again.pixel_count, r.pixel_count);
        assert_int_equal(again.short_count, r.short_count);
        assert_memory_equal(again.chains, r.chains, (size_t)r.chain_count * sizeof *r.chains);
        assert_memory_equal(again.pixels, r.pixels, (size_t)r.pixel_count * sizeof *r.pixels);
    }
    test_pool_free(&f.pool);
    test_pool_free(&other.pool);
}

static void work_is_linear(void **state)
{
    struct fixture f = set_with(small_params());
    picture empty = draw("."), line = draw("########################################");
    cairn_budget budget = {100000};

    (void)state;
    empty.width = empty.height = SIDE;
    assert_ok(cairn_edge_chain_begin(f.set, view_of(&empty)));
    assert_ok(cairn_edge_chain_step(f.set, &budget));
    /* 42 x 42 cells: three passes at four a unit, two at sixteen; 2048 queues at eight and at
     * sixteen a unit. */
    assert_int_equal(100000 - budget.left, 3 * 441 + 2 * 111 + 256 + 128);
    budget.left = 100000;
    line.height = SIDE;
    assert_ok(cairn_edge_chain_begin(f.set, view_of(&line)));
    assert_ok(cairn_edge_chain_step(f.set, &budget));
    assert_true(100000 - budget.left < 3 * 441 + 2 * 111 + 256 + 128 + 40 * 12);
    test_pool_free(&f.pool);
}

static void a_view_turned_upside_down(void **state)
{
    struct fixture f = set_with(small_params());
    picture p = draw("#......\n"
                     ".######");
    cairn_raster_u8_view view = view_of(&p);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_edge_chain_result r;

    (void)state;
    view.data = p.data + SIDE;
    view.stride = -SIDE;
    assert_ok(cairn_edge_chain_begin(f.set, view));
    assert_ok(cairn_edge_chain_step(f.set, &budget));
    r = cairn_edge_chain_read(f.set);
    assert_int_equal(r.chain_count, 1);
    assert_int_equal(r.pixels[0].x, 6);
    assert_int_equal(r.pixels[0].y, 0);
    assert_int_equal(r.pixels[6].x, 0);
    assert_int_equal(r.pixels[6].y, 1);
    test_pool_free(&f.pool);
}

static void too_many_edges_are_refused(void **state)
{
    cairn_edge_chain_params params = small_params();
    picture four = draw("####"), five = draw("#####");
    cairn_budget budget = {CAIRN_UNBOUNDED};
    struct fixture f;

    (void)state;
    params.max_edges = 4;
    params.max_chains = 1;
    f = set_with(params);
    assert_int_equal(search(f.set, &four).chain_count, 1);
    assert_ok(cairn_edge_chain_begin(f.set, view_of(&five)));
    assert_status(cairn_edge_chain_step(f.set, &budget), CAIRN_FULL);
    assert_int_equal(cairn_edge_chain_read(f.set).chain_count, 0);
    assert_int_equal(search(f.set, &four).chain_count, 1);
    test_pool_free(&f.pool);
}

static void bad_pictures_are_refused(void **state)
{
    cairn_edge_chain_params params = small_params();
    picture p = draw("####");
    cairn_raster_u8_view view = view_of(&p);
    cairn_budget budget = {10};
    struct fixture f;

    (void)state;
    params.max_width = 5;
    params.max_height = 3;
    f = set_with(params);
    assert_status(cairn_edge_chain_begin(NULL, view), CAIRN_BAD_ARGUMENT);
    assert_int_equal(search(f.set, &p).chain_count, 1);
    view.data = NULL;
    assert_status(cairn_edge_chain_begin(f.set, view), CAIRN_BAD_ARGUMENT);
    view = view_of(&p);
    view.width = 6;
    assert_status(cairn_edge_chain_begin(f.set, view), CAIRN_FULL);
    view.width = 5;
    view.height = 4;
    assert_status(cairn_edge_chain_begin(f.set, view), CAIRN_FULL);
    /* Refused: the last result stays. */
    assert_int_equal(cairn_edge_chain_read(f.set).chain_count, 1);
    view.height = 3;
    assert_ok(cairn_edge_chain_begin(f.set, view));
    assert_status(cairn_edge_chain_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_edge_chain_step(f.set, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(cairn_edge_chain_read(NULL).chain_count, 0);
    test_pool_free(&f.pool);
}

static cairn_status create_in(void *context, cairn_pool *pool)
{
    cairn_edge_chain_set *set;

    return cairn_edge_chain_create(&set, pool, context);
}

static void memory_is_exactly_as_stated(void **state)
{
    cairn_edge_chain_params params = small_params(), most = params;
    cairn_edge_chain_set *set;

    (void)state;
    assert_status(cairn_edge_chain_create(&set, NULL, &params), CAIRN_BAD_ARGUMENT);
    most.max_width = most.max_height = CAIRN_RASTER_MAX_SIDE;
    most.max_spur = 64;
    most.min_strength = 255;
    assert_true(cairn_edge_chain_memory(&most) >
                (size_t)CAIRN_RASTER_MAX_SIDE * CAIRN_RASTER_MAX_SIDE);
    params.max_width = 9;
    params.max_height = 7;
    params.max_edges = 20;
    params.max_chains = 3;
    test_every_pool_size(create_in, &params, cairn_edge_chain_memory(&params));
    assert_true(CAIRN_EDGE_CHAIN_BYTES(9, 7, 20, 3) >= cairn_edge_chain_memory(&params));
    assert_true(CAIRN_EDGE_CHAIN_BYTES(9, 7, 20, 3) <= cairn_edge_chain_memory(&params) + 400);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_the_reference),
        cmocka_unit_test(thick_lines_keep_their_middle_and_length),
        cmocka_unit_test(lines_run_along_the_crest),
        cmocka_unit_test(corners_of_stairs_go),
        cmocka_unit_test(lines_part_at_junctions),
        cmocka_unit_test(a_ring_is_closed_and_its_tail_is_not),
        cmocka_unit_test(loops_through_one_junction),
        cmocka_unit_test(spurs_go_and_branches_stay),
        cmocka_unit_test(long_branches_stay),
        cmocka_unit_test(weak_pixels_and_short_chains_are_left_out),
        cmocka_unit_test(strength_is_the_mean_of_the_chain),
        cmocka_unit_test(nothing_and_everything),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(work_is_linear),
        cmocka_unit_test(a_view_turned_upside_down),
        cmocka_unit_test(too_many_edges_are_refused),
        cmocka_unit_test(bad_pictures_are_refused),
        cmocka_unit_test(memory_is_exactly_as_stated),
    };
    return cmocka_run_group_tests_name("edge_chain", tests, NULL, NULL);
}
