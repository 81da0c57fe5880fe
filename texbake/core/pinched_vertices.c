/* Vertices at which more than one fan of faces meets, in a closed and oriented mesh.

   Around a vertex each face leads from its next corner to the one after. In such a mesh each of
   those is led to once, so that the faces form rings; there must be one ring.

   Called from texbake/mesh/topology.py. */

#include "arena.h"
#include "core.h"

/* List the corners (3 face + corner) of each vertex, in their order; `starts` has n_vertices + 1. */
static void list_corners(
    struct arena *arena, int64_t n_vertices, int64_t n_faces, const int32_t (*faces)[3],
    int64_t *starts, int64_t *corners)
{
    for (int64_t face = 0; face < n_faces; face++)
        for (int corner = 0; corner < 3; corner++)
            starts[faces[face][corner] + 1]++;
    int64_t *fill = TAKE(arena, int64_t, n_vertices);
    for (int64_t vertex = 0; vertex < n_vertices; vertex++) {
        fill[vertex] = starts[vertex];
        starts[vertex + 1] += starts[vertex];
    }
    for (int64_t face = 0; face < n_faces; face++)
        for (int corner = 0; corner < 3; corner++)
            corners[fill[faces[face][corner]]++] = 3 * face + corner;
}

/* Return 1 if some vertex has more than one fan of faces, else 0. */
EXPORT int64_t has_pinched_vertex(
    int64_t n_vertices, int64_t n_faces, const int32_t faces[n_faces][3])
{
    OPEN_ARENA(arena);
    int64_t *starts = TAKE_ZEROS(arena, int64_t, n_vertices + 1);
    int64_t *corners = TAKE(arena, int64_t, 3 * n_faces);
    list_corners(arena, n_vertices, n_faces, faces, starts, corners);
    int32_t *leads_to = TAKE_ZEROS(arena, int32_t, n_vertices);
    int64_t is_pinched = 0;
    for (int64_t vertex = 0; vertex < n_vertices && !is_pinched; vertex++) {
        const int64_t n_around = starts[vertex + 1] - starts[vertex];
        int32_t first = -1;
        for (int64_t slot = starts[vertex]; slot < starts[vertex + 1]; slot++) {
            const int64_t face = corners[slot] / 3, corner = corners[slot] % 3;
            first = faces[face][(corner + 1) % 3];
            leads_to[first] = faces[face][(corner + 2) % 3];
        }
        int32_t at = first;
        int64_t n_steps = 0;
        while (n_steps < n_around) {
            at = leads_to[at];
            n_steps++;
            if (at == first)
                break;
        }
        is_pinched = n_steps < n_around;
    }
    close_arena(arena);
    return is_pinched;
}
