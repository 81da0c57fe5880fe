/* The fans of MikkTSpace: faces around a vertex that are joined by edges and share a tangent.

   Based on: Morten S. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", master's thesis,
   University of Copenhagen, 2008; the rules are in texbake/mesh/tangents.py.

   Called from texbake/mesh/tangents.py. */

#include "core.h"

/* Pair edges of one key, first come, first served; `edges` lists them sorted by key. Edge 3 f + c of
   face f runs from the vertex in `starts`; its pair must run the other way. */
EXPORT void pair_edges(
    int64_t n, const int64_t keys[n], const int64_t edges[n], const int32_t starts[n],
    int32_t neighbors[n])
{
    int64_t waiting = 0; /* the first edge of this key that may be free; all free ones run its way */
    for (int64_t i = 0; i < n; i++) {
        const int64_t edge = edges[i];
        if (keys[edge] != keys[edges[waiting]])
            waiting = i;
        while (waiting < i && neighbors[edges[waiting]] >= 0)
            waiting++;
        const int64_t other = edges[waiting];
        if (starts[other] != starts[edge]) {
            neighbors[edge] = (int32_t)(other / 3);
            neighbors[other] = (int32_t)(edge / 3);
        }
    }
}

struct fan_mesh {
    const int32_t (*vertices)[3];
    const int32_t (*neighbors)[3];
    const bool *unmapped;
    bool *preserving;
    int32_t (*fans)[3];
};

/* Continue the fan of a corner across the edge that leaves it (side 0) or arrives (side 2). */
static void grow_fan(
    const struct fan_mesh *mesh, int64_t start, int corner, int side, int32_t fan)
{
    const int32_t vertex = mesh->vertices[start][corner];
    int64_t face = mesh->neighbors[start][(corner + side) % 3];
    while (face >= 0) {
        int32_t *fans = mesh->fans[face];
        int at = 0;
        while (mesh->vertices[face][at] != vertex)
            at++;
        if (fans[at] >= 0)
            return;
        const bool is_free = fans[0] < 0 && fans[1] < 0 && fans[2] < 0;
        if (mesh->unmapped[face] && is_free)
            mesh->preserving[face] = mesh->preserving[start];
        if (mesh->preserving[face] != mesh->preserving[start])
            return;
        fans[at] = fan;
        face = mesh->neighbors[face][(at + side) % 3];
    }
}

/* Number the fans: write each corner's fan and each fan's orientation; return how many. An unmapped
   face takes its orientation in `preserving` from the first fan that it joins. A fan is a path
   around its vertex: from the corner it starts at, first across the edge that leaves the vertex,
   then across the one that arrives. */
EXPORT int64_t number_fans(
    int64_t n_faces, int64_t n_corners, const int32_t vertices[n_faces][3],
    const int32_t neighbors[n_faces][3], const bool unmapped[n_faces], bool preserving[n_faces],
    int32_t fans[n_faces][3], bool fan_preserving[n_corners])
{
    const struct fan_mesh mesh = {vertices, neighbors, unmapped, preserving, fans};
    int32_t n_fans = 0;
    for (int64_t start = 0; start < n_faces; start++) {
        for (int corner = 0; corner < 3; corner++) {
            if (unmapped[start] || fans[start][corner] >= 0)
                continue;
            fans[start][corner] = n_fans;
            fan_preserving[n_fans] = preserving[start];
            grow_fan(&mesh, start, corner, 0, n_fans);
            grow_fan(&mesh, start, corner, 2, n_fans);
            n_fans++;
        }
    }
    return n_fans;
}
