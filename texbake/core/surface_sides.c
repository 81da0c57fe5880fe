/* Which side of a surface can be seen: whether it is closed, and which way its faces then point.

   In a closed surface with faces that agree, each edge is walked as often one way as the other. Sums
   of hashes tell the two apart, but for one chance in 2^64. The ends of an edge are known by their
   places, so that vertices split at a seam are one.

   Called from texbake/mesh/topology.py. */

#include <string.h>

#include "core.h"

/* Mix the bits of a number (the end of splitmix64 by Sebastiano Vigna). */
static inline uint64_t mixed(uint64_t bits)
{
    bits = (bits ^ bits >> 30) * 0xBF58476D1CE4E5B9u;
    bits = (bits ^ bits >> 27) * 0x94D049BB133111EBu;
    return bits ^ bits >> 31;
}

/* A key for the place of each vertex; 0.0 and -0.0 are equal. */
void hash_positions(
    int64_t n_vertices, const double positions[n_vertices][3], uint64_t keys[n_vertices],
    int64_t start, int64_t stop)
{
    for (int64_t vertex = start; vertex < stop; vertex++) {
        uint64_t key = 0x9E3779B97F4A7C15u;
        for (int k = 0; k < 3; k++) {
            const double x = positions[vertex][k] + 0.0;
            uint64_t bits;
            memcpy(&bits, &x, sizeof bits);
            key = mixed(key + bits) + 0x9E3779B97F4A7C15u;
        }
        keys[vertex] = key;
    }
}

static inline uint64_t edge(uint64_t from, uint64_t to)
{
    return mixed(from * 3 + to) - mixed(to * 3 + from);
}

/* Sum a hash of all edges of faces [start, stop), which is 0 if they are closed, and six times the
   volume that they enclose with `origin`. */
void sum_sides(
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
