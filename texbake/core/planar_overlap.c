/* Triangles in the plane that overlap others.

   Two triangles do not overlap if the line through an edge of one of them separates them. Which
   pairs to test comes from a tree of bounding boxes, packed over the triangles in the order of a
   space-filling curve.

   Based on: Gottschalk, Lin, Manocha, "OBBTree: A Hierarchical Structure for Rapid Interference
   Detection", 1996 (the separating axis theorem); Kamel, Faloutsos, "On Packing R-trees", 1993;
   Morton, "A Computer Oriented Geodetic Data Base", 1966 (the order).

   Called from texbake/mapping/overlap.py and flatten.c. */

#include "flattening.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Children of a box. 64 levels are more than any mesh has. */
enum { FAN_OUT = 8, STACK_SIZE = FAN_OUT * 64 };

/* Cells of the curve along each side, less one. */
static const double MOST_CELL = 65535.0;

/* Faces of some thickness in order, and boxes around them: the rows of `boxes` are those of the
   faces, then those around `children`, up to the box of everything. */
struct tree {
    int64_t n_solid, n_boxes;
    const double (*corners)[3][2];
    const double (*lines)[3][3]; /* (a, b, c) of each edge: a s + b t + c is the distance inwards */
    const int64_t *order;
    const double (*boxes)[6];      /* least s, t and chart, then the greatest */
    const int64_t (*children)[2];  /* the first row inside, and the one after the last */
};

/* What a search may find, and has found. */
struct search {
    double depth;
    int64_t most; /* comparisons of a face, before it is left unsure */
    bool *found, *unsure;
    int32_t *layers; /* NULL where one overlap of a face is enough */
    int64_t *taken;  /* for each layer, the last face that found it taken */
};

/* Whether the line through an edge of `one` has `other` on its outer side. */
static inline bool is_parted_by(const struct tree *tree, int64_t one, int64_t other, double depth)
{
    const double (*corner)[2] = tree->corners[other];
    for (int edge = 0; edge < 3; edge++) {
        const double *line = tree->lines[one][edge];
        const double a = line[0], b = line[1], c = line[2];
        if (a * corner[0][0] + b * corner[0][1] + c <= depth
            && a * corner[1][0] + b * corner[1][1] + c <= depth
            && a * corner[2][0] + b * corner[2][1] + c <= depth)
            return true;
    }
    return false;
}

static inline bool boxes_meet(const double box[6], const double window[6])
{
    return box[0] < window[3] && box[3] > window[0] && box[1] < window[4] && box[4] > window[1]
        && box[2] <= window[2] && box[5] >= window[2];
}

/* Compare the face at a place with those near it. */
static void search_place(const struct tree *tree, const struct search *search, int64_t place)
{
    const int64_t face = tree->order[place];
    const double *box = tree->boxes[place], depth = search->depth;
    const double window[6] = {
        box[0] + depth, box[1] + depth, box[2], box[3] - depth, box[4] - depth, box[2]};
    int64_t stack[STACK_SIZE], n_waiting = 1, n_pairs = 0;
    stack[0] = tree->n_boxes - 1;
    while (n_waiting > 0) {
        const int64_t row = stack[--n_waiting];
        for (int64_t child = tree->children[row][0]; child < tree->children[row][1]; child++)
            if (boxes_meet(tree->boxes[child], window))
                stack[n_waiting++] = child;
        if (row >= tree->n_solid || row == place)
            continue;
        const int64_t other = tree->order[row];
        if (search->layers && other > face)
            continue;
        if (n_pairs++ == search->most) {
            search->unsure[face] = true;
            break;
        }
        if (is_parted_by(tree, face, other, depth) || is_parted_by(tree, other, face, depth))
            continue;
        search->found[face] = true;
        if (!search->layers)
            break;
        search->taken[search->layers[other]] = face;
    }
    while (search->layers && search->taken[search->layers[face]] == face)
        search->layers[face]++;
}

/* Whether a face is more than `depth` thick; `lines` gets its edges. */
static bool set_lines(const double corner[3][2], double depth, double lines[3][3])
{
    const double doubled = (corner[1][0] - corner[0][0]) * (corner[2][1] - corner[0][1])
        - (corner[1][1] - corner[0][1]) * (corner[2][0] - corner[0][0]);
    double longest = 0.0;
    for (int i = 0; i < 3; i++) {
        const double *from = corner[i], *to = corner[(i + 1) % 3];
        const double s = to[0] - from[0], t = to[1] - from[1], square = s * s + t * t;
        double length = max_f64(sqrt(square), DBL_MIN);
        length = doubled < 0.0 ? -length : length;
        longest = max_f64(longest, square);
        lines[i][0] = -t / length;
        lines[i][1] = s / length;
        lines[i][2] = -(lines[i][0] * from[0] + lines[i][1] * from[1]);
    }
    return fabs(doubled) > depth * sqrt(longest);
}

static uint64_t spread_bits(uint64_t value)
{
    value = (value | value << 8) & 0x00FF00FF;
    value = (value | value << 4) & 0x0F0F0F0F;
    value = (value | value << 2) & 0x33333333;
    return (value | value << 1) & 0x55555555;
}

struct key {
    uint64_t code;
    int64_t face;
};

/* Sort by code, a byte at a time from the least; bytes that all codes share are skipped. */
static struct key *sorted(struct arena *arena, struct key *keys, int64_t n)
{
    struct key *other = TAKE(arena, struct key, n);
    for (int shift = 0; shift < 64; shift += 8) {
        int64_t places[256] = {0}, total = 0;
        for (int64_t i = 0; i < n; i++)
            places[keys[i].code >> shift & 255]++;
        if (n == 0 || places[keys[0].code >> shift & 255] == n)
            continue;
        for (int byte = 0; byte < 256; byte++) {
            const int64_t count = places[byte];
            places[byte] = total;
            total += count;
        }
        for (int64_t i = 0; i < n; i++)
            other[places[keys[i].code >> shift & 255]++] = keys[i];
        struct key *kept = keys;
        keys = other;
        other = kept;
    }
    return keys;
}

/* List the thick faces in the order of charts and then of the curve; return how many. */
static int64_t order_faces(
    struct arena *arena, int64_t n_faces, const double (*corners)[3][2], const int32_t *charts,
    double depth, double (*lines)[3][3], int64_t *order)
{
    struct key *keys = TAKE(arena, struct key, n_faces);
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    int64_t n_solid = 0;
    for (int64_t face = 0; face < n_faces; face++) {
        if (!set_lines(corners[face], depth, lines[face]))
            continue;
        keys[n_solid++].face = face;
        for (int axis = 0; axis < 2; axis++) {
            const double sum = corners[face][0][axis] + corners[face][1][axis] + corners[face][2][axis];
            low[axis] = min_f64(low[axis], sum);
            high[axis] = max_f64(high[axis], sum);
        }
    }
    const double extent = max_f64(max_f64(high[0] - low[0], high[1] - low[1]), DBL_MIN);
    for (int64_t i = 0; i < n_solid; i++) {
        const double (*corner)[2] = corners[keys[i].face];
        uint64_t code = charts ? (uint64_t)charts[keys[i].face] << 32 : 0;
        for (int axis = 0; axis < 2; axis++) {
            const double sum = corner[0][axis] + corner[1][axis] + corner[2][axis];
            code |= spread_bits((uint64_t)((sum - low[axis]) / extent * MOST_CELL)) << axis;
        }
        keys[i].code = code;
    }
    keys = sorted(arena, keys, n_solid);
    for (int64_t i = 0; i < n_solid; i++)
        order[i] = keys[i].face;
    return n_solid;
}

/* Boxes around the faces in order, then around each FAN_OUT of those, up to a single one; return how
   many. */
static int64_t pack(
    int64_t n_solid, const double (*corners)[3][2], const int32_t *charts, const int64_t *order,
    double (*boxes)[6], int64_t (*children)[2])
{
    for (int64_t i = 0; i < n_solid; i++) {
        const double (*corner)[2] = corners[order[i]];
        for (int axis = 0; axis < 2; axis++) {
            boxes[i][axis] = min_f64(min_f64(corner[0][axis], corner[1][axis]), corner[2][axis]);
            boxes[i][axis + 3] =
                max_f64(max_f64(corner[0][axis], corner[1][axis]), corner[2][axis]);
        }
        boxes[i][2] = boxes[i][5] = charts ? charts[order[i]] : 0.0;
        children[i][0] = children[i][1] = 0;
    }
    int64_t first = 0, n_boxes = n_solid;
    while (n_boxes - first > 1) {
        const int64_t end = n_boxes;
        for (int64_t begin = first; begin < end; begin += FAN_OUT) {
            const int64_t stop = min_i64(begin + FAN_OUT, end);
            double *box = boxes[n_boxes];
            memcpy(box, boxes[begin], sizeof boxes[begin]);
            for (int64_t child = begin + 1; child < stop; child++) {
                for (int side = 0; side < 3; side++) {
                    box[side] = min_f64(box[side], boxes[child][side]);
                    box[side + 3] = max_f64(box[side + 3], boxes[child][side + 3]);
                }
            }
            children[n_boxes][0] = begin;
            children[n_boxes++][1] = stop;
        }
        first = end;
    }
    return n_boxes;
}

/* Pack boxes over faces that are more than `depth` thick; `counts` gets the number of these, and of
   boxes. There may be charts, which keep faces apart. */
EXPORT int64_t pack_boxes(
    int64_t n_faces, int64_t most, const double corners[n_faces][3][2],
    OPTIONAL const int32_t charts[n_faces], double depth, double lines[n_faces][3][3],
    int64_t order[n_faces], double boxes[most][6], int64_t children[most][2], int64_t counts[2])
{
    OPEN_ARENA(arena);
    counts[0] = counts[1] = 0;
    if (most >= n_faces + n_faces / (FAN_OUT - 1) + STACK_SIZE) {
        counts[0] = order_faces(arena, n_faces, corners, charts, depth, lines, order);
        counts[1] = pack(counts[0], corners, charts, order, boxes, children);
    }
    close_arena(arena);
    return 0;
}

/* Find the faces that overlap others, for the faces at some places of the order.

   Without `layers`, one overlap is enough. With it, every overlapping face of a lower number is
   found, and the face takes the lowest layer that those leave free. A face that was compared with
   `most` others, none of which overlaps it, is `unsure`. */
EXPORT int64_t find_planar_overlaps(
    int64_t n_faces, int64_t n_solid, int64_t n_boxes, int64_t n_places,
    const double corners[n_faces][3][2], const double lines[n_faces][3][3],
    const int64_t order[n_solid], const double boxes[n_boxes][6],
    const int64_t children[n_boxes][2], double depth, int64_t most,
    const int64_t places[n_places], bool found[n_faces], bool unsure[n_faces],
    OPTIONAL int32_t layers[n_faces])
{
    OPEN_ARENA(arena);
    const struct tree tree = {n_solid, n_boxes, corners, lines, order, boxes, children};
    const struct search search = {
        depth, most, found, unsure, layers, TAKE(arena, int64_t, layers ? n_faces + 1 : 0)};
    for (int64_t layer = 0; layers && layer <= n_faces; layer++)
        search.taken[layer] = -1;
    for (int64_t at = 0; at < n_places; at++)
        search_place(&tree, &search, places[at]);
    close_arena(arena);
    return 0;
}

/* Take the corners of faces from a layout. */
static void gather_corners(
    const double (*uvs)[2], int64_t n_faces, const int32_t (*faces)[3], double (*corners)[3][2])
{
    for (int64_t face = 0; face < n_faces; face++)
        for (int corner = 0; corner < 3; corner++)
            memcpy(corners[face][corner], uvs[faces[face][corner]], sizeof corners[face][corner]);
}

int64_t count_overlaps(
    struct arena *arena, const double (*uvs)[2], int64_t n_faces, const int32_t (*faces)[3],
    double depth)
{
    const arena_mark mark = mark_arena(arena);
    const int64_t most = n_faces + n_faces / (FAN_OUT - 1) + STACK_SIZE;
    double (*corners)[3][2] = take(arena, n_faces, sizeof *corners);
    double (*lines)[3][3] = take(arena, n_faces, sizeof *lines);
    int64_t *order = TAKE(arena, int64_t, n_faces), *places = TAKE(arena, int64_t, n_faces);
    double (*boxes)[6] = take(arena, most, sizeof *boxes);
    int64_t (*children)[2] = take(arena, most, sizeof *children);
    bool *found = TAKE_ZEROS(arena, bool, 2 * n_faces);
    int32_t *layers = TAKE_ZEROS(arena, int32_t, n_faces);
    int64_t *taken = TAKE(arena, int64_t, n_faces + 1);
    gather_corners(uvs, n_faces, faces, corners);
    const double (*given)[3][2] = (const double (*)[3][2])corners;
    const int64_t n_solid = order_faces(arena, n_faces, given, NULL, depth, lines, order);
    const int64_t n_boxes = pack(n_solid, given, NULL, order, boxes, children);
    const struct tree tree = {
        n_solid, n_boxes, given, (const double (*)[3][3])lines, order, (const double (*)[6])boxes,
        (const int64_t (*)[2])children};
    const struct search search = {depth, n_faces, found, found + n_faces, layers, taken};
    for (int64_t face = 0; face < n_faces; face++) {
        taken[face] = places[face] = -1;
    }
    taken[n_faces] = -1;
    for (int64_t place = 0; place < n_solid; place++)
        places[order[place]] = place;
    int64_t count = 0;
    for (int64_t face = 0; face < n_faces; face++) { /* in their order, for the layers */
        if (places[face] >= 0)
            search_place(&tree, &search, places[face]);
        count += layers[face] > 0;
    }
    reset_arena(arena, mark);
    return count;
}
