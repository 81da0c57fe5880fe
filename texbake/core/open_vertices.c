/* Vertices at which a surface is open, or not consistently oriented.

   Around any other vertex, the vertices that come next in its faces are those that come before. Sums
   of hashes tell the two lists apart, but for one chance in 2^64.

   Called from texbake/mesh/decimate.py. */

#include "arena.h"
#include "core.h"

/* Mix the bits of a number (the end of splitmix64 by Sebastiano Vigna). */
static inline uint64_t hash(int32_t id)
{
    uint64_t mixed = ((uint64_t)(uint32_t)id + 1) * 0x9E3779B97F4A7C15u;
    mixed = (mixed ^ mixed >> 30) * 0xBF58476D1CE4E5B9u;
    mixed = (mixed ^ mixed >> 27) * 0x94D049BB133111EBu;
    return mixed ^ mixed >> 31;
}

/* Count them among the vertices of wedges; faces are rows of wedges. */
int64_t count_open_vertices(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, const int32_t vertex_of[n_wedges],
    const int32_t faces[n_faces][3])
{
    OPEN_ARENA(arena);
    uint64_t *sums = TAKE_ZEROS(arena, uint64_t, n_vertices);
    for (int64_t face = 0; face < n_faces; face++) {
        const int32_t a = vertex_of[faces[face][0]], b = vertex_of[faces[face][1]];
        const int32_t c = vertex_of[faces[face][2]];
        if (a == b || b == c || c == a)
            continue;
        sums[a] += hash(b) - hash(c);
        sums[b] += hash(c) - hash(a);
        sums[c] += hash(a) - hash(b);
    }
    int64_t n_open = 0;
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        n_open += sums[vertex] != 0;
    close_arena(arena);
    return n_open;
}
