/* Displacement: measuring the edges of a subdivided surface, cutting triangles at the middles of
   marked edges, so that no crack opens, and moving its vertices.

   An edge is cut for both of its triangles, and a triangle with a cut edge has its longest edge cut
   as well, so that pieces do not become thin.

   Based on: the sources given in texbake/rendering/displaced.py.

   Called from texbake/rendering/displaced.py. */

#include <math.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

/* Write the mean of the values at both ends of each edge. */
EXPORT void take_middles(
    int64_t n_values, int64_t n, const double values[n_values][3], const int32_t ends[n][2],
    double out[restrict n][3])
{
    for (int64_t i = 0; i < n; i++) {
        const double *a = values[ends[i][0]], *b = values[ends[i][1]];
        for (int k = 0; k < 3; k++)
            out[i][k] = 0.5 * (a[k] + b[k]);
    }
}

/* Write points displaced by the mean of their values: by vectors where there are three channels,
   else along the normal. */
EXPORT int64_t move_vertices(
    int64_t n_places, int64_t n_channels, int64_t n, const int32_t vertices[n_places],
    const double values[n_places][n_channels], const double points[n][3],
    const double normals[n][3], const double linear[3][3], double out[n][3])
{
    OPEN_ARENA(arena);
    int32_t *counts = TAKE_ZEROS(arena, int32_t, n);
    for (int64_t i = 0; i < n; i++)
        out[i][0] = out[i][1] = out[i][2] = 0.0;
    for (int64_t i = 0; i < n_places; i++) {
        counts[vertices[i]]++;
        for (int64_t k = 0; k < n_channels; k++)
            out[vertices[i]][k] += values[i][k];
    }
    for (int64_t i = 0; i < n; i++) {
        const double x = normals[i][0], y = normals[i][1], z = normals[i][2];
        const double length = sqrt(x * x + y * y + z * z);
        double way[3];
        for (int k = 0; k < 3; k++) {
            if (n_channels == 3)
                way[k] = out[i][k] / counts[i];
            else
                way[k] = out[i][0] / counts[i] * (length > 0.0 ? normals[i][k] / length : 0.0);
        }
        for (int k = 0; k < 3; k++) {
            const double *row = linear[k];
            out[i][k] = points[i][k] + (row[0] * way[0] + row[1] * way[1] + row[2] * way[2]);
        }
    }
    close_arena(arena);
    return 0;
}

/* Leave out places that equal the last one of the same vertex: both sides of an edge inside a base
   triangle are one place, and the mean of two equal values is that value. Return how many are left. */
EXPORT int64_t drop_repeated_places(
    int64_t n, int64_t n_vertices, int32_t vertices[n], int32_t base_faces[n], float weights[n][2])
{
    OPEN_ARENA(arena);
    int32_t *last = TAKE(arena, int32_t, n_vertices);
    for (int64_t i = 0; i < n_vertices; i++)
        last[i] = -1;
    int64_t n_kept = 0;
    for (int64_t i = 0; i < n; i++) {
        const int32_t at = last[vertices[i]];
        if (at >= 0 && base_faces[at] == base_faces[i] && weights[at][0] == weights[i][0]
            && weights[at][1] == weights[i][1])
            continue;
        last[vertices[i]] = (int32_t)n_kept;
        vertices[n_kept] = vertices[i];
        base_faces[n_kept] = base_faces[i];
        weights[n_kept][0] = weights[i][0];
        weights[n_kept++][1] = weights[i][1];
    }
    close_arena(arena);
    return n_kept;
}

/* Raise the length of each edge, in texels, to the maximum over triangles not outside. Without
   `corners`, the base triangles on the map, there is no limit to the detail. */
EXPORT void measure_texel_lengths(
    int64_t n, int64_t n_base, int64_t n_points, int64_t n_edges, const int32_t faces[n][3],
    const int32_t face_edges[n][3], const int32_t base_faces[n], const float weights[n][3][2],
    OPTIONAL const double corners[n_base][3][2], const uint8_t outside[n_points],
    double lengths[n_edges])
{
    for (int64_t i = 0; i < n; i++) {
        if (outside[faces[i][0]] & outside[faces[i][1]] & outside[faces[i][2]])
            continue;
        for (int k = 0; k < 3; k++) {
            const int after = (k + 1) % 3;
            double length = INFINITY;
            if (corners) {
                const double *a = corners[base_faces[i]][0], *b = corners[base_faces[i]][1];
                const double *c = corners[base_faces[i]][2];
                const float *from = weights[i][k], *to = weights[i][after];
                const double along = to[0] - from[0], up = to[1] - from[1];
                const double x = along * (b[0] - a[0]) + up * (c[0] - a[0]);
                const double y = along * (b[1] - a[1]) + up * (c[1] - a[1]);
                length = sqrt(x * x + y * y);
            }
            double *longest = &lengths[face_edges[i][k]];
            *longest = max_f64(*longest, length);
        }
    }
}

/* Bits of the sides of the picture beyond whose margins a point lies. */
static uint8_t sides_passed(const double point[3], const double sides[5][4], const double margins[5])
{
    unsigned code = 0;
    for (int side = 0; side < 5; side++) {
        double inside = sides[side][3];
        for (int k = 0; k < 3; k++)
            inside += sides[side][k] * point[k];
        if (inside < -margins[side])
            code |= 1u << side;
    }
    return (uint8_t)code;
}

/* Write on which sides each vertex is outside the picture, its least depth, and its slant: the
   first on the surface only, the others also after displacement. */
EXPORT void view_vertices(
    int64_t n, const double points[n][3], const double positions[n][3], const double eye[3],
    const double back[3], double near, double steepest, const double sides[5][4],
    const double margins[5], uint8_t outside[n], double nearest[n], double slants[n],
    int64_t start, int64_t stop)
{
    for (int64_t i = start; i < stop; i++) {
        outside[i] = sides_passed(points[i], sides, margins);
        nearest[i] = INFINITY;
        slants[i] = 1.0;
        const double *places[2] = {points[i], positions[i]};
        for (int which = 0; which < 2; which++) {
            double depth = 0.0, squared = 0.0;
            for (int k = 0; k < 3; k++) {
                const double offset = eye[k] - places[which][k];
                depth += offset * back[k];
                squared += offset * offset;
            }
            if (depth > near) {
                nearest[i] = min_f64(nearest[i], depth);
                slants[i] = max_f64(slants[i], min_f64(sqrt(squared) / depth, steepest));
            } else {
                nearest[i] = near;
                slants[i] = steepest;
            }
        }
    }
}

/* Write the ratio of each edge's length to the allowed length; 0 for one within a texel. */
EXPORT void measure_excess(
    int64_t n, int64_t n_points, const int32_t ends[n][2], const double points[n_points][3],
    const double positions[n_points][3], const double nearest[n_points],
    const double slants[n_points], const double texels[n], double scale, double out[n],
    int64_t start, int64_t stop)
{
    for (int64_t edge = start; edge < stop; edge++) {
        out[edge] = 0.0;
        if (!(texels[edge] > 1.0))
            continue;
        const int32_t a = ends[edge][0], b = ends[edge][1];
        double along = 0.0, moved = 0.0;
        for (int k = 0; k < 3; k++) {
            const double before = points[a][k] - points[b][k];
            const double after = positions[a][k] - positions[b][k];
            along += before * before;
            moved += after * after;
        }
        const double length = sqrt(max_f64(along, moved));
        out[edge] = scale * length * max_f64(slants[a], slants[b])
                    / min_f64(nearest[a], nearest[b]);
    }
}

/* How a triangle is divided, by the number of its cut edges, which come first; with two cut edges
   there are two variants. Points: corners 0, 1, 2 and midpoints 3, 4, 5 of the edges 01, 12, 20.
   Edges: 0 and 1 are the halves of 01 at corners 0 and 1, 2 and 3 those of 12, 4 and 5 those of 20
   (both are the edge itself if it is not cut); 6, 7, 8 are new inner edges. A piece is three points,
   then the edges from each to the next. */
static const int8_t PIECES[5][4][6] = {
    {{0, 1, 2, 0, 2, 4}},
    {{0, 3, 2, 0, 6, 4}, {3, 1, 2, 1, 2, 6}},
    {{3, 1, 4, 1, 2, 6}, {0, 3, 4, 0, 6, 7}, {0, 4, 2, 7, 3, 4}},
    {{0, 3, 5, 0, 6, 5}, {3, 1, 4, 1, 2, 7}, {5, 4, 2, 8, 3, 4}, {3, 4, 5, 7, 8, 6}},
    {{3, 1, 4, 1, 2, 6}, {0, 3, 2, 0, 7, 4}, {3, 4, 2, 6, 3, 7}},
};

/* Ends of the new edges 6, 7 and 8. */
static const int8_t INNER[5][3][2] = {
    {{0}},
    {{3, 2}},
    {{3, 4}, {0, 4}},
    {{3, 5}, {3, 4}, {4, 5}},
    {{3, 4}, {3, 2}},
};

enum { OTHER_DIAGONAL = 4 };

static double squared_distance(const double a[3], const double b[3])
{
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

/* Mark the longest edge of every triangle with a marked edge; return the number of cuts. */
EXPORT int64_t close_marks(
    int64_t n, int64_t n_points, int64_t n_edges, const int32_t faces[n][3],
    const int32_t face_edges[n][3], const double points[n_points][3], bool marked[n_edges])
{
    bool changed = true;
    int64_t n_cuts = 0;
    while (changed) {
        changed = false;
        n_cuts = 0;
        for (int64_t i = 0; i < n; i++) {
            const int32_t *edges = face_edges[i];
            int count = marked[edges[0]] + marked[edges[1]] + marked[edges[2]];
            if (0 < count && count < 3) {
                int32_t longest = 0;
                double length = -1.0;
                for (int k = 0; k < 3; k++) {
                    const double squared =
                        squared_distance(points[faces[i][k]], points[faces[i][(k + 1) % 3]]);
                    if (squared > length) {
                        longest = edges[k];
                        length = squared;
                    }
                }
                if (!marked[longest]) {
                    marked[longest] = changed = true;
                    count++;
                }
            }
            n_cuts += count;
        }
    }
    return n_cuts;
}

/* Write the number of triangles added by all triangles before each one. */
EXPORT void count_pieces(
    int64_t n, int64_t n_edges, const int32_t face_edges[n][3], const bool marked[n_edges],
    int64_t added[n + 1])
{
    added[0] = 0;
    for (int64_t i = 0; i < n; i++) {
        const int32_t *edges = face_edges[i];
        added[i + 1] = added[i] + marked[edges[0]] + marked[edges[1]] + marked[edges[2]];
    }
}

/* Write both halves of marked edges, and copy the other edges. */
EXPORT void halve_edges(
    int64_t n, int64_t n_out, const int32_t ends[n][2], const bool marked[n],
    const int32_t halves[n], const int32_t middles[n], int32_t out[n_out][2])
{
    for (int64_t edge = 0; edge < n; edge++) {
        const int32_t half = halves[edge];
        out[half][0] = ends[edge][0];
        out[half][1] = ends[edge][1];
        if (marked[edge]) {
            out[half][1] = middles[edge];
            out[half + 1][0] = middles[edge];
            out[half + 1][1] = ends[edge][1];
        }
    }
}

/* Triangles before the cut, their edges, and the pieces. */
struct cutting {
    const int32_t (*faces)[3], (*face_edges)[3], *base_faces;
    const float (*weights)[3][2];
    const int32_t (*ends)[2], *halves, *middles;
    const bool *marked;
    int64_t n_vertices;
    int32_t (*faces_out)[3], (*face_edges_out)[3], *base_faces_out;
    float (*weights_out)[3][2];
    int32_t *place_vertices, *place_faces;
    float (*place_weights)[2];
};

/* The points and edges of one triangle, numbered as in PIECES. */
struct triangle {
    int32_t vertices[6], edges[9];
    float weights[6][2];
};

/* Gather the points and outer edges of a triangle, starting at its corner `first`. Each of its cut
   edges adds a row to the places of new vertices, starting at row `place`. */
static void gather_triangle(
    const struct cutting *whole, int64_t i, int first, int64_t place, struct triangle *found)
{
    for (int k = 0; k < 3; k++) {
        const int corner = (first + k) % 3, after = (first + k + 1) % 3;
        const int32_t e = whole->face_edges[i][corner], from = whole->faces[i][corner];
        found->vertices[k] = from;
        for (int c = 0; c < 2; c++) {
            const float here = whole->weights[i][corner][c], there = whole->weights[i][after][c];
            found->weights[k][c] = here;
            found->weights[3 + k][c] = 0.5f * (here + there);
        }
        found->edges[2 * k] = found->edges[2 * k + 1] = whole->halves[e];
        if (!whole->marked[e])
            continue;
        found->vertices[3 + k] = whole->middles[e];
        found->edges[2 * k + (whole->ends[e][0] == from)]++;
        whole->place_vertices[place] = (int32_t)(whole->middles[e] - whole->n_vertices);
        whole->place_faces[place] = whole->base_faces[i];
        whole->place_weights[place][0] = found->weights[3 + k][0];
        whole->place_weights[place][1] = found->weights[3 + k][1];
        place++;
    }
}

/* Copy a triangle without cut edges, the most common case in the last rounds. */
static void keep_triangle(const struct cutting *whole, int64_t i, int64_t piece)
{
    whole->base_faces_out[piece] = whole->base_faces[i];
    for (int k = 0; k < 3; k++) {
        whole->faces_out[piece][k] = whole->faces[i][k];
        whole->face_edges_out[piece][k] = whole->halves[whole->face_edges[i][k]];
        whole->weights_out[piece][k][0] = whole->weights[i][k][0];
        whole->weights_out[piece][k][1] = whole->weights[i][k][1];
    }
}

/* Whether the other diagonal is the shorter one, in a triangle with two cut edges. */
static bool other_is_shorter(const double a[3], const double b[3], const double c[3])
{
    double first[3], second[3];
    for (int k = 0; k < 3; k++) {
        first[k] = 0.5 * (a[k] + b[k]);
        second[k] = 0.5 * (b[k] + c[k]);
    }
    return squared_distance(first, c) < squared_distance(a, second);
}

/* Write the pieces of a triangle: `n_inner` + 1 of them, from row `piece`. */
static void write_pieces(
    const struct cutting *whole, const struct triangle *cut, int64_t i, int64_t piece,
    int64_t which, int64_t n_inner)
{
    for (int64_t k = 0; k < n_inner + 1; k++, piece++) {
        whole->base_faces_out[piece] = whole->base_faces[i];
        for (int corner = 0; corner < 3; corner++) {
            const int point = PIECES[which][k][corner];
            whole->faces_out[piece][corner] = cut->vertices[point];
            whole->face_edges_out[piece][corner] = cut->edges[PIECES[which][k][3 + corner]];
            whole->weights_out[piece][corner][0] = cut->weights[point][0];
            whole->weights_out[piece][corner][1] = cut->weights[point][1];
        }
    }
}

/* Write the pieces of triangles whose edges were halved. New inner edges come after the
   `n_halves` edges that there are. */
EXPORT void cut_triangles(
    int64_t n, int64_t n_edges, int64_t n_points, int64_t n_out, int64_t n_ends, int64_t n_places,
    const int32_t faces[n][3], const int32_t face_edges[n][3], const int32_t base_faces[n],
    const float weights[n][3][2], const int32_t ends[n_edges][2], const bool marked[n_edges],
    const int32_t halves[n_edges], const int32_t middles[n_edges],
    const double points[n_points][3], const int64_t added[n + 1], int64_t n_halves,
    int64_t n_vertices, int32_t faces_out[n_out][3], int32_t face_edges_out[n_out][3],
    int32_t base_faces_out[n_out], float weights_out[n_out][3][2], int32_t ends_out[n_ends][2],
    int32_t place_vertices[n_places], int32_t place_faces[n_places],
    float place_weights[n_places][2], int64_t start, int64_t stop)
{
    const struct cutting whole = {
        faces, face_edges, base_faces, weights, ends, halves, middles, marked, n_vertices,
        faces_out, face_edges_out, base_faces_out, weights_out,
        place_vertices, place_faces, place_weights,
    };
    struct triangle cut = {0};
    for (int64_t i = start; i < stop; i++) {
        const int64_t n_inner = added[i + 1] - added[i];
        int64_t which = n_inner;
        int first = 0;
        if (which == 0) {
            keep_triangle(&whole, i, i + added[i]);
            continue;
        }
        if (which == 1) {
            while (!marked[face_edges[i][first]])
                first++;
        } else if (which == 2) {
            while (marked[face_edges[i][(first + 2) % 3]])
                first++;
        }
        gather_triangle(&whole, i, first, added[i], &cut);
        const int32_t *at = cut.vertices;
        if (which == 2 && other_is_shorter(points[at[0]], points[at[1]], points[at[2]]))
            which = OTHER_DIAGONAL;
        for (int64_t k = 0; k < n_inner; k++) {
            const int64_t edge = n_halves + added[i] + k;
            cut.edges[6 + k] = (int32_t)edge;
            ends_out[edge][0] = cut.vertices[INNER[which][k][0]];
            ends_out[edge][1] = cut.vertices[INNER[which][k][1]];
        }
        write_pieces(&whole, &cut, i, i + added[i], which, n_inner);
    }
}
