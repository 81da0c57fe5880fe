/* Meshes of millions of triangles, brought down in pieces that fit a processor's cache.

   What lies on the border of a piece stays, and each piece lists what it collapsed and at which
   error, so that all pieces can be stopped at the same error. Other borders the next time reach what
   stayed. The pieces do not depend on the number of threads, and so neither does the result.

   Based on: Hoppe, "Progressive meshes", 1996 (the list of collapses, of which a first part is used);
   Hoppe, "Smooth view-dependent level-of-detail control and its application to terrain rendering",
   1998 (blocks whose borders stay).

   Called from texbake/mesh/decimate.py. */

#include <math.h>
#include <string.h>

#include "core.h"
#include "simplification.h"

/* Write which vertices have faces in more than one piece, of `piece` faces each. */
EXPORT int64_t mark_shared_vertices(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, const int32_t vertex_of[n_wedges],
    const int32_t faces[n_faces][3], int64_t piece, bool is_shared[n_vertices])
{
    OPEN_ARENA(arena);
    int32_t *pieces = TAKE(arena, int32_t, n_vertices);
    memset(pieces, 0xFF, (size_t)n_vertices * sizeof *pieces); /* -1 */
    for (int64_t face = 0; face < n_faces; face++) {
        for (int k = 0; k < 3; k++) {
            const int32_t vertex = vertex_of[faces[face][k]], here = (int32_t)(face / piece);
            is_shared[vertex] |= pieces[vertex] >= 0 && pieces[vertex] != here;
            pieces[vertex] = here;
        }
    }
    close_arena(arena);
    return 0;
}

/* How many looks at corners it takes at the least to collapse edges into vertices that have at least
   `crowd` corners: the squares of their numbers. */
EXPORT int64_t count_looks(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, const int32_t vertex_of[n_wedges],
    const int32_t faces[n_faces][3], int64_t crowd)
{
    OPEN_ARENA(arena);
    int32_t *counts = TAKE_ZEROS(arena, int32_t, n_vertices);
    for (int64_t face = 0; face < n_faces; face++)
        for (int k = 0; k < 3; k++)
            counts[vertex_of[faces[face][k]]]++;
    int64_t n_looks = 0;
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        n_looks += counts[vertex] >= crowd ? (int64_t)counts[vertex] * counts[vertex] : 0;
    close_arena(arena);
    return n_looks;
}

/* Number the wedges of faces, or their vertices, in the order in which they appear; write which they
   are, and return how many. */
static int32_t number_corners(
    struct arena *arena, int64_t n_faces, const int32_t (*faces)[3], const int32_t *vertex_of,
    int32_t (*numbers)[4], int32_t *firsts)
{
    int64_t size = 2;
    while (size < 6 * n_faces)
        size *= 2;
    const arena_mark mark = mark_arena(arena);
    int32_t *slots = TAKE(arena, int32_t, size);
    memset(slots, 0xFF, (size_t)size * sizeof *slots); /* -1 */
    int32_t n_ids = 0;
    for (int64_t face = 0; face < n_faces; face++) {
        for (int k = 0; k < 3; k++) {
            const int32_t id = vertex_of ? vertex_of[faces[face][k]] : faces[face][k];
            uint64_t slot = (uint32_t)id * 0x9E3779B97F4A7C15u >> 32 & (uint64_t)(size - 1);
            while (slots[slot] >= 0 && firsts[slots[slot]] != id)
                slot = (slot + 1) & (uint64_t)(size - 1);
            if (slots[slot] < 0) {
                slots[slot] = n_ids;
                firsts[n_ids++] = id;
            }
            numbers[face][k] = slots[slot];
        }
    }
    reset_arena(arena, mark);
    return n_ids;
}

/* Fill a mesh with some faces of wedges, numbered on their own; return which wedges they are. */
static int32_t *cut_out(
    struct arena *arena, int64_t n_faces, const int32_t (*faces)[3], const int32_t *vertex_of,
    bool has_seams, const double (*points)[3], const bool *is_shared, struct collapsible_mesh *mesh)
{
    int32_t *wedge_ids = TAKE(arena, int32_t, 3 * n_faces);
    int32_t *vertex_ids = TAKE(arena, int32_t, 3 * n_faces);
    mesh->n_faces = n_faces;
    mesh->faces = take(arena, n_faces, sizeof *mesh->faces);
    mesh->wedges = has_seams ? take(arena, n_faces, sizeof *mesh->wedges) : mesh->faces;
    int32_t n = number_corners(arena, n_faces, faces, NULL, mesh->wedges, wedge_ids);
    if (has_seams)
        n = number_corners(arena, n_faces, faces, vertex_of, mesh->faces, vertex_ids);
    for (int32_t wedge = 0; !has_seams && wedge < n; wedge++)
        vertex_ids[wedge] = vertex_of[wedge_ids[wedge]];
    mesh->n_vertices = n;
    mesh->points = take(arena, n, sizeof *mesh->points);
    mesh->is_fixed = TAKE(arena, bool, n);
    mesh->is_shared = TAKE(arena, bool, n);
    for (int32_t vertex = 0; vertex < n; vertex++) {
        memcpy(mesh->points[vertex], points[vertex_ids[vertex]], sizeof *points);
        mesh->is_fixed[vertex] = mesh->is_shared[vertex] = is_shared[vertex_ids[vertex]];
    }
    return wedge_ids;
}

/* Collapse edges of the piece of faces start to stop - 1 until `n_wanted` are left or an error is
   above `most_error`. Writes, from row `start` on, which wedge became which, the error, never less
   than that of the row before, and how many faces went with it. The remaining rows get an infinite error. */
EXPORT int64_t log_collapses(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, const int32_t vertex_of[n_wedges],
    const double points[n_vertices][3], const int32_t faces[n_faces][3],
    const bool is_shared[n_vertices], int64_t start, int64_t stop, int64_t n_wanted,
    float most_error, bool lock_boundary, int32_t gone[n_faces], int32_t kept[n_faces],
    float errors[n_faces], uint8_t n_gone_faces[n_faces])
{
    OPEN_ARENA(arena);
    struct simplification s = {.moves = false};
    const int32_t *wedge_ids = cut_out(
        arena, stop - start, faces + start, vertex_of, n_wedges != n_vertices, points, is_shared,
        &s.mesh);
    begin_simplification(arena, &s, lock_boundary);
    int64_t row = start;
    float error = 0.0f;
    int32_t u;
    double cost;
    struct collapse collapse;
    while (s.mesh.n_left > n_wanted && error <= most_error
           && collapse_cheapest(&s, &u, &cost, &collapse)) {
        error = (float)cost > error ? (float)cost : error;
        const int n_rows = collapse.wedges_u[0] == collapse.wedges_u[1] ? 1 : 2;
        for (int i = 0; i < n_rows; i++) {
            gone[row] = wedge_ids[collapse.wedges_u[i]];
            kept[row] = wedge_ids[collapse.wedges_v[i]];
            errors[row] = error;
            n_gone_faces[row++] = (uint8_t)(i == 0 ? collapse.n_faces : 0);
        }
    }
    for (int64_t empty = row; empty < stop; empty++) {
        errors[empty] = INFINITY;
        n_gone_faces[empty] = 0;
    }
    close_arena(arena);
    return row - start;
}

/* Add how many faces went to the bin of each error, its first bits; return how many bins are used. */
EXPORT int64_t add_by_error(
    int64_t n, int64_t n_bins, const float errors[n], const uint8_t n_gone[n], int64_t shift,
    int64_t bins[n_bins])
{
    uint32_t most = 0;
    for (int64_t i = 0; i < n; i++) {
        uint32_t bits;
        memcpy(&bits, &errors[i], sizeof bits);
        bins[bits >> shift] += n_gone[i];
        most = bits > most ? bits : most;
    }
    return (most >> shift) + 1;
}

/* Make the collapses with an error of at most `limit`, over faces that are overwritten by those that
   are left; return how many. */
EXPORT int64_t apply_collapses(
    int64_t n_wedges, int64_t n_faces, int64_t n_rows, const int32_t vertex_of[n_wedges],
    const int32_t gone[n_rows], const int32_t kept[n_rows], const float errors[n_rows], float limit,
    int32_t faces[n_faces][3])
{
    OPEN_ARENA(arena);
    int32_t *becomes = TAKE(arena, int32_t, n_wedges);
    for (int64_t wedge = 0; wedge < n_wedges; wedge++)
        becomes[wedge] = (int32_t)wedge;
    /* From the last row, so that what a wedge became has become what it is in the end. */
    for (int64_t row = n_rows - 1; row >= 0; row--)
        if (errors[row] <= limit)
            becomes[gone[row]] = becomes[kept[row]];
    int64_t n_left = 0;
    for (int64_t face = 0; face < n_faces; face++) {
        const int32_t a = becomes[faces[face][0]], b = becomes[faces[face][1]];
        const int32_t c = becomes[faces[face][2]];
        const int32_t u = vertex_of[a], v = vertex_of[b], w = vertex_of[c];
        if (u == v || v == w || w == u)
            continue;
        faces[n_left][0] = a;
        faces[n_left][1] = b;
        faces[n_left++][2] = c;
    }
    close_arena(arena);
    return n_left;
}
