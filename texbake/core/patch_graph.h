/* A patch of triangles and how they are connected, for other files of the core. */

#ifndef TEXBAKE_PATCH_GRAPH_H
#define TEXBAKE_PATCH_GRAPH_H

#include <stdbool.h>
#include <stdint.h>

struct arena;

/* A sparse matrix over the vertices of a patch has one row for each vertex: first the vertex itself,
   then those that it shares an edge with. What is assembled from triangles finds its entries there. */
struct patch {
    int64_t n, n_faces;
    const int32_t (*faces)[3];
    int64_t *row_starts;       /* entries of vertex i: row_starts[i] to row_starts[i + 1] - 1 */
    int32_t *columns;          /* the vertex of each entry; the first of row i is i */
    int32_t (*entries)[3][3];  /* of row corner i and column corner j of each triangle */
    int64_t n_edges;
    int32_t (*edges)[2];       /* boundary: edges of a single triangle, in its direction */
    int32_t *edge_loops;       /* loop of each; 0 for all if there are touching fans */
    int64_t n_loops;           /* 0 if there are touching fans */
    int32_t *loop_vertices;    /* loop by loop, each from its lowest vertex */
    int64_t *loop_starts;      /* n_loops + 1 */
    bool has_touching_fans;    /* more than one boundary edge leaves some vertex */
    bool is_disk;              /* connected, and a disk once all loops but one are filled */
};

/* Find the neighbors and the boundary; false without triangles, and if they do not form an oriented
   surface: an edge has more than two triangles, or two that run along it in one direction, or a
   triangle has a vertex twice. */
bool make_patch(
    struct arena *arena, int64_t n, int64_t n_faces, const int32_t (*faces)[3],
    struct patch *patch);

#endif
