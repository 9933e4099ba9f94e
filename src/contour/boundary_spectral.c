/* What the whole image says of a border: the cuts that part it best.
 *
 * Method: neighbouring regions belong together by exp(- strength / scale) a side of their border.
 * The eigenvectors of least positive value of the normalised Laplacian of that graph are nearly
 * constant where regions belong together and change where few and weak ties are cut (Shi and Malik
 * 2000). The change of the first ones across a border, each divided by the root of its value, adds
 * to the border's strength: it goes up where a closed outline runs, and not at a strong edge that
 * ends within a region.
 *
 * The vectors come from subspace iteration: each is passed through a Chebyshev polynomial that
 * damps all but the wanted end of the spectrum, then they are made orthonormal and turned to the
 * eigenvectors within their span.
 *
 * Source: Arbelaez, Maire, Fowlkes and Malik 2011, section 3.2, there with pixels in place of
 * regions. */
#include "src/core/build.h"

#include "cairn/random.h"
#include "src/contour/boundary_work.h"

enum { TURNS = 24, DEGREE = 10, SWEEPS = 10, WANTED = 8, BLOCK = BOUNDARY_BLOCK };
/* Of the mean strength: where two regions belong together by e times less. */
#define SCALE CAIRN_REAL(0.5)
/* Values below it count as it. */
#define LEAST_VALUE CAIRN_REAL(1e-6)
/* Regions and borders that a unit passes. */
enum { REGIONS_A_UNIT = 8 };

static cairn_real *vector_at(const cairn_boundary *b, int32_t i)
{
    return b->vectors + (ptrdiff_t)i * b->region_count;
}

static cairn_real dot(const cairn_real *u, const cairn_real *v, int32_t count)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < count; i++)
        sum += u[i] * v[i];
    return sum;
}

/* to = M from: M has the ties, divided by the roots of what both regions' ties come to. */
static void multiply(const cairn_boundary *b, const cairn_real *from, cairn_real *to)
{
    for (int32_t i = 0; i < b->region_count; i++)
        to[i] = 0;
    for (int32_t i = 0; i < b->border_count; i++) {
        const boundary_border *e = &b->borders[i];

        to[e->first[0]] += e->key * from[e->first[1]];
        to[e->first[1]] += e->key * from[e->first[0]];
    }
}

/* ---- Ties ---- */

void cairn_boundary_ties_begin(cairn_boundary *b)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < b->border_count; i++) {
        b->borders[i].own = b->borders[i].sum / (cairn_real)b->borders[i].sides;
        sum += b->borders[i].own;
    }
    b->mean_strength = sum / (cairn_real)(b->border_count > 0 ? b->border_count : 1);
    b->block =
        b->region_count >= 2 * BLOCK && b->params.global > 0 && b->mean_strength > 0 ? BLOCK : 0;
    b->turn = b->member = b->degree = 0;
    b->cut = 0;
}

/* Ties, what they come to at each region, and the vectors to begin with: nothing but noise, the
 * same each time. */
static void tie(cairn_boundary *b)
{
    cairn_random random = cairn_random_seed(1, 1);

    for (int32_t i = 0; i < b->region_count; i++)
        b->root[i] = 0;
    for (int32_t i = 0; i < b->border_count; i++) {
        boundary_border *e = &b->borders[i];

        e->key = cairn_exp(-e->own / (SCALE * b->mean_strength)) * (cairn_real)e->sides;
        b->root[e->first[0]] += e->key;
        b->root[e->first[1]] += e->key;
    }
    for (int32_t i = 0; i < b->region_count; i++)
        b->root[i] = 1 / cairn_sqrt(cairn_max(b->root[i], CAIRN_REAL_MIN));
    for (int32_t i = 0; i < b->border_count; i++)
        b->borders[i].key *= b->root[b->borders[i].first[0]] * b->root[b->borders[i].first[1]];
    for (int32_t k = 0; k < BLOCK; k++)
        for (int32_t i = 0; i < b->region_count; i++)
            vector_at(b, k)[i] = cairn_random_uniform(&random, -1, 1);
}

/* ---- Subspace iteration ---- */

/* One degree of the polynomial, of the vector at hand: T(k + 1) = 2 x T(k) - T(k - 1), where x
 * maps -1 ... cut to -1 ... 1. */
static void damp(cairn_boundary *b)
{
    cairn_real *now = vector_at(b, b->member), *before = vector_at(b, BLOCK),
               *next = vector_at(b, BLOCK + 1);
    cairn_real half = (b->cut + 1) / 2, middle = (b->cut - 1) / 2, twice = b->degree == 0 ? 1 : 2;

    multiply(b, now, next);
    for (int32_t i = 0; i < b->region_count; i++) {
        cairn_real value =
            twice * (next[i] - middle * now[i]) / half - (b->degree == 0 ? 0 : before[i]);

        before[i] = now[i];
        now[i] = value;
    }
}

/* The vector at hand becomes orthogonal to those before it, twice, and of length 1. */
static void straighten(const cairn_boundary *b)
{
    cairn_real *v = vector_at(b, b->member), length;

    for (int32_t pass = 0; pass < 2; pass++) {
        for (int32_t k = 0; k < b->member; k++) {
            const cairn_real *u = vector_at(b, k);
            cairn_real share = dot(u, v, b->region_count);

            for (int32_t i = 0; i < b->region_count; i++)
                v[i] -= share * u[i];
        }
        length = cairn_sqrt(dot(v, v, b->region_count));
        for (int32_t i = 0; i < b->region_count && length > 0; i++)
            v[i] /= length;
    }
}

/* Row `member` of the small matrix. */
static void project(cairn_boundary *b)
{
    cairn_real *image = vector_at(b, BLOCK);

    multiply(b, vector_at(b, b->member), image);
    for (int32_t k = 0; k < BLOCK; k++)
        b->small_matrix[b->member][k] = dot(vector_at(b, k), image, b->region_count);
}

/* One rotation of Jacobi's method that makes element p, q of the small matrix 0; of the vectors,
 * too. */
static void rotate(cairn_boundary *b, int32_t p, int32_t q)
{
    cairn_real(*m)[BLOCK] = b->small_matrix, apart = (m[q][q] - m[p][p]) / 2, off = m[p][q], t, c,
    s;

    t = off / (cairn_abs(apart) + cairn_sqrt(apart * apart + off * off));
    t = apart < 0 ? -t : t;
    c = 1 / cairn_sqrt(1 + t * t);
    s = t * c;
    for (int32_t k = 0; k < BLOCK; k++) {
        cairn_real x = m[k][p], y = m[k][q];

        m[k][p] = c * x - s * y;
        m[k][q] = s * x + c * y;
    }
    for (int32_t k = 0; k < BLOCK; k++) {
        cairn_real x = m[p][k], y = m[q][k];

        m[p][k] = c * x - s * y;
        m[q][k] = s * x + c * y;
    }
    for (int32_t k = 0; k < BLOCK; k++) {
        cairn_real x = b->basis[k][p], y = b->basis[k][q];

        b->basis[k][p] = c * x - s * y;
        b->basis[k][q] = s * x + c * y;
    }
}

/* The eigenvectors of the small matrix, those of the greatest values first: order[]. */
static void solve_small(cairn_boundary *b, int32_t order[BLOCK])
{
    for (int32_t p = 0; p < BLOCK; p++)
        for (int32_t q = 0; q < BLOCK; q++) {
            b->basis[p][q] = p == q;
            b->small_matrix[p][q] =
                p < q ? (b->small_matrix[p][q] + b->small_matrix[q][p]) / 2 : b->small_matrix[p][q];
            b->small_matrix[p][q] = p > q ? b->small_matrix[q][p] : b->small_matrix[p][q];
        }
    for (int32_t sweep = 0; sweep < SWEEPS; sweep++)
        for (int32_t p = 0; p < BLOCK; p++)
            for (int32_t q = p + 1; q < BLOCK; q++)
                if (b->small_matrix[p][q] != 0)
                    rotate(b, p, q);
    for (int32_t p = 0; p < BLOCK; p++) {
        int32_t at = p;

        for (; at > 0 && b->small_matrix[order[at - 1]][order[at - 1]] < b->small_matrix[p][p];
             at--)
            order[at] = order[at - 1];
        order[at] = p;
    }
}

/* The vectors become the eigenvectors within their span. */
static void turn_vectors(cairn_boundary *b)
{
    int32_t order[BLOCK] = {0};

    solve_small(b, order);
    for (int32_t i = 0; i < b->region_count; i++) {
        cairn_real was[BLOCK];

        for (int32_t k = 0; k < BLOCK; k++)
            was[k] = vector_at(b, k)[i];
        for (int32_t k = 0; k < BLOCK; k++) {
            cairn_real sum = 0;

            for (int32_t j = 0; j < BLOCK; j++)
                sum += was[j] * b->basis[j][order[k]];
            vector_at(b, k)[i] = sum;
        }
    }
    for (int32_t k = 0; k < BLOCK; k++)
        b->value[k] = b->small_matrix[order[k]][order[k]];
    b->cut = cairn_max(0, cairn_min(b->value[BLOCK - 1], 1 - LEAST_VALUE));
}

/* ---- What comes of it ---- */

/* By how much vector k of unit mean square over the image's pixels is to be multiplied. */
static cairn_real scale_of(const cairn_boundary *b, int32_t k)
{
    cairn_real sum = 0, value = cairn_max(1 - b->value[k], LEAST_VALUE);

    for (int32_t i = 0; i < b->region_count; i++) {
        cairn_real at = b->root[i] * vector_at(b, k)[i];

        sum += at * at * (cairn_real)b->regions[i].pixels;
    }
    return 1 / cairn_sqrt(cairn_max(sum / (cairn_real)b->pixels, CAIRN_REAL_MIN) * value);
}

/* Adds the changes across borders to their strengths, in units of the mean of both. */
static void add_changes(const cairn_boundary *b)
{
    cairn_real sum = 0, unit;

    for (int32_t i = 0; i < b->border_count; i++)
        b->borders[i].key = 0;
    for (int32_t k = 1; k <= WANTED; k++) {
        const cairn_real *v = vector_at(b, k);
        cairn_real scale = scale_of(b, k);

        for (int32_t i = 0; i < b->border_count; i++) {
            boundary_border *e = &b->borders[i];

            e->key += scale * cairn_abs(b->root[e->first[0]] * v[e->first[0]] -
                                        b->root[e->first[1]] * v[e->first[1]]);
        }
    }
    for (int32_t i = 0; i < b->border_count; i++)
        sum += b->borders[i].key;
    if (!(sum > 0))
        return;
    unit = b->params.global * b->mean_strength * (cairn_real)b->border_count / sum;
    for (int32_t i = 0; i < b->border_count; i++)
        b->borders[i].own += unit * b->borders[i].key;
}

int32_t cairn_boundary_cuts_cost(const cairn_boundary *b)
{
    int32_t regions = boundary_share(b->region_count, REGIONS_A_UNIT);
    int32_t pass = regions + boundary_share(b->border_count, REGIONS_A_UNIT);

    switch (b->stage) {
    case BOUNDARY_DAMP:
        return pass;
    case BOUNDARY_STRAIGHTEN:
        return 2 * BLOCK * regions;
    case BOUNDARY_TURN:
        return BLOCK * BLOCK * regions;
    default:
        return pass + BLOCK * regions;
    }
}

/* The next vector of a stage; 1: there was none, and the first one comes. */
static int is_last_member(cairn_boundary *b)
{
    b->member = (b->member + 1) % BLOCK;
    return b->member == 0;
}

int cairn_boundary_cuts_next(cairn_boundary *b)
{
    if (b->block == 0)
        return 0;
    if (b->turn == 0 && b->stage == BOUNDARY_TIE) {
        tie(b);
        b->stage = BOUNDARY_DAMP;
    } else if (b->stage == BOUNDARY_DAMP) {
        damp(b);
        b->degree = (b->degree + 1) % DEGREE;
        if (b->degree == 0 && is_last_member(b))
            b->stage = BOUNDARY_STRAIGHTEN;
    } else if (b->stage == BOUNDARY_STRAIGHTEN) {
        straighten(b);
        if (is_last_member(b))
            b->stage = BOUNDARY_PROJECT;
    } else if (b->stage == BOUNDARY_PROJECT) {
        project(b);
        if (is_last_member(b))
            b->stage = BOUNDARY_TURN;
    } else {
        turn_vectors(b);
        b->stage = BOUNDARY_DAMP;
        if (++b->turn == TURNS) {
            add_changes(b);
            return 0;
        }
    }
    return 1;
}
