/* Whether a surface is closed, its faces wound alike and its vertices not pinched.

   Around a vertex of such a surface, each vertex that comes next in one face comes before in another,
   and each edge is walked as often one way as the other. Sums of hashes compare the two lists, or the
   two ways, with one chance of error in 2^64. The faces around a vertex form rings, since each leads
   from its next corner to the one after; there must be one ring.

   Based on: R. Tarjan, "Efficiency of a good but not linear set union algorithm", 1975 (windings).

   Called from texbake/mesh/decimate.py and texbake/mesh/topology.py. */

#include <stdlib.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"

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

/* Mark vertices at which the surface is open or not consistently oriented; faces are rows of wedges. */
EXPORT int64_t mark_open_vertices(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, const int32_t vertex_of[n_wedges],
    const int32_t faces[n_faces][3], bool is_open[n_vertices])
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
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        is_open[vertex] = sums[vertex] != 0;
    close_arena(arena);
    return 0;
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

static int compare_ends(const void *one, const void *other)
{
    const uint32_t a = *(const uint32_t *)one, b = *(const uint32_t *)other;
    return (a > b) - (a < b);
}

/* Sort a few numbers by insertion, and many in time n log n. */
static void sort_ends(uint32_t *ends, int64_t n)
{
    if (n > 32) {
        qsort(ends, (size_t)n, sizeof *ends, compare_ends);
        return;
    }
    for (int64_t i = 1; i < n; i++) {
        const uint32_t end = ends[i];
        int64_t place = i;
        for (; place > 0 && ends[place - 1] > end; place--)
            ends[place] = ends[place - 1];
        ends[place] = end;
    }
}

/* List the edges of faces that have three vertices, each with its lesser vertex first, in their order;
   how many faces have each, and how many of those walk it upwards. Return how many edges there are. */
EXPORT int64_t list_edges(
    int64_t n_vertices, int64_t n_faces, int64_t n_most, const int32_t faces[n_faces][3],
    int32_t edges[n_most][2], int32_t n_with[n_most], int32_t n_upwards[n_most])
{
    OPEN_ARENA(arena);
    int64_t *places = TAKE_ZEROS(arena, int64_t, n_vertices + 1);
    for (int64_t face = 0; face < n_faces; face++) {
        const int32_t a = faces[face][0], b = faces[face][1], c = faces[face][2];
        if (a == b || b == c || c == a)
            continue;
        places[a < b ? a : b]++;
        places[b < c ? b : c]++;
        places[c < a ? c : a]++;
    }
    int64_t n = 0;
    for (int64_t vertex = 0; vertex <= n_vertices; vertex++) {
        const int64_t count = places[vertex];
        places[vertex] = n;
        n += count;
    }
    uint32_t *ends = TAKE(arena, uint32_t, n); /* twice the greater vertex, and 1 where it comes last */
    for (int64_t face = 0; face < n_faces; face++) {
        const int32_t *corners = faces[face];
        if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0])
            continue;
        for (int corner = 0; corner < 3; corner++) {
            const uint32_t tail = (uint32_t)corners[corner], head = (uint32_t)corners[(corner + 1) % 3];
            if (tail < head)
                ends[places[tail]++] = 2 * head + 1;
            else
                ends[places[head]++] = 2 * tail;
        }
    }
    int64_t n_edges = 0, start = 0;
    for (int64_t vertex = 0; vertex < n_vertices; start = places[vertex++]) {
        sort_ends(ends + start, places[vertex] - start);
        for (int64_t i = start; i < places[vertex]; i++) {
            const int32_t greater = (int32_t)(ends[i] >> 1);
            if (i == start || greater != edges[n_edges - 1][1]) {
                edges[n_edges][0] = (int32_t)vertex;
                edges[n_edges][1] = greater;
                n_with[n_edges] = n_upwards[n_edges] = 0;
                n_edges++;
            }
            n_with[n_edges - 1]++;
            n_upwards[n_edges - 1] += ends[i] & 1;
        }
    }
    close_arena(arena);
    return n_edges;
}

/* One end of the edge that starts at a corner (3 face + corner): the lesser or the greater number. */
static inline int32_t end_of(const int32_t *faces, int64_t corner, bool is_lesser)
{
    const int32_t tail = faces[corner], head = faces[corner % 3 == 2 ? corner - 2 : corner + 1];
    return (tail < head) == is_lesser ? tail : head;
}

/* Sort corners by one end of their edges; equal ones keep their order, which is that of the corners if
   `source` is NULL. `places` has n_vertices + 1. */
static void sort_by_end(
    int64_t n_vertices, int64_t n, const int32_t *faces, bool is_lesser, const int32_t *source,
    int32_t *target, int32_t *places)
{
    memset(places, 0, (size_t)(n_vertices + 1) * sizeof *places);
    for (int64_t corner = 0; corner < n; corner++)
        places[end_of(faces, corner, is_lesser) + 1]++;
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        places[vertex + 1] += places[vertex];
    for (int64_t i = 0; i < n; i++) {
        const int32_t corner = source ? source[i] : (int32_t)i;
        target[places[end_of(faces, corner, is_lesser)]++] = corner;
    }
}

/* List pairs of faces at the edges of exactly two, in the order of the edges' ends, whether the two run
   along the edge in opposite directions, and the faces at all other edges. `counts` are how many. */
EXPORT int64_t pair_faces(
    int64_t n_vertices, int64_t n_corners, int64_t n_most, const int32_t faces[n_corners],
    int64_t first[n_most], int64_t second[n_most], bool agree[n_most], int64_t others[n_corners],
    int64_t counts[2])
{
    OPEN_ARENA(arena);
    int32_t *by_greater = TAKE(arena, int32_t, n_corners), *order = TAKE(arena, int32_t, n_corners);
    int32_t *places = TAKE(arena, int32_t, n_vertices + 1);
    sort_by_end(n_vertices, n_corners, faces, false, NULL, by_greater, places);
    sort_by_end(n_vertices, n_corners, faces, true, by_greater, order, places);
    int64_t n_pairs = 0, n_others = 0;
    for (int64_t start = 0, stop; start < n_corners; start = stop) {
        const int32_t lesser = end_of(faces, order[start], true);
        const int32_t greater = end_of(faces, order[start], false);
        for (stop = start + 1; stop < n_corners; stop++)
            if (end_of(faces, order[stop], true) != lesser
                || end_of(faces, order[stop], false) != greater)
                break;
        if (stop - start == 2) {
            first[n_pairs] = order[start] / 3;
            second[n_pairs] = order[start + 1] / 3;
            /* At a single vertex, with no direction, both agree. */
            agree[n_pairs++] = faces[order[start]] != faces[order[start + 1]] || lesser == greater;
            continue;
        }
        for (int64_t i = start; i < stop; i++)
            others[n_others++] = order[i] / 3;
    }
    counts[0] = n_pairs;
    counts[1] = n_others;
    close_arena(arena);
    return 0;
}

/* A face's root, and whether the face is wound against it; `against` is flipped if so. */
static int64_t root_of(
    const int64_t *parents, const bool *flips, int64_t face, bool *against)
{
    while (parents[face] != face) {
        *against ^= flips[face];
        face = parents[face];
    }
    return face;
}

/* Let all faces from one up to its root lead there at once, so that no chain grows long. */
static void shorten_chain(int64_t *parents, bool *flips, int64_t face, int64_t root)
{
    bool against = false;
    root_of(parents, flips, face, &against);
    while (parents[face] != root && parents[face] != face) {
        const int64_t up = parents[face];
        const bool step = flips[face];
        parents[face] = root;
        flips[face] = against;
        against ^= step;
        face = up;
    }
}

/* Join neighbors, each with whether it is wound against its parent; the least is the root. `along`
   says whether both of a pair run along their edge in the same direction. */
EXPORT void join_orientations(
    int64_t n, int64_t n_pairs, int64_t parents[n], bool flips[n], const int64_t one[n_pairs],
    const int64_t other[n_pairs], const bool along[n_pairs])
{
    for (int64_t i = 0; i < n_pairs; i++) {
        bool differ = along[i];
        const int64_t a = root_of(parents, flips, one[i], &differ);
        const int64_t b = root_of(parents, flips, other[i], &differ);
        const int64_t root = min_i64(a, b), child = max_i64(a, b);
        if (child != root) {
            parents[child] = root;
            flips[child] = differ;
        }
        shorten_chain(parents, flips, one[i], root);
        shorten_chain(parents, flips, other[i], root);
    }
    for (int64_t face = 0; face < n; face++) {
        /* Parents are lower than their children, and so already lead to the root. */
        const int64_t up = parents[face];
        if (parents[up] != up) {
            flips[face] ^= flips[up];
            parents[face] = parents[up];
        }
    }
}
