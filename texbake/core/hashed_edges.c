/* Whether a surface is closed and its faces are consistent, by sums of hashes.

   Around a vertex of such a surface, each vertex that comes next in one face comes before in another,
   and each edge is walked as often one way as the other. Sums of hashes compare the two lists, or the
   two ways, with one chance of error in 2^64.

   Called from texbake/mesh/decimate.py and texbake/mesh/topology.py. */

#include <string.h>

#include "arena.h"
#include "core.h"

#define GOLDEN 0x9E3779B97F4A7C15u

/* Mix the bits of a number (the end of splitmix64 by Sebastiano Vigna). */
static inline uint64_t mixed(uint64_t bits)
{
    bits = (bits ^ bits >> 30) * 0xBF58476D1CE4E5B9u;
    bits = (bits ^ bits >> 27) * 0x94D049BB133111EBu;
    return bits ^ bits >> 31;
}

static inline uint64_t hash_of(int32_t id)
{
    return mixed(((uint64_t)(uint32_t)id + 1) * GOLDEN);
}

/* Count vertices at which the surface is open or not consistently oriented; faces are rows of wedges. */
EXPORT int64_t count_open_vertices(
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
        sums[a] += hash_of(b) - hash_of(c);
        sums[b] += hash_of(c) - hash_of(a);
        sums[c] += hash_of(a) - hash_of(b);
    }
    int64_t n_open = 0;
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        n_open += sums[vertex] != 0;
    close_arena(arena);
    return n_open;
}

/* A key for the position of each vertex, so that vertices split at a seam count as one; 0.0 and
   -0.0 are equal. */
EXPORT void hash_positions(
    int64_t n_vertices, const double positions[n_vertices][3], uint64_t keys[n_vertices],
    int64_t start, int64_t stop)
{
    for (int64_t vertex = start; vertex < stop; vertex++) {
        uint64_t key = GOLDEN;
        for (int k = 0; k < 3; k++) {
            const double x = positions[vertex][k] + 0.0;
            uint64_t bits;
            memcpy(&bits, &x, sizeof bits);
            key = mixed(key + bits) + GOLDEN;
        }
        keys[vertex] = key;
    }
}

static inline uint64_t edge(uint64_t from, uint64_t to)
{
    return mixed(from * 3 + to) - mixed(to * 3 + from);
}

/* Sum a hash of all edges of faces [start, stop), which is 0 for a closed surface, and six times
   the volume between the faces and `origin`. */
EXPORT void sum_sides(
    int64_t n_vertices, int64_t n_faces, int64_t n_bands, const double positions[n_vertices][3],
    const uint64_t keys[n_vertices], const int32_t faces[n_faces][3], const double origin[3],
    int64_t band, uint64_t edges[n_bands], double volumes[n_bands], int64_t start, int64_t stop)
{
    uint64_t sum = 0;
    double volume = 0.0;
    for (int64_t face = start; face < stop; face++) {
        const int32_t *corners = faces[face];
        const uint64_t a = keys[corners[0]], b = keys[corners[1]], c = keys[corners[2]];
        sum += edge(a, b) + edge(b, c) + edge(c, a);
        double p[3][3];
        for (int corner = 0; corner < 3; corner++) {
            for (int k = 0; k < 3; k++)
                p[corner][k] = positions[corners[corner]][k] - origin[k];
        }
        volume += p[0][0] * (p[1][1] * p[2][2] - p[1][2] * p[2][1])
                  + p[0][1] * (p[1][2] * p[2][0] - p[1][0] * p[2][2])
                  + p[0][2] * (p[1][0] * p[2][1] - p[1][1] * p[2][0]);
    }
    edges[band] = sum;
    volumes[band] = volume;
}
