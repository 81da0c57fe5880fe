/* Triangles of polygons, the same whatever corner comes first.

   A polygon is looked at along the axis nearest to its normal, so that no coordinate is rounded, and
   every decision on a side is exact. A quadrilateral is cut along its shorter diagonal, unless only
   the other one lies inside. Of more corners, ears are clipped: the ear with the shortest diagonal
   first. Only corners that do not turn to the left can lie in an ear; a grid holds these, and an ear
   that one of them blocks is tried again once that one is gone.

   Based on: Meisters, "Polygons Have Ears", The American Mathematical Monthly 82(6), 1975; Held,
   "FIST: Fast Industrial-Strength Triangulation of Polygons", Algorithmica 30, 2001; Shewchuk,
   "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", Discrete &
   Computational Geometry 18, 1997 (the sign of an area).

   Called from texbake/mesh/polygons.py. */

#include "arena.h"
#include "core.h"
#include "elementary.h"
#include "numbers.h"
#include "vectors.h"

enum { NOBODY = -1, NOWHERE = -2, MOST_CELLS = 1 << 10, FEW = 64 };

struct point {
    double x, y;
};

/* A corner that may be cut off; out of date if the stamp of the corner is another one. */
struct ear {
    double length; /* of the diagonal, squared, in whole steps */
    int32_t corner, stamp;
};

/* What is left of a polygon; its corners are numbered on from its first corner. */
struct ring {
    int32_t n, n_left;
    int64_t start; /* slot of the first corner, counted from that of the file's first one */
    struct point *points;
    struct vector *places;
    double step; /* squares of lengths are rounded to it, so that size and place break no ties */
    int32_t *before, *after, *stamps;
    bool *is_clipped, *is_blocking;
    int32_t *first_waiting; /* of the ears that a corner blocks */
    int32_t *next_waiting;  /* NOBODY behind the last, NOWHERE if an ear does not wait */
    struct point low;
    double cells_x, cells_y; /* cells of the grid a unit */
    int64_t n_cells;         /* along each side */
    int32_t *cell_starts, *cell_corners;
    struct ear *heap;
    int64_t n_ears;
};

/* Add a number to an exact sum of n parts, least first, none 0; return how many parts it has. */
static int add_exactly(int n, double *parts, double number)
{
    int n_kept = 0;
    for (int i = 0; i < n; i++) {
        const struct double_double both = exact_sum(number, parts[i]);
        number = both.high;
        if (both.low != 0.0)
            parts[n_kept++] = both.low;
    }
    if (number != 0.0)
        parts[n_kept++] = number;
    return n_kept;
}

/* Twice the area of a triangle, with the exact sign: positive where it turns to the left. */
static double turn(struct point a, struct point b, struct point c)
{
    const double one = (a.x - c.x) * (b.y - c.y), two = (a.y - c.y) * (b.x - c.x);
    const double area = one - two;
    /* Bound of what the differences, the products and their difference were rounded by. */
    if (fabs(area) > 3.4e-16 * (fabs(one) + fabs(two)))
        return area;
    const double factors[6][2] = {{a.x, b.y}, {-a.y, b.x}, {b.x, c.y},
                                  {-b.y, c.x}, {c.x, a.y}, {-c.y, a.x}};
    double parts[12];
    int n = 0;
    for (int k = 0; k < 6; k++) {
        const struct double_double product = exact_product(factors[k][0], factors[k][1]);
        n = add_exactly(n, parts, product.low);
        n = add_exactly(n, parts, product.high);
    }
    return n > 0 ? parts[n - 1] : 0.0; /* the greatest part has the sign of the sum */
}

static double corner_turn(const struct ring *ring, int32_t corner)
{
    return turn(
        ring->points[ring->before[corner]], ring->points[corner],
        ring->points[ring->after[corner]]);
}

static bool are_same(struct point a, struct point b) { return a.x == b.x && a.y == b.y; }

static double squared_length(const struct ring *ring, int32_t a, int32_t b)
{
    const struct vector along = minus(ring->places[a], ring->places[b]);
    return dot(along, along);
}

/* -1, 0 or 1 as a place comes before, with or after another one, by x, y and z. */
static int compare_places(const double a[3], const double b[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (a[axis] != b[axis])
            return a[axis] < b[axis] ? -1 : 1;
    return 0;
}

/* The corner of the least place, and where several lie there, of the least vertices from there. */
static int64_t first_corner(int64_t n, const double (*positions)[3], const int32_t *vertices)
{
    int64_t first = 0;
    for (int64_t i = 1; i < n; i++) {
        int order = compare_places(positions[vertices[i]], positions[vertices[first]]);
        for (int64_t k = 0; k < 3 && order == 0; k++) {
            const int32_t one = vertices[(first + k) % n], other = vertices[(i + k) % n];
            order = (other > one) - (other < one);
        }
        if (order < 0)
            first = i;
    }
    return first;
}

static double largest_of(const double vector[3])
{
    return max_f64(fabs(vector[0]), max_f64(fabs(vector[1]), fabs(vector[2])));
}

/* Place the corners about the first one, in a cube of side 2, and project them along the axis nearest
   to the normal so that they run to the left. */
static void place_corners(
    struct ring *ring, const double (*positions)[3], const int32_t *vertices)
{
    double most = 0.0, farthest = 0.0;
    const struct vector origin = vector_at(positions[vertices[ring->start]]);
    for (int32_t i = 0; i < ring->n; i++) {
        const struct vector at = vector_at(positions[vertices[(ring->start + i) % ring->n]]);
        const struct vector place = minus(at, origin);
        ring->places[i] = place;
        most = max_f64(most, max_f64(max_f64(fabs(place.x), fabs(place.y)), fabs(place.z)));
        farthest = max_f64(farthest, max_f64(max_f64(fabs(at.x), fabs(at.y)), fabs(at.z)));
    }
    int of_places = 0, of_points = 0;
    const double extent = frexp(most, &of_places);
    ring->step = most > 0.0 ? 0x1p-30 * (extent * extent) : 1.0;
    frexp(farthest, &of_points);
    double normal[3] = {0.0, 0.0, 0.0}, areas[3] = {0.0, 0.0, 0.0};
    for (int32_t i = 0; i < ring->n; i++) {
        struct vector *place = &ring->places[i];
        *place = (struct vector){
            ldexp(place->x, -of_places), ldexp(place->y, -of_places), ldexp(place->z, -of_places)};
        if (i == 0)
            continue;
        const struct vector area = cross(ring->places[i - 1], *place);
        normal[0] += area.x, normal[1] += area.y, normal[2] += area.z;
        areas[0] += fabs(area.x), areas[1] += fabs(area.y), areas[2] += fabs(area.z);
    }
    /* The loops of a polygon that crosses itself can cancel, but for what float32 files leave. */
    const double *sizes = largest_of(normal) > 1e-6 * largest_of(areas) ? normal : areas;
    int axis = fabs(sizes[1]) > fabs(sizes[2]) ? 1 : 2;
    axis = fabs(sizes[0]) > fabs(sizes[axis]) ? 0 : axis;
    const int along = (axis + (normal[axis] < 0.0 ? 2 : 1)) % 3, across = 3 - axis - along;
    for (int32_t i = 0; i < ring->n; i++) {
        const double *at = positions[vertices[(ring->start + i) % ring->n]];
        ring->points[i] = (struct point){ldexp(at[along], -of_points), ldexp(at[across], -of_points)};
    }
}

/* Write a triangle of three corners of a ring. */
static void write_triangle(
    const struct ring *ring, int32_t a, int32_t b, int32_t c, int64_t triangle[3])
{
    triangle[0] = (ring->start + a) % ring->n;
    triangle[1] = (ring->start + b) % ring->n;
    triangle[2] = (ring->start + c) % ring->n;
}

/* Cut a quadrilateral in two; return whether it crosses itself. */
static bool cut_quadrilateral(
    const struct ring *ring, const int32_t *vertices, int64_t triangles[2][3])
{
    const struct point *p = ring->points;
    /* The less of the turns of both triangles, for the diagonal from 0 and for that from 1. */
    const double inside[2] = {
        min_f64(turn(p[0], p[1], p[2]), turn(p[0], p[2], p[3])),
        min_f64(turn(p[1], p[2], p[3]), turn(p[1], p[3], p[0]))};
    int from;
    if ((inside[0] > 0.0) != (inside[1] > 0.0)) {
        from = inside[1] > 0.0;
    } else if ((inside[0] >= 0.0) != (inside[1] >= 0.0)) {
        from = inside[1] >= 0.0;
    } else {
        const double one = squared_length(ring, 0, 2), other = squared_length(ring, 1, 3);
        int32_t least[2];
        for (int k = 0; k < 2; k++) {
            const int32_t a = vertices[(ring->start + k) % 4];
            const int32_t b = vertices[(ring->start + k + 2) % 4];
            least[k] = a < b ? a : b;
        }
        /* Equal but for what float32 files leave of a length: that of the least vertex. */
        const double slack = 1e-6 * (one + other);
        from = fabs(one - other) <= slack ? least[1] < least[0] : other < one;
    }
    write_triangle(ring, from, from + 1, from + 2, triangles[0]);
    write_triangle(ring, from, from + 2, (from + 3) % 4, triangles[1]);
    return inside[from] < 0.0;
}

/* Whether a direction from corner a of a triangle a, b, c leads into it. */
static bool leads_into(struct point a, struct point b, struct point c, struct point to)
{
    return turn(a, b, to) > 0.0 && turn(a, to, c) > 0.0;
}

/* Whether a corner keeps the triangle of the corners before, at and after an ear from being cut off. */
static bool is_in_the_way(const struct ring *ring, const int32_t ear[3], int32_t corner)
{
    const struct point at = ring->points[corner];
    for (int k = 0; k < 3; k++) {
        const struct point a = ring->points[ear[k]];
        if (corner == ear[k])
            return false;
        if (!are_same(at, a))
            continue;
        const struct point b = ring->points[ear[(k + 1) % 3]], c = ring->points[ear[(k + 2) % 3]];
        return leads_into(a, b, c, ring->points[ring->before[corner]]) ||
               leads_into(a, b, c, ring->points[ring->after[corner]]);
    }
    for (int k = 0; k < 3; k++)
        if (turn(ring->points[ear[k]], ring->points[ear[(k + 1) % 3]], at) < 0.0)
            return false;
    return true;
}

static int64_t cell_at(const struct ring *ring, double place, double low, double cells)
{
    const double cell = (place - low) * cells;
    return cell > 0.0 ? (int64_t)min_f64(cell, (double)(ring->n_cells - 1)) : 0;
}

/* The first corner found that blocks an ear, or NOBODY. */
static int32_t find_blocking(const struct ring *ring, const int32_t ear[3])
{
    struct point low = ring->points[ear[0]], high = low;
    for (int k = 1; k < 3; k++) {
        const struct point at = ring->points[ear[k]];
        low = (struct point){min_f64(low.x, at.x), min_f64(low.y, at.y)};
        high = (struct point){max_f64(high.x, at.x), max_f64(high.y, at.y)};
    }
    const int64_t left = cell_at(ring, low.x, ring->low.x, ring->cells_x);
    const int64_t right = cell_at(ring, high.x, ring->low.x, ring->cells_x);
    const int64_t bottom = cell_at(ring, low.y, ring->low.y, ring->cells_y);
    const int64_t top = cell_at(ring, high.y, ring->low.y, ring->cells_y);
    for (int64_t row = bottom; row <= top; row++) {
        const int32_t *starts = ring->cell_starts + row * ring->n_cells;
        for (int32_t k = starts[left]; k < starts[right + 1]; k++) {
            const int32_t corner = ring->cell_corners[k];
            if (ring->is_blocking[corner] && is_in_the_way(ring, ear, corner))
                return corner;
        }
    }
    return NOBODY;
}

/* Sort the corners that may block ears into a grid of about one a cell. */
static void fill_grid(struct arena *arena, struct ring *ring)
{
    struct point low = ring->points[0], high = low;
    int64_t n_blocking = 0;
    for (int32_t i = 0; i < ring->n; i++) {
        const struct point at = ring->points[i];
        low = (struct point){min_f64(low.x, at.x), min_f64(low.y, at.y)};
        high = (struct point){max_f64(high.x, at.x), max_f64(high.y, at.y)};
        n_blocking += ring->is_blocking[i];
    }
    ring->low = low;
    ring->n_cells = clamp_i64((int64_t)sqrt((double)n_blocking), 1, MOST_CELLS);
    const double n_cells = (double)ring->n_cells;
    ring->cells_x = high.x > low.x ? n_cells / (high.x - low.x) : 0.0;
    ring->cells_y = high.y > low.y ? n_cells / (high.y - low.y) : 0.0;
    ring->cell_starts = TAKE_ZEROS(arena, int32_t, ring->n_cells * ring->n_cells + 2);
    ring->cell_corners = TAKE(arena, int32_t, n_blocking);
    int32_t *cells = TAKE(arena, int32_t, ring->n);
    for (int32_t i = 0; i < ring->n; i++) {
        const int64_t column = cell_at(ring, ring->points[i].x, low.x, ring->cells_x);
        const int64_t row = cell_at(ring, ring->points[i].y, low.y, ring->cells_y);
        cells[i] = (int32_t)(row * ring->n_cells + column);
        ring->cell_starts[cells[i] + 2] += ring->is_blocking[i];
    }
    for (int64_t cell = 0; cell < ring->n_cells * ring->n_cells; cell++)
        ring->cell_starts[cell + 2] += ring->cell_starts[cell + 1];
    for (int32_t i = 0; i < ring->n; i++)
        if (ring->is_blocking[i])
            ring->cell_corners[ring->cell_starts[cells[i] + 1]++] = i;
}

/* The shorter diagonal comes first, then the lesser corner. */
static bool is_better(struct ear a, struct ear b)
{
    return a.length != b.length ? a.length < b.length : a.corner < b.corner;
}

static void push_ear(struct ring *ring, struct ear ear)
{
    int64_t at = ring->n_ears++;
    while (at > 0 && is_better(ear, ring->heap[(at - 1) / 2])) {
        ring->heap[at] = ring->heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    ring->heap[at] = ear;
}

static struct ear pop_ear(struct ring *ring)
{
    const struct ear best = ring->heap[0], last = ring->heap[--ring->n_ears];
    int64_t at = 0;
    for (;;) {
        int64_t next = 2 * at + 1;
        if (next + 1 < ring->n_ears && is_better(ring->heap[next + 1], ring->heap[next]))
            next++;
        if (next >= ring->n_ears || !is_better(ring->heap[next], last))
            break;
        ring->heap[at] = ring->heap[next];
        at = next;
    }
    ring->heap[at] = last;
    return best;
}

/* Offer a corner as an ear, or let it wait for the corner that blocks it. */
static void try_corner(struct ring *ring, int32_t corner)
{
    const int32_t stamp = ++ring->stamps[corner];
    if (!(corner_turn(ring, corner) > 0.0))
        return;
    const int32_t ear[3] = {ring->before[corner], corner, ring->after[corner]};
    const int32_t blocking = find_blocking(ring, ear);
    if (blocking == NOBODY) {
        const double length = rint(squared_length(ring, ear[0], ear[2]) / ring->step);
        push_ear(ring, (struct ear){length, corner, stamp});
    } else if (ring->next_waiting[corner] == NOWHERE) {
        ring->next_waiting[corner] = ring->first_waiting[blocking];
        ring->first_waiting[blocking] = corner;
    }
}

/* A corner blocks no ear any more: try those that waited for it. */
static void release(struct ring *ring, int32_t blocking)
{
    ring->is_blocking[blocking] = false;
    int32_t corner = ring->first_waiting[blocking];
    ring->first_waiting[blocking] = NOBODY;
    while (corner != NOBODY) {
        const int32_t next = ring->next_waiting[corner];
        ring->next_waiting[corner] = NOWHERE;
        if (!ring->is_clipped[corner])
            try_corner(ring, corner);
        corner = next;
    }
}

static void clip(struct ring *ring, int32_t corner, int64_t triangle[3])
{
    const int32_t beside[2] = {ring->before[corner], ring->after[corner]};
    write_triangle(ring, beside[0], corner, beside[1], triangle);
    ring->after[beside[0]] = beside[1];
    ring->before[beside[1]] = beside[0];
    ring->is_clipped[corner] = true;
    ring->n_left--;
    if (ring->is_blocking[corner])
        release(ring, corner);
    for (int side = 0; side < 2; side++) {
        if (ring->is_blocking[beside[side]] && corner_turn(ring, beside[side]) > 0.0)
            release(ring, beside[side]);
        try_corner(ring, beside[side]);
    }
}

/* The corner to cut off where none is an ear, from one that is left on: the first straight one near,
   which takes no area away, else the first that turns to the left. */
static int32_t corner_without_ear(const struct ring *ring, int32_t from)
{
    int32_t found = NOBODY, corner = from;
    for (int32_t k = 0; k < min_i64(ring->n_left, FEW); k++) {
        const double turned = corner_turn(ring, corner);
        if (turned == 0.0)
            return corner;
        if (found == NOBODY && turned > 0.0)
            found = corner;
        corner = ring->after[corner];
    }
    return found == NOBODY ? from : found;
}

static bool is_upper(struct point from, struct point to)
{
    return to.y > from.y || (to.y == from.y && to.x > from.x);
}

/* Whether the corners go round more or less than once; false where an edge runs back on another. */
static bool goes_round_otherwise(const struct ring *ring)
{
    int64_t n_rounds = 0;
    bool is_point = true;
    for (int32_t i = 0; i < ring->n; i++) {
        const struct point *p = ring->points;
        const struct point a = p[ring->before[i]], b = p[i], c = p[ring->after[i]];
        const bool was_upper = is_upper(a, b), upper = is_upper(b, c);
        is_point &= are_same(a, b);
        if (was_upper == upper)
            continue;
        const double turned = turn(a, b, c);
        if (turned == 0.0)
            return false;
        n_rounds += upper ? turned > 0.0 : -(turned < 0.0);
    }
    return n_rounds != 1 && !is_point;
}

/* Clip the ears of a polygon; return whether it crosses itself. */
static bool clip_ears(struct arena *arena, struct ring *ring, int64_t (*triangles)[3])
{
    const int32_t n = ring->n;
    ring->before = TAKE(arena, int32_t, n);
    ring->after = TAKE(arena, int32_t, n);
    ring->stamps = TAKE_ZEROS(arena, int32_t, n);
    ring->is_clipped = TAKE_ZEROS(arena, bool, n);
    ring->is_blocking = TAKE(arena, bool, n);
    ring->first_waiting = TAKE(arena, int32_t, n);
    ring->next_waiting = TAKE(arena, int32_t, n);
    /* A corner is offered at the start, when it loses a neighbor, and once after each of these. */
    ring->heap = TAKE(arena, struct ear, 6 * (int64_t)n);
    ring->n_left = n;
    for (int32_t i = 0; i < n; i++) {
        ring->before[i] = i > 0 ? i - 1 : n - 1;
        ring->after[i] = i + 1 < n ? i + 1 : 0;
        ring->first_waiting[i] = NOBODY;
        ring->next_waiting[i] = NOWHERE;
    }
    for (int32_t i = 0; i < n; i++)
        ring->is_blocking[i] = !(corner_turn(ring, i) > 0.0);
    bool is_crossed = goes_round_otherwise(ring);
    fill_grid(arena, ring);
    for (int32_t i = 0; i < n; i++)
        try_corner(ring, i);
    int32_t left = 0; /* a corner that is left */
    while (ring->n_left > 3) {
        int32_t corner;
        if (ring->n_ears > 0) {
            const struct ear ear = pop_ear(ring);
            if (ring->is_clipped[ear.corner] || ring->stamps[ear.corner] != ear.stamp)
                continue;
            corner = ear.corner;
        } else {
            corner = corner_without_ear(ring, left);
            is_crossed |= corner_turn(ring, corner) != 0.0;
        }
        left = ring->after[corner];
        clip(ring, corner, triangles[n - ring->n_left]);
    }
    write_triangle(ring, ring->before[left], left, ring->after[left], triangles[n - 3]);
    return is_crossed || corner_turn(ring, left) < 0.0;
}

/* Put first the triangle of the edge from the polygon's first corner, from that corner on. */
static void begin_at_first_corner(int64_t n, int64_t triangles[n][3])
{
    for (int64_t k = 0; k < n; k++)
        for (int c = 0; c < 3; c++) {
            const int64_t other = triangles[k][(c + 2) % 3];
            if (triangles[k][c] != 0 || triangles[k][(c + 1) % 3] != 1)
                continue;
            for (int axis = 0; axis < 3; axis++)
                triangles[k][axis] = triangles[0][axis];
            triangles[0][0] = 0;
            triangles[0][1] = 1;
            triangles[0][2] = other;
            return;
        }
}

/* Triangles of polygons `first` to `stop`, as numbers of corners from 0: those of polygon p are
   written from first_triangles[p] on. The first begins at the polygon's first corner. */
EXPORT int64_t triangulate_polygons(
    int64_t n_vertices, int64_t n_corners, int64_t n_polygons, int64_t n_triangles,
    const double positions[n_vertices][3], const int32_t vertices[n_corners],
    const int64_t first_corners[n_polygons], const int64_t sizes[n_polygons],
    const int64_t first_triangles[n_polygons], int64_t triangles[n_triangles][3],
    bool is_crossed[n_polygons], int64_t first, int64_t stop)
{
    OPEN_ARENA(arena);
    const arena_mark empty = mark_arena(arena);
    for (int64_t polygon = first; polygon < stop; polygon++) {
        const int64_t n = sizes[polygon];
        if (n < 3)
            continue;
        const int32_t *corners = vertices + first_corners[polygon];
        int64_t (*own)[3] = triangles + first_triangles[polygon];
        if (n == 3) {
            own[0][0] = 0, own[0][1] = 1, own[0][2] = 2;
        } else {
            struct ring ring = {.n = (int32_t)n, .start = first_corner(n, positions, corners)};
            ring.points = TAKE(arena, struct point, n);
            ring.places = TAKE(arena, struct vector, n);
            place_corners(&ring, positions, corners);
            is_crossed[polygon] = n == 4 ? cut_quadrilateral(&ring, corners, own)
                                         : clip_ears(arena, &ring, own);
            begin_at_first_corner(n - 2, own);
            reset_arena(arena, empty);
        }
        for (int64_t k = 0; k < n - 2; k++)
            for (int c = 0; c < 3; c++)
                own[k][c] += first_corners[polygon];
    }
    close_arena(arena);
    return 0;
}
