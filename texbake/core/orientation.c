/* Which faces are wound alike, from pairs of neighbors; by union-find.

   Based on: R. Tarjan, "Efficiency of a good but not linear set union algorithm", 1975.

   Called from texbake/mesh/topology.py. */

#include "core.h"
#include "numbers.h"

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
