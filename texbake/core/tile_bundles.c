/* Rays in bundles against a tree of triangles: the first hit of each, exactly.

   The rays of neighboring texels start side by side and are nearly parallel. So those of a square of
   16 x 16 texels are one bundle, and the tree is walked once for all of them. For each of the two
   axes of the square there is a linear function of space that grows by about one from texel to
   texel. How it deviates is measured at the two planes between which the rays run; between the
   planes, the bounds are linear in depth. A box outside the bounds of the bundle is skipped, and for
   a triangle the function gives the few columns and rows of texels whose rays can meet it. All these
   bounds only skip what no ray can hit. Rays that diverge, as those of a rough low-poly surface do,
   take only the leaves from that walk; each is then tested alone, against the boxes of these leaves
   and eight triangles at a time.

   A ray is tested against a triangle as in ray_triangle.h. The nearest hit counts; of equally near
   hits, the one on the lowest face. So a hit depends only on the ray and the triangles, not on the
   bundle, the tree or the threads.

   Based on: Reshetov, Soupikov, Hurley, "Multi-Level Ray Tracing Algorithm", 2005, for walking a tree
   with a beam; Möller, Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997, for the
   point on the triangle.

   Called from texbake/raycast/scene.py. */

#include <stdbool.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "ray_walk.h"

#define SIDE 16
#define RAYS (SIDE * SIDE)
#define LANES 4 /* rays tested together */
#define PLACES (RAYS + LANES) /* the lanes may go beyond the last row */
#define NO_HIT (-1)
/* Rays diverge if they deviate by this share of a bundle's width from what follows the places. They are
   then cast one by one into the leaves that the bundle can meet. */
#define DIVERGENT 0.75
/* Planes are moved apart by this, in local units, so that they never coincide. */
#define APART 1e-6
/* Of a coordinate: what float32 may err in the sums of the walk, and more. */
#define FLOAT_SLACK 2e-6

/* A function that is linear in depth. */
struct line {
    double at_zero, slope;
};

/* A linear function of space, and what it is for the rays of a bundle at each depth: base + step * place
   for the ray at a place, up to the deviation that is subtracted in `below` and added in `above`. For
   all of them it is from `below` to `high`. */
struct axis {
    double vector[3];
    struct line high, step, below, above;
    double deviation; /* the greatest, as a share of the columns or rows */
};

/* A bundle in coordinates x, y, z of which z is the one in which all its rays go farthest. */
struct bundle {
    int order[3]; /* the axes of space that x, y, z are */
    bool descending;
    int n, n_columns, n_rows;
    int fitted;        /* axes are fitted to the rays of one row of so many */
    double middle[2];  /* x and y of one of the rays, halfway */
    double planes[2];  /* depths between which the rays run */
    double doubt;      /* an edge whose sign is uncertain is at most this */
    double far;        /* no ray goes beyond this depth, counted in its direction */
    int n_new;         /* hits since `far` was computed */
    struct axis across, down;
    int rays[PLACES];  /* ray of each place, or NO_HIT */
    double x[PLACES], y[PLACES], z[PLACES], slope_x[PLACES], slope_y[PLACES], along[PLACES];
    double lengths[PLACES], nearest[PLACES];
    double weights[PLACES], holes[PLACES]; /* 1 and 0 where there is a ray, else 0 and 1e300 */
    int64_t slots[PLACES]; /* leaf and lane of the hit found in this call, or NO_HIT */
};

struct rays {
    const double (*origins)[3], (*directions)[3];
    const double *lengths;
    const int32_t (*places)[2];
    const int32_t *charts;
};

struct results {
    bool cull;
    double *nearest, *backs, (*barycentrics)[2], *distances;
    int32_t *faces;
};

static inline double at_depth(const struct line *line, double z)
{
    return line->at_zero + line->slope * z;
}

static const double COLUMNS[SIDE] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

/* The sums, the least and the greatest are taken column by column, since compilers keep the order of
   additions and can use vector instructions only so. */
static double sum_of(const double values[SIDE])
{
    double sum = 0.0;
    for (int k = 0; k < SIDE; k++)
        sum += values[k];
    return sum;
}

static double least_of(const double values[SIDE])
{
    double least = values[0];
    for (int k = 1; k < SIDE; k++)
        least = min_f64(least, values[k]);
    return least;
}

static double greatest_of(const double values[SIDE])
{
    double greatest = values[0];
    for (int k = 1; k < SIDE; k++)
        greatest = max_f64(greatest, values[k]);
    return greatest;
}

static struct line line_through(const double planes[2], double first, double second)
{
    const double slope = (second - first) / (planes[1] - planes[0]);
    return (struct line){first - slope * planes[0], slope};
}

/* The line of the ray at a place of a bundle. */
static inline struct ray_line line_at(const struct bundle *bundle, int place)
{
    return (struct ray_line){
        bundle->x[place], bundle->y[place], bundle->z[place],
        bundle->slope_x[place], bundle->slope_y[place], bundle->along[place]};
}

/* Rays that a triangle is tested against, `LANES` at a time, from a place on. */
struct tests {
    int n, places[RAYS / LANES];
    double least[RAYS / LANES][LANES], most[RAYS / LANES][LANES]; /* of the three edges */
    double distances[RAYS / LANES][LANES];
};

/* Whether a crossing is the nearest hit of a ray so far; then its face and distance are written. */
static inline bool is_nearest(
    int64_t i, double length, double *nearest, double distance, bool is_front,
    const struct ray_tree *tree, int64_t slot, const struct results *results)
{
    if (!(distance >= 0.0 && distance <= length))
        return false;
    if (!is_front) {
        results->backs[i] = min_f64(results->backs[i], distance);
        if (results->cull)
            return false;
    }
    const int32_t face = tree->ids[slot / WIDTH][slot % WIDTH];
    if (!(distance < *nearest || (distance == *nearest && face < results->faces[i])))
        return false;
    *nearest = distance;
    results->faces[i] = face;
    return true;
}

/* Keep a hit of a ray of a bundle if it is the nearest. */
static inline void keep_hit(
    struct bundle *bundle, int place, double distance, bool is_front, const struct ray_tree *tree,
    int64_t slot, const struct results *results)
{
    const int64_t i = bundle->rays[place];
    if (i < 0 || !is_nearest(i, bundle->lengths[place], &bundle->nearest[place], distance, is_front,
                             tree, slot, results))
        return;
    bundle->slots[place] = slot;
    bundle->n_new++;
}

/* Test the rays from a place on against a triangle. */
static inline void test_lanes(
    const struct bundle *bundle, int first, const double triangle[9], struct tests *tests)
{
    const double ax = triangle[0], ay = triangle[1], az = triangle[2];
    const double bx = triangle[3], by = triangle[4], bz = triangle[5];
    const double cx = triangle[6], cy = triangle[7], cz = triangle[8];
    const double *restrict ox = bundle->x + first, *restrict oy = bundle->y + first;
    const double *restrict oz = bundle->z + first, *restrict along = bundle->along + first;
    const double *restrict sx = bundle->slope_x + first, *restrict sy = bundle->slope_y + first;
    double *restrict least = tests->least[tests->n], *restrict most = tests->most[tests->n];
    double *restrict distances = tests->distances[tests->n];
#pragma GCC unroll 1 /* or else it is no loop any more when it comes to be vectorized */
    for (int k = 0; k < LANES; k++) {
        const double pz = az - oz[k], qz = bz - oz[k], rz = cz - oz[k];
        const double px = ax - ox[k] - sx[k] * pz, py = ay - oy[k] - sy[k] * pz;
        const double qx = bx - ox[k] - sx[k] * qz, qy = by - oy[k] - sy[k] * qz;
        const double rx = cx - ox[k] - sx[k] * rz, ry = cy - oy[k] - sy[k] * rz;
        const double u = rx * qy - ry * qx, v = px * ry - py * rx, w = qx * py - qy * px;
        least[k] = min_f64(min_f64(u, v), w);
        most[k] = max_f64(max_f64(u, v), w);
        distances[k] = (u * pz + v * qz + w * rz) / ((u + v + w) * along[k]);
    }
    tests->places[tests->n++] = first;
}

/* Test the rays of some columns and rows against one triangle of a leaf. Those for which rounding
   could matter are tested again, exactly. */
static void test_triangle(
    struct bundle *bundle, const int columns[2], const int rows[2], const struct ray_tree *tree,
    const leaf corners, int64_t slot, const struct results *results)
{
    const double doubt = bundle->doubt;
    double triangle[9];
    for (int c = 0; c < 3; c++)
        for (int axis = 0; axis < 3; axis++)
            triangle[3 * c + axis] = corners[3 * c + bundle->order[axis]][slot % WIDTH];
    struct tests tests;
    tests.n = 0;
    for (int row = rows[0]; row <= rows[1]; row++)
        for (int column = columns[0]; column <= columns[1]; column += LANES)
            test_lanes(bundle, row * SIDE + column, triangle, &tests);
    const double *least = tests.least[0], *most = tests.most[0], *distances = tests.distances[0];
    int chosen[RAYS], n = 0;
    for (int j = 0; j < tests.n * LANES; j++) { /* without a jump, which would be predicted badly */
        chosen[n] = j;
        n += !((least[j] < -doubt) & (most[j] > doubt));
    }
    for (int i = 0; i < n; i++) {
        const int j = chosen[i], place = tests.places[j / LANES] + j % LANES;
        if (least[j] > doubt || most[j] < -doubt) {
            keep_hit(bundle, place, distances[j], least[j] > doubt, tree, slot, results);
            continue;
        }
        const struct ray_line line = line_at(bundle, place);
        const struct crossing hit = intersect(&line, bundle->order, corners, slot % WIDTH);
        if (hit.total != 0.0)
            keep_hit(bundle, place, hit.distance, hit.total > 0.0, tree, slot, results);
    }
}

/* What an axis is at depths `near` and `far` of a leaf: where the rays of a place can be, and how many
   places one is. */
struct section {
    double above[2], below[2], places[2];
};

static inline struct section cut(const struct axis *axis, double near, double far)
{
    return (struct section){
        {at_depth(&axis->above, near), at_depth(&axis->above, far)},
        {at_depth(&axis->below, near), at_depth(&axis->below, far)},
        {1.0 / at_depth(&axis->step, near), 1.0 / at_depth(&axis->step, far)}};
}

/* First and last place along an axis of the rays that can meet each of eight triangles; the first is
   greater where none can. */
static inline void find_ranges(
    const struct axis *axis, const double corners[9][WIDTH], const int order[3], double near,
    double far, int last, int firsts[WIDTH], int lasts[WIDTH])
{
    const double *restrict p[9];
    for (int row = 0; row < 9; row++)
        p[row] = corners[row - row % 3 + order[row % 3]];
    const double x = axis->vector[0], y = axis->vector[1], z = axis->vector[2];
    const struct section at = cut(axis, near, far);
    const double end = last;
    for (int k = 0; k < WIDTH; k++) {
        const double a = x * p[0][k] + y * p[1][k] + z * p[2][k];
        const double b = x * p[3][k] + y * p[4][k] + z * p[5][k];
        const double c = x * p[6][k] + y * p[7][k] + z * p[8][k];
        const double low = min_f64(min_f64(a, b), c), high = max_f64(max_f64(a, b), c);
        const double first = min_f64(
            (low - at.above[0]) * at.places[0], (low - at.above[1]) * at.places[1]);
        const double final = max_f64(
            (high - at.below[0]) * at.places[0], (high - at.below[1]) * at.places[1]);
        /* Both are clamped to just outside the places before they become integers. */
        firsts[k] = (int)ceil(min_f64(max_f64(first, 0.0), SIDE));
        lasts[k] = (int)floor(max_f64(min_f64(final, end), -1.0));
    }
}

/* Test the triangles of a leaf that lies between two depths. */
static void test_leaf(
    struct bundle *bundle, const struct ray_tree *tree, int64_t at, double near, double far,
    const struct results *results)
{
    leaf scratch;
    const double (*corners)[WIDTH] = corners_of(tree, at, scratch);
    near = max_f64(near, bundle->planes[0]);
    far = max_f64(min_f64(far, bundle->planes[1]), near);
    int left[WIDTH], right[WIDTH], top[WIDTH], bottom[WIDTH], chosen[WIDTH], n = 0;
    find_ranges(
        &bundle->across, corners, bundle->order, near, far, bundle->n_columns - 1, left, right);
    find_ranges(&bundle->down, corners, bundle->order, near, far, bundle->n_rows - 1, top, bottom);
    for (int k = 0; k < WIDTH; k++) {
        chosen[n] = k;
        n += (left[k] <= right[k]) & (top[k] <= bottom[k]);
    }
    for (int j = 0; j < n; j++) {
        const int k = chosen[j], columns[2] = {left[k], right[k]}, rows[2] = {top[k], bottom[k]};
        test_triangle(bundle, columns, rows, tree, corners, at * WIDTH + k, results);
    }
}

/* The bounds of a bundle in float32, with slack for the rounding of the walk. */
struct beam {
    float planes[2];
    float vectors[2][3];
    float low[2][2], high[2][2]; /* of each axis: at depth 0, and the slope */
    int near[2][3], far[2][3];   /* rows of a node where the axis is least and greatest */
};

static void bound_walk(const struct bundle *bundle, struct beam *beam)
{
    const struct axis *axes[2] = {&bundle->across, &bundle->down};
    for (int a = 0; a < 2; a++) {
        const struct axis *axis = axes[a];
        double size = fabs(axis->below.at_zero) + fabs(axis->high.at_zero) +
                      fabs(axis->below.slope) + fabs(axis->high.slope);
        for (int k = 0; k < 3; k++) {
            const bool grows = axis->vector[k] > 0.0;
            beam->vectors[a][k] = (float)axis->vector[k];
            beam->near[a][k] = bundle->order[k] + (grows ? 0 : 3);
            beam->far[a][k] = bundle->order[k] + (grows ? 3 : 0);
            size += fabs(axis->vector[k]);
        }
        beam->low[a][0] = (float)(axis->below.at_zero - FLOAT_SLACK * size);
        beam->low[a][1] = (float)axis->below.slope;
        beam->high[a][0] = (float)(axis->high.at_zero + FLOAT_SLACK * size);
        beam->high[a][1] = (float)axis->high.slope;
    }
    beam->planes[0] = (float)(bundle->planes[0] - FLOAT_SLACK);
    beam->planes[1] = (float)(bundle->planes[1] + FLOAT_SLACK);
}

/* Which of the boxes of a node the beam can meet, as bits. */
static inline unsigned beam_meets(const struct beam *beam, const node boxes, int z)
{
    int32_t hit[WIDTH];
    for (int k = 0; k < WIDTH; k++) {
        const float near = max_f32(beam->planes[0], boxes[z][k]);
        const float far = min_f32(beam->planes[1], boxes[3 + z][k]);
        hit[k] = near <= far;
        for (int a = 0; a < 2; a++) {
            const float *vector = beam->vectors[a];
            const float least = vector[0] * boxes[beam->near[a][0]][k] +
                                vector[1] * boxes[beam->near[a][1]][k] +
                                vector[2] * boxes[beam->near[a][2]][k];
            const float most = vector[0] * boxes[beam->far[a][0]][k] +
                               vector[1] * boxes[beam->far[a][1]][k] +
                               vector[2] * boxes[beam->far[a][2]][k];
            const float *low = beam->low[a], *high = beam->high[a];
            hit[k] &= least <= max_f32(high[0] + high[1] * near, high[0] + high[1] * far);
            hit[k] &= most >= min_f32(low[0] + low[1] * near, low[0] + low[1] * far);
        }
    }
    unsigned bits = 0;
    for (int k = 0; k < WIDTH; k++)
        bits |= (unsigned)hit[k] << k;
    return bits;
}

/* Depth beyond which no ray of the bundle goes any more, now that some have hit. */
static void update_far(struct bundle *bundle)
{
    double far[SIDE];
    for (int k = 0; k < SIDE; k++)
        far[k] = -1e300;
    for (int row = 0; row < bundle->n_rows; row++)
        for (int k = 0; k < SIDE; k++) {
            const int place = row * SIDE + k;
            const double start = bundle->descending ? -bundle->z[place] : bundle->z[place];
            const double gone = min_f64(bundle->lengths[place], bundle->nearest[place]);
            const double end = start + fabs(bundle->along[place]) * gone;
            far[k] = max_f64(far[k], end - bundle->holes[place]);
        }
    bundle->far = greatest_of(far) + APART;
    bundle->n_new = 0;
}

/* A ray that is cast alone. */
struct alone {
    struct walk walk;
    double length;
    int64_t i;
    int64_t slot; /* of the hit found in this call, or NO_HIT */
};

static void start_alone(
    struct alone *alone, int64_t i, const struct ray_tree *tree, const struct rays *rays)
{
    const double *o = rays->origins[i], *d = rays->directions[i], length = rays->lengths[i];
    const struct single_ray ray = {{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, length};
    start_walk(&alone->walk, tree, &ray);
    alone->length = length;
    alone->i = i;
    alone->slot = NO_HIT;
}

/* Where a ray ends, or where it has hit something. */
static inline float end_of(const struct alone *alone, const struct results *results)
{
    return lengthened(min_f64(alone->length, results->nearest[alone->i]));
}

/* Test the triangles of a leaf against a ray. */
static inline void test_alone(
    struct alone *alone, int64_t at, const leaf corners, const struct ray_tree *tree,
    const struct results *results)
{
    const struct walk *walk = &alone->walk;
    for (unsigned bits = may_cross(walk, corners); bits; bits &= bits - 1) {
        const int k = __builtin_ctz(bits);
        const int64_t slot = at * WIDTH + k;
        const struct crossing hit = intersect(&walk->line, walk->order, corners, k);
        if (hit.total != 0.0 &&
            is_nearest(alone->i, alone->length, &results->nearest[alone->i], hit.distance,
                       hit.total > 0.0, tree, slot, results))
            alone->slot = slot;
    }
}

#define MOST_LEAVES 128

/* Rays that diverge, and leaves to test against them. */
struct batch {
    struct alone rays[RAYS];
    int n_leaves;
    int64_t leaves[MOST_LEAVES];
    const double (*corners[MOST_LEAVES])[WIDTH]; /* of the leaves; NULL where no ray came by yet */
    leaf scratch[MOST_LEAVES];
    node boxes[MOST_LEAVES / WIDTH]; /* of the leaves; empty ones after the last */
};

static void add_leaf(struct batch *batch, const struct ray_tree *tree, int64_t at)
{
    const int k = batch->n_leaves % WIDTH;
    float (*boxes)[WIDTH] = batch->boxes[batch->n_leaves / WIDTH];
    for (int row = 0; row < 6; row++) {
        if (k == 0)
            for (int empty = 0; empty < WIDTH; empty++)
                boxes[row][empty] = row < 3 ? INFINITY : -INFINITY;
        boxes[row][k] = tree->levels[0][at / WIDTH][row][at % WIDTH];
    }
    batch->corners[batch->n_leaves] = NULL;
    batch->leaves[batch->n_leaves++] = at;
}

/* Test the first rays of a batch against its leaves, which are then removed. */
static void test_batch(
    struct batch *batch, int n, const struct ray_tree *tree, const struct results *results)
{
    for (int i = 0; i < n; i++) {
        struct alone *alone = &batch->rays[i];
        for (int first = 0; first < batch->n_leaves; first += WIDTH) {
            float nears[WIDTH];
            unsigned bits = meets(
                &alone->walk, batch->boxes[first / WIDTH], end_of(alone, results), nears);
            for (; bits; bits &= bits - 1) {
                const int k = __builtin_ctz(bits), j = first + k;
                if (!(nears[k] <= end_of(alone, results)))
                    continue;
                if (!batch->corners[j])
                    batch->corners[j] = corners_of(tree, batch->leaves[j], batch->scratch[j]);
                test_alone(alone, batch->leaves[j], batch->corners[j], tree, results);
            }
        }
    }
    batch->n_leaves = 0;
}

/* Ask for the memory of a node, or of a leaf below level 0, or of what its corners are loaded from,
   before it is needed. */
static inline void fetch_early(const struct ray_tree *tree, int level, int64_t at)
{
    if (level < 0 && tree->leaves) {
        for (size_t row = 0; row < 9; row++)
            __builtin_prefetch(tree->leaves[at][row]);
        return;
    }
    if (level < 0) {
        for (int k = 0; k < WIDTH && tree->ids[at][k] >= 0; k++)
            __builtin_prefetch(tree->mesh.faces[tree->ids[at][k] - tree->mesh.first]);
        return;
    }
    const char *first = (const char *)tree->levels[level][at];
    for (size_t line = 0; line < sizeof(node); line += 64)
        __builtin_prefetch(first + line);
    if (level == 0)
        for (int k = 0; k < WIDTH; k += 2)
            __builtin_prefetch(tree->ids + at * WIDTH + k);
}

/* Walk the tree, the nearer boxes first. With a batch, its rays are tested against the leaves, some
   leaves at a time; the last ones are left in it. */
static void walk_tree(
    struct bundle *bundle, struct batch *batch, const struct ray_tree *tree,
    const struct results *results)
{
    struct beam beam;
    bound_walk(bundle, &beam);
    const int z = bundle->order[2];
    struct { int level; int64_t at; float near, low, high; } stack[STACK];
    int depth = 1;
    stack[0].level = tree->n_levels - 1;
    stack[0].at = 0;
    stack[0].near = -INFINITY;
    while (depth > 0) {
        depth--;
        const int level = stack[depth].level;
        const int64_t at = stack[depth].at;
        if (stack[depth].near > bundle->far)
            continue;
        if (level < 0) {
            if (!batch) {
                test_leaf(bundle, tree, at, stack[depth].low, stack[depth].high, results);
                continue;
            }
            add_leaf(batch, tree, at);
            if (batch->n_leaves == MOST_LEAVES) {
                test_batch(batch, bundle->n, tree, results);
                for (int place = 0; place < bundle->n_rows * SIDE; place++)
                    if (bundle->rays[place] != NO_HIT)
                        bundle->nearest[place] = results->nearest[bundle->rays[place]];
                update_far(bundle);
            }
            continue;
        }
        if (bundle->n_new > bundle->n / 2)
            update_far(bundle);
        const float (*boxes)[WIDTH] = tree->levels[level][at];
        unsigned bits = beam_meets(&beam, boxes, z);
        const int bottom = depth;
        for (; bits; bits &= bits - 1) {
            const int k = __builtin_ctz(bits);
            const float near = bundle->descending ? -boxes[3 + z][k] : boxes[z][k];
            int place = depth++;
            for (; place > bottom && stack[place - 1].near < near; place--)
                stack[place] = stack[place - 1];
            fetch_early(tree, level - 1, at * WIDTH + k);
            stack[place].level = level - 1;
            stack[place].at = at * WIDTH + k;
            stack[place].near = near;
            stack[place].low = boxes[z][k];
            stack[place].high = boxes[3 + z][k];
        }
    }
}

/* How two coordinates of the rays, halfway along, change from column to column and row to row. */
static void fit_steps(const struct bundle *bundle, double across[2], double down[2])
{
    const double z = 0.5 * (bundle->planes[0] + bundle->planes[1]), n = bundle->n / bundle->fitted;
    double c[SIDE] = {0}, r[SIDE] = {0}, x[SIDE] = {0}, y[SIDE] = {0}, cc[SIDE] = {0}, rr[SIDE] = {0};
    double cr[SIDE] = {0}, cx[SIDE] = {0}, cy[SIDE] = {0}, rx[SIDE] = {0}, ry[SIDE] = {0};
    /* Relative to one of the rays, so that the sums of products lose no digits. */
    const double middle_x = bundle->middle[0], middle_y = bundle->middle[1];
    for (int row = 0; row < bundle->n_rows; row += bundle->fitted) {
        const double at_row = row;
        for (int k = 0; k < SIDE; k++) {
            const int place = row * SIDE + k;
            const double weight = bundle->weights[place], far = z - bundle->z[place];
            const double at_x =
                weight * (bundle->x[place] + bundle->slope_x[place] * far - middle_x);
            const double at_y =
                weight * (bundle->y[place] + bundle->slope_y[place] * far - middle_y);
            const double column = weight * COLUMNS[k];
            c[k] += column, r[k] += weight * at_row, x[k] += at_x, y[k] += at_y;
            cc[k] += column * COLUMNS[k], rr[k] += weight * at_row * at_row;
            cr[k] += column * at_row;
            cx[k] += COLUMNS[k] * at_x, cy[k] += COLUMNS[k] * at_y;
            rx[k] += at_row * at_x, ry[k] += at_row * at_y;
        }
    }
    const double mean_c = sum_of(c) / n, mean_r = sum_of(r) / n;
    const double mean_x = sum_of(x) / n, mean_y = sum_of(y) / n;
    const double all_cc = sum_of(cc) - n * mean_c * mean_c + 1e-9;
    const double all_rr = sum_of(rr) - n * mean_r * mean_r + 1e-9;
    const double all_cr = sum_of(cr) - n * mean_c * mean_r;
    const double all_cx = sum_of(cx) - n * mean_c * mean_x, all_rx = sum_of(rx) - n * mean_r * mean_x;
    const double all_cy = sum_of(cy) - n * mean_c * mean_y, all_ry = sum_of(ry) - n * mean_r * mean_y;
    const double determinant = all_cc * all_rr - all_cr * all_cr;
    across[0] = (all_rr * all_cx - all_cr * all_rx) / determinant;
    across[1] = (all_rr * all_cy - all_cr * all_ry) / determinant;
    down[0] = (all_cc * all_rx - all_cr * all_cx) / determinant;
    down[1] = (all_cc * all_ry - all_cr * all_cy) / determinant;
}

/* Choose the vectors of both axes: each grows by one from place to place along its own axis, halfway
   along the rays, and is constant along the other axis and along the rays. */
static void choose_axes(struct bundle *bundle)
{
    double across[2], down[2], mean_x = 0.0, mean_y = 0.0;
    fit_steps(bundle, across, down);
    const double width = sqrt(across[0] * across[0] + across[1] * across[1]);
    const double height = sqrt(down[0] * down[0] + down[1] * down[1]);
    double determinant = across[0] * down[1] - across[1] * down[0];
    /* In one line, or all from one point: any other axis will do. */
    if (!(fabs(determinant) > 1e-3 * width * height)) {
        const double least = 1e-9;
        if (width >= height) {
            if (width < least)
                across[0] = 1e-3, across[1] = 0.0;
            down[0] = -across[1], down[1] = across[0];
        } else {
            if (height < least)
                down[0] = 0.0, down[1] = 1e-3;
            across[0] = down[1], across[1] = -down[0];
        }
        determinant = across[0] * down[1] - across[1] * down[0];
    }
    for (int place = 0; place < bundle->n_rows * SIDE; place++) {
        mean_x += bundle->slope_x[place]; /* 0 where there is no ray */
        mean_y += bundle->slope_y[place];
    }
    mean_x /= bundle->n, mean_y /= bundle->n;
    double *vector = bundle->across.vector;
    vector[0] = down[1] / determinant;
    vector[1] = -down[0] / determinant;
    vector[2] = -(vector[0] * mean_x + vector[1] * mean_y);
    vector = bundle->down.vector;
    vector[0] = -across[1] / determinant;
    vector[1] = across[0] / determinant;
    vector[2] = -(vector[0] * mean_x + vector[1] * mean_y);
}

/* Write what an axis is at a plane, for the rays of a row. */
static inline void value_row(
    const struct bundle *bundle, const struct axis *axis, double plane, int row, double values[SIDE])
{
    const double *restrict x = bundle->x + row * SIDE, *restrict y = bundle->y + row * SIDE;
    const double *restrict z = bundle->z + row * SIDE;
    const double *restrict slope_x = bundle->slope_x + row * SIDE;
    const double *restrict slope_y = bundle->slope_y + row * SIDE;
    const double to_x = axis->vector[0], to_y = axis->vector[1], base = axis->vector[2] * plane;
    for (int k = 0; k < SIDE; k++) {
        const double along = plane - z[k];
        values[k] = to_x * (x[k] + slope_x[k] * along) + to_y * (y[k] + slope_y[k] * along) + base;
    }
}

/* The step and base of the line that fits an axis at the rays best, as a function of the column or
   row. */
static void fit_line(
    const struct bundle *bundle, const struct axis *axis, double plane, bool is_row, double fit[2],
    double *mean_place)
{
    double sums[SIDE] = {0}, ats[SIDE] = {0}, squares[SIDE] = {0}, both[SIDE] = {0}, places[SIDE];
    memcpy(places, COLUMNS, sizeof places);
    for (int row = 0; row < bundle->n_rows; row += bundle->fitted) {
        const double *restrict weights = bundle->weights + row * SIDE;
        double some[SIDE];
        value_row(bundle, axis, plane, row, some);
        if (is_row)
            for (int k = 0; k < SIDE; k++)
                places[k] = row;
        for (int k = 0; k < SIDE; k++) {
            const double at = weights[k] * places[k];
            sums[k] += weights[k] * some[k];
            ats[k] += at;
            squares[k] += at * places[k];
            both[k] += at * some[k];
        }
    }
    const double n = bundle->n / bundle->fitted, mean = sum_of(ats) / n;
    const double spread = sum_of(squares) - n * mean * mean;
    fit[0] = spread > 1e-6 ? (sum_of(both) - sum_of(sums) * mean) / spread : 1.0;
    fit[1] = sum_of(sums) / n - fit[0] * mean;
    *mean_place = mean;
}

/* Greatest deviation of an axis at the rays from what follows the places. */
static double deviation_of(
    const struct bundle *bundle, const struct axis *axis, double plane, bool is_row, double base,
    double step)
{
    double greatest[SIDE] = {0}, expected[SIDE];
    for (int k = 0; k < SIDE; k++)
        expected[k] = base + step * COLUMNS[k];
    for (int row = 0; row < bundle->n_rows; row++) {
        const double *restrict weights = bundle->weights + row * SIDE;
        double some[SIDE];
        value_row(bundle, axis, plane, row, some);
        if (is_row)
            for (int k = 0; k < SIDE; k++)
                expected[k] = base + step * row;
        for (int k = 0; k < SIDE; k++)
            greatest[k] = max_f64(greatest[k], weights[k] * fabs(some[k] - expected[k]));
    }
    return greatest_of(greatest);
}

/* Measure how an axis follows the places, at both planes. */
static void measure_axis(const struct bundle *bundle, struct axis *axis, bool is_row)
{
    const double *vector = axis->vector, *planes = bundle->planes;
    double fit[2][2], off[2], mean;
    for (int p = 0; p < 2; p++)
        fit_line(bundle, axis, planes[p], is_row, fit[p], &mean);
    const double size = fabs(vector[0]) + fabs(vector[1]) + fabs(vector[2]);
    /* Where the rays cross each other, a step that is too great only makes the deviation so. */
    const double least = 0.02 * max_f64(max_f64(fit[0][0], fit[1][0]), 1e-3);
    for (int p = 0; p < 2; p++) {
        const double step = max_f64(fit[p][0], least);
        fit[p][1] += (fit[p][0] - step) * mean;
        fit[p][0] = step;
        off[p] = deviation_of(bundle, axis, planes[p], is_row, fit[p][1], step) + 1e-6 +
                 1e-11 * (size + fabs(fit[p][1]));
    }
    const int last = (is_row ? bundle->n_rows : bundle->n_columns) - 1;
    axis->deviation = max_f64(off[0] / fit[0][0], off[1] / fit[1][0]) / (last + 1);
    axis->step = line_through(planes, fit[0][0], fit[1][0]);
    axis->below = line_through(planes, fit[0][1] - off[0], fit[1][1] - off[1]);
    axis->above = line_through(planes, fit[0][1] + off[0], fit[1][1] + off[1]);
    axis->high.at_zero = axis->above.at_zero + axis->step.at_zero * last;
    axis->high.slope = axis->above.slope + axis->step.slope * last;
}

/* Write the weights and the distance of a hit, by Cramer's rule. A triangle seen so edge-on that the
   determinant vanishes keeps those of the test. */
static void refine(
    int64_t i, int64_t slot, const struct ray_line *line, const int order[3],
    const struct ray_tree *tree, const struct rays *rays, const struct results *results)
{
    const int k = (int)(slot % WIDTH);
    leaf corners;
    load_corners(&tree->mesh, tree->ids[slot / WIDTH], k, k + 1, corners);
    const double ax = corners[0][k], ay = corners[1][k], az = corners[2][k];
    const double bx = corners[3][k] - ax, by = corners[4][k] - ay, bz = corners[5][k] - az;
    const double cx = corners[6][k] - ax, cy = corners[7][k] - ay, cz = corners[8][k] - az;
    const double *d = rays->directions[i], *o = rays->origins[i];
    const double dx = d[0], dy = d[1], dz = d[2], ox = o[0] - ax, oy = o[1] - ay, oz = o[2] - az;
    /* n = b x c and q = d x o; Cramer's rule on o + t d = u b + v c */
    const double nx = by * cz - bz * cy, ny = bz * cx - bx * cz, nz = bx * cy - by * cx;
    const double qx = dy * oz - dz * oy, qy = dz * ox - dx * oz, qz = dx * oy - dy * ox;
    const double slope = -(dx * nx + dy * ny + dz * nz);
    if (fabs(slope) <= 1e-12 * (fabs(nx) + fabs(ny) + fabs(nz))) {
        const struct crossing hit = intersect(line, order, corners, k);
        results->barycentrics[i][0] = hit.second / hit.total;
        results->barycentrics[i][1] = hit.third / hit.total;
        results->distances[i] = hit.distance;
        return;
    }
    double u = -(qx * cx + qy * cy + qz * cz) / slope;
    double v = (qx * bx + qy * by + qz * bz) / slope;
    /* Inside according to the test, so it can only be outside by rounding. */
    u = min_f64(max_f64(u, 0.0), 1.0);
    v = min_f64(max_f64(v, 0.0), 1.0 - u);
    results->barycentrics[i][0] = u;
    results->barycentrics[i][1] = v;
    results->distances[i] = (u * bx + v * cx - ox) * dx + (u * by + v * cy - oy) * dy +
                            (u * bz + v * cz - oz) * dz;
}

/* Rays from farther away, or longer directions, would overflow in the sums over a bundle, which the
   other rays of it share. */
#define FARTHEST 1e30

/* The axis along which a ray goes farthest, and whether it goes down, as one number; -1 for a ray
   that goes nowhere, or that is not finite: it hits nothing. */
static int heading(const struct rays *rays, int64_t i)
{
    if (!(rays->lengths[i] > 0.0))
        return -1;
    const double *d = rays->directions[i], *o = rays->origins[i];
    for (int axis = 0; axis < 3; axis++)
        if (!(fabs(o[axis]) < FARTHEST && fabs(d[axis]) < FARTHEST))
            return -1;
    int z = 0;
    for (int axis = 1; axis < 3; axis++)
        if (fabs(d[axis]) > fabs(d[z]))
            z = axis;
    return 2 * z + (d[z] < 0.0);
}

/* Leave places of a bundle empty, with numbers that loops over all of them can compute with. */
static void clear_places(struct bundle *bundle, int first, int end)
{
    for (int place = first; place < end; place++) {
        bundle->rays[place] = NO_HIT;
        bundle->slots[place] = NO_HIT;
        bundle->x[place] = bundle->y[place] = bundle->z[place] = 0.0;
        bundle->slope_x[place] = bundle->slope_y[place] = 0.0;
        bundle->along[place] = 1.0;
        bundle->lengths[place] = bundle->nearest[place] = bundle->weights[place] = 0.0;
        bundle->holes[place] = 1e300;
    }
}

/* Load rays, from one on, into the places from one on. */
static void load_rays(
    struct bundle *bundle, int place, int64_t i, int n, const struct rays *rays, const double *nearest)
{
    const double *restrict ox = rays->origins[i] + bundle->order[0];
    const double *restrict oy = rays->origins[i] + bundle->order[1];
    const double *restrict oz = rays->origins[i] + bundle->order[2];
    const double *restrict dx = rays->directions[i] + bundle->order[0];
    const double *restrict dy = rays->directions[i] + bundle->order[1];
    const double *restrict dz = rays->directions[i] + bundle->order[2];
    double *restrict x = bundle->x + place, *restrict y = bundle->y + place;
    double *restrict z = bundle->z + place, *restrict along = bundle->along + place;
    double *restrict slope_x = bundle->slope_x + place, *restrict slope_y = bundle->slope_y + place;
    for (int k = 0; k < n; k++) {
        x[k] = ox[3 * k], y[k] = oy[3 * k], z[k] = oz[3 * k];
        along[k] = dz[3 * k];
        slope_x[k] = dx[3 * k] / dz[3 * k];
        slope_y[k] = dy[3 * k] / dz[3 * k];
    }
    memcpy(bundle->lengths + place, rays->lengths + i, (size_t)n * sizeof(double));
    memcpy(bundle->nearest + place, nearest + i, (size_t)n * sizeof(double));
    for (int k = 0; k < n; k++) {
        bundle->rays[place + k] = (int)i + k;
        bundle->slots[place + k] = NO_HIT;
        bundle->weights[place + k] = 1.0;
        bundle->holes[place + k] = 0.0;
    }
}

/* Planes between which the rays run within the box of the triangles, and how uncertain an edge can be.
   False where the rays do not reach the box. */
static bool place_planes(struct bundle *bundle, const struct ray_tree *tree)
{
    const int z = bundle->order[2];
    double low[SIDE], sideways[SIDE] = {0};
    for (int k = 0; k < SIDE; k++)
        low[k] = 1e300;
    for (int row = 0; row < bundle->n_rows; row++)
        for (int k = 0; k < SIDE; k++) {
            const int place = row * SIDE + k;
            const double start = bundle->descending ? -bundle->z[place] : bundle->z[place];
            const double x = fabs(bundle->x[place] - bundle->slope_x[place] * bundle->z[place]);
            const double y = fabs(bundle->y[place] - bundle->slope_y[place] * bundle->z[place]);
            low[k] = min_f64(low[k], start + bundle->holes[place]);
            sideways[k] = max_f64(sideways[k], max_f64(x, y));
        }
    /* A corner is at most this far from a ray, along x or y; a product is at most its square, and the
       sign of a difference of two is certain beyond 4 roundings of each. */
    const double reach = greatest_of(sideways) + 2.0 * tree->size, first = least_of(low);
    bundle->doubt = 1e-15 * reach * reach;
    update_far(bundle);
    const double start = bundle->descending ? -bundle->far : first;
    const double end = bundle->descending ? -first : bundle->far;
    bundle->planes[0] = max_f64(start, tree->box[z]) - APART;
    bundle->planes[1] = min_f64(end, tree->box[3 + z]) + APART;
    return bundle->planes[0] < bundle->planes[1];
}

/* Place and load rays of one heading. */
static void load_bundle(
    struct bundle *bundle, int64_t n, int64_t *chosen, const struct rays *rays,
    const double *nearest, int places[RAYS])
{
    bool taken[RAYS] = {false};
    bundle->n = (int)n;
    bundle->n_columns = bundle->n_rows = 0;
    for (int64_t k = 0; k < n; k++) {
        places[k] = (rays->places[chosen[k]][1] & (SIDE - 1)) * SIDE +
                    (rays->places[chosen[k]][0] & (SIDE - 1));
        while (taken[places[k]]) /* two rays in one place: the next that is free */
            places[k] = (places[k] + 1) % RAYS;
        taken[places[k]] = true;
        const int column = places[k] % SIDE, row = places[k] / SIDE;
        bundle->n_columns = column < bundle->n_columns ? bundle->n_columns : column + 1;
        bundle->n_rows = row < bundle->n_rows ? bundle->n_rows : row + 1;
    }
    const int end = bundle->n_rows * SIDE;
    clear_places(bundle, n < end ? 0 : end, end + LANES);
    for (int64_t k = 0, next; k < n; k = next) {
        for (next = k + 1; next < n; next++)
            if (places[next] != places[next - 1] + 1 || chosen[next] != chosen[next - 1] + 1)
                break;
        load_rays(bundle, places[k], chosen[k], (int)(next - k), rays, nearest);
    }
    bundle->fitted = n == RAYS ? 4 : 1;
}

/* Write the weights and the distance of the hit of a ray that was cast alone. */
static void refine_alone(
    const struct alone *alone, const struct ray_tree *tree, const struct rays *rays,
    const struct results *results)
{
    const struct walk *walk = &alone->walk;
    if (alone->slot != NO_HIT)
        refine(alone->i, alone->slot, &walk->line, walk->order, tree, rays, results);
}

/* Cast a ray that has no neighbors. */
static void cast_alone(
    int64_t i, const struct ray_tree *tree, const struct rays *rays, const struct results *results)
{
    struct alone alone;
    start_alone(&alone, i, tree, rays);
    struct place stack[STACK];
    stack[0] = (struct place){tree->n_levels - 1, 0, 0.0f};
    for (int depth = 1; depth > 0;) {
        const struct place place = stack[--depth];
        const float end = end_of(&alone, results);
        if (place.near > end)
            continue;
        if (place.level >= 0)
            depth = push_nearest(&alone.walk, tree, place, end, stack, depth);
        else {
            leaf scratch;
            test_alone(&alone, place.at, corners_of(tree, place.at, scratch), tree, results);
        }
    }
    refine_alone(&alone, tree, rays, results);
}

/* Cast the rays of a bundle one by one. */
static void cast_batch(
    int64_t n, const int64_t *chosen, const struct ray_tree *tree, const struct rays *rays,
    const struct results *results, struct bundle *bundle, struct batch *batch)
{
    batch->n_leaves = 0;
    for (int64_t k = 0; k < n; k++)
        start_alone(&batch->rays[k], chosen[k], tree, rays);
    walk_tree(bundle, batch, tree, results);
    test_batch(batch, (int)n, tree, results);
    for (int64_t k = 0; k < n; k++)
        refine_alone(&batch->rays[k], tree, rays, results);
}

/* Cast up to RAYS rays of one heading. `bundle` and `batch` are scratch memory. */
static void cast_bundle(
    int64_t n, int64_t *chosen, int direction, const struct ray_tree *tree,
    const struct rays *rays, const struct results *results, struct bundle *bundle,
    struct batch *batch)
{
    const int z = direction / 2, next = (z + 1) % 3, other = (z + 2) % 3;
    bundle->descending = direction % 2;
    /* Exchanged where z descends, which preserves the winding. */
    bundle->order[0] = bundle->descending ? other : next;
    bundle->order[1] = bundle->descending ? next : other;
    bundle->order[2] = z;
    int places[RAYS];
    load_bundle(bundle, n, chosen, rays, results->nearest, places);
    if (!place_planes(bundle, tree))
        return;
    const double halfway = 0.5 * (bundle->planes[0] + bundle->planes[1]) - bundle->z[places[0]];
    bundle->middle[0] = bundle->x[places[0]] + bundle->slope_x[places[0]] * halfway;
    bundle->middle[1] = bundle->y[places[0]] + bundle->slope_y[places[0]] * halfway;
    choose_axes(bundle);
    measure_axis(bundle, &bundle->across, false);
    measure_axis(bundle, &bundle->down, true);
    if (!(max_f64(bundle->across.deviation, bundle->down.deviation) <= DIVERGENT)) {
        cast_batch(n, chosen, tree, rays, results, bundle, batch);
        return;
    }
    walk_tree(bundle, NULL, tree, results);
    for (int64_t k = 0; k < n; k++) {
        results->nearest[chosen[k]] = bundle->nearest[places[k]];
        if (bundle->slots[places[k]] >= 0) {
            const struct ray_line line = line_at(bundle, places[k]);
            refine(chosen[k], bundle->slots[places[k]], &line, bundle->order, tree, rays, results);
        }
    }
}

/* Cast rays that stand together, in one bundle for each chart and heading. */
static void cast_together(
    int64_t first, int64_t end, const struct ray_tree *tree, const struct rays *rays,
    const struct results *results, struct bundle *bundle, struct batch *batch)
{
    int headings[RAYS];
    for (int64_t i = first; i < end; i++)
        headings[i - first] = heading(rays, i);
    for (int64_t i = first; i < end; i++) {
        const int direction = headings[i - first];
        if (direction < 0)
            continue;
        int64_t chosen[RAYS], n = 0;
        for (int64_t j = i; j < end; j++)
            if (headings[j - first] == direction && rays->charts[j] == rays->charts[i]) {
                headings[j - first] = -1;
                chosen[n++] = j;
            }
        if (n > 1)
            cast_bundle(n, chosen, direction, tree, rays, results, bundle, batch);
        else
            cast_alone(i, tree, rays, results);
    }
}

/* Cast rays. Those with `places` and `charts` are of texels (column, row), listed square by square;
   others are cast one by one. `nearest`, `backs` and the other results begin with what other trees
   gave: the distances of the nearest hit and of the nearest back face, as the test has computed them,
   and the hit itself, refined. */
EXPORT int64_t cast_bundles(
    int64_t n, int64_t n_leaves, int64_t n_nodes, int64_t n_levels, int64_t n_vertices,
    int64_t n_faces, const double positions[n_vertices][3], const int32_t mesh_faces[n_faces][3],
    int64_t first_face, const double center[3], double scale, const int32_t ids[n_leaves][8],
    OPTIONAL const double leaves[n_leaves][9][8], const float nodes[n_nodes][6][8],
    const int64_t starts[n_levels], const double box[6],
    const double origins[n][3], const double directions[n][3], const double lengths[n],
    OPTIONAL const int32_t places[n][2], OPTIONAL const int32_t charts[n], bool cull,
    double nearest[n], double backs[n], int32_t faces[n], double barycentrics[n][2],
    double distances[n], bool passed_back[n])
{
    OPEN_ARENA(arena);
    struct bundle *bundle = TAKE(arena, struct bundle, 1); /* too large for the stack of a thread */
    struct batch *batch = TAKE(arena, struct batch, 1);
    struct ray_tree tree = ray_tree_of(nodes, n_levels, starts, box);
    tree.leaves = leaves;
    tree.ids = ids;
    tree.mesh = (struct tree_mesh){positions, mesh_faces, first_face, center, scale};
    const struct rays rays = {origins, directions, lengths, places, charts};
    const struct results results = {cull, nearest, backs, barycentrics, distances, faces};
    for (int64_t i = 0; !places && i < n && n_leaves > 0; i++)
        if (heading(&rays, i) >= 0)
            cast_alone(i, &tree, &rays, &results);
    for (int64_t first = 0, end; places && first < n && n_leaves > 0; first = end) {
        for (end = first + 1; end < n && end - first < RAYS; end++)
            if ((places[end][0] ^ places[first][0]) & -SIDE ||
                (places[end][1] ^ places[first][1]) & -SIDE)
                break;
        cast_together(first, end, &tree, &rays, &results, bundle, batch);
    }
    for (int64_t i = 0; i < n; i++)
        passed_back[i] = backs[i] <= (faces[i] == NO_HIT ? lengths[i] : nearest[i]) && lengths[i] > 0;
    close_arena(arena);
    return 0;
}

/* Write numbers that sort rays so that similar ones follow each other: by where they head, by their
   direction in 8 x 8 steps, and by their middle on a Morton curve. */
EXPORT void sort_keys_of_rays(
    int64_t n, const double origins[n][3], const double directions[n][3], const double lengths[n],
    uint64_t keys[n])
{
    const struct rays rays = {origins, directions, lengths, NULL, NULL};
    for (int64_t i = 0; i < n; i++) {
        const int direction = heading(&rays, i);
        if (direction < 0) {
            keys[i] = UINT64_MAX;
            continue;
        }
        const double *d = directions[i], half = 0.5 * min_f64(lengths[i], 2.0);
        uint64_t key = (uint64_t)direction;
        for (int other = 1; other < 3; other++) {
            const double slope = d[(direction / 2 + other) % 3] / fabs(d[direction / 2]);
            key = key << 3 | (uint64_t)min_f64(4.0 * slope + 4.0, 7.0);
        }
        key <<= 30;
        for (int axis = 0; axis < 3; axis++)
            key |= spread_bits((origins[i][axis] + half * d[axis] + 0.5) * 1024.0) << axis;
        keys[i] = key;
    }
}
