/* A mesh whose edges can be collapsed one after the other, so that its topology stays; see
   collapsible_mesh.c. */

#ifndef TEXBAKE_COLLAPSIBLE_MESH_H
#define TEXBAKE_COLLAPSIBLE_MESH_H

#include <stdbool.h>
#include <stdint.h>

#include "arena.h"
#include "vectors.h"

/* Vertices with more corners than this stay: looking at them takes the square of it. */
enum { MOST_CORNERS = 512 };

/* What the faces around a vertex are: a ring, a fan that ends at two edges, or anything else. */
enum vertex_kind { INTERIOR, BOUNDARY, COMPLEX };

/* A vertex is a place. A wedge is what corners at a place share: a mesh with seams has several at
   some vertices, and one without has as many wedges as vertices. Corner 3 f + k is that of face f. */
struct collapsible_mesh {
    int64_t n_vertices, n_faces, n_left;
    double (*points)[3];
    int32_t (*faces)[3];   /* the vertices of a face that is gone are -1 */
    int32_t (*wedges)[3];
    int32_t *next_corners; /* of the same vertex, -1 behind the last */
    int32_t *first_corners;
    uint8_t *kinds;
    bool is_mixed; /* some neighboring faces face opposite sides */
    bool *is_fixed;  /* stays, and where it is */
    bool *is_shared; /* used by faces beyond this mesh; such vertices get no new edge between them */
    double least_cosine; /* between the normals of a face before and after */
    /* Scratch: */
    int32_t *marks, mark;
    int32_t *corners_u, *corners_v;
};

/* The vertex of a corner, -1 in a face that is gone. */
static inline int32_t vertex_at_corner(const struct collapsible_mesh *mesh, int32_t corner)
{
    const int32_t *vertices = mesh->faces[0];
    return vertices[corner];
}

/* The vertex one or two corners on in the face of a corner. */
static inline int32_t vertex_after(const struct collapsible_mesh *mesh, int32_t corner, int step)
{
    const int k = corner % 3;
    return vertex_at_corner(mesh, corner + (step == 1 ? (k == 2 ? -2 : 1) : (k == 0 ? 2 : -1)));
}

/* A collapse that has been looked at: how many faces have the edge, and the wedges that become
   others. */
struct collapse {
    int n_faces;
    int32_t wedges_u[2], wedges_v[2];
};

void prepare_mesh(struct arena *arena, struct collapsible_mesh *mesh);
int64_t list_corners(struct collapsible_mesh *mesh, int32_t vertex, int32_t *corners);
bool can_collapse(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    struct collapse *collapse);
void collapse_edge(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    const struct collapse *collapse);

#endif
