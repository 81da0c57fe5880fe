/* Patches of triangles and how they are flattened, shared by the files that the sections below name. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

struct arena;

/* patch_graph.c */

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

/* conjugate_gradient.c */

/* A symmetric matrix of 2 x 2 blocks in compressed rows, as in `Patch`: the first entry of a row
   lies on the diagonal, and an entry's block is stored column by column. */
struct block_matrix {
    int64_t n;
    const int64_t *row_starts;
    const int32_t *columns;
    const double (*blocks)[4];
};

int64_t solve_block_system(
    struct arena *arena, const struct block_matrix *matrix, const double (*target)[2],
    const double (*uvs)[2], const int32_t *regions, double (*solution)[2], double tolerance,
    int64_t n_iterations);

/* Write the region of each vertex, from 0 without gaps; all 0 if the patch is too small for it to
   pay. */
void divide_regions(
    struct arena *arena, int64_t n, const double (*uvs)[2], int32_t *regions);

/* boundary_meeting.c */

/* Borders count as touching, not overlapping, up to this share of the longer side of the layout:
   2^-21. */
#define TOUCH_DEPTH (1.0 / (1 << 21))

/* How edges meet, the least first. */
enum { APART, TOUCHING, CROSSING };

/* Directed edges between vertices of a layout, and the loop of each. */
struct boundary {
    int64_t n_edges;
    const int32_t (*edges)[2];
    const int32_t *loops;
};

int64_t boundary_meets(
    struct arena *arena, const double (*uvs)[2], const struct boundary *boundary);

/* planar_overlap.c */

/* Number of faces that overlap faces of lower numbers by more than `depth`, once these are out of
   the way themselves. */
int64_t count_overlaps(
    struct arena *arena, const double (*uvs)[2], int64_t n_faces, const int32_t (*faces)[3],
    double depth);

/* tutte.c */

/* Lay out a disk in the unit circle, without flips as far as float64 can resolve its corners; holes
   are filled by fans. False if a hole cannot be filled, because an edge across it already exists.
   `tolerance` is that of the linear system. */
bool lay_in_circle(
    struct arena *arena, const struct patch *patch, const double (*points)[3], double tolerance,
    double (*uvs)[2]);

/* Move the vertices that are not `fixed` to the weighted mean of their neighbors. */
void embed(
    struct arena *arena, const struct patch *patch, const double (*points)[3], const bool *fixed,
    double tolerance, double (*uvs)[2]);

/* symmetric_dirichlet.c */

/* Triangles of a patch, and their shapes in space: gradients of the three hat functions in the plane
   of each, and its area. J = Σ u_k ⊗ gradients[k] with the flat corners u_k. */
struct shapes {
    int64_t n_faces;
    const int32_t (*faces)[3];
    double (*gradients)[3][2];
    double *areas;
};

/* Means over a layout without flips of σ1² + σ2², of σ1⁻² + σ2⁻², and of σ1 σ2. */
struct stretches {
    double dirichlet, inverse, growth;
};

/* Shapes of triangles; thin and small ones are widened. */
struct shapes rest_shapes(
    struct arena *arena, int64_t n_faces, const int32_t (*faces)[3], const double (*points)[3]);

/* Total energy; infinite where a triangle is flipped or has no area. */
double energy_of(const double (*uvs)[2], const struct shapes *shapes);

struct stretches stretches_of(const double (*uvs)[2], const struct shapes *shapes);

/* When to stop: after so many steps, or after one that gains less than `accuracy`, as a share of the
   energy above its minimum. */
struct limits {
    int64_t n_iterations;
    double accuracy;
    bool keep_apart; /* edges of the boundary never cross, in any step */
    const bool *fixed; /* vertices that stay where they are; NULL for none */
};

/* Minimize the energy from a layout without flips, in place; return the number of steps. */
int64_t minimize_energy(
    struct arena *arena, const struct patch *patch, const struct shapes *shapes,
    const int32_t *regions, struct limits limits, double (*uvs)[2]);

/* flatten.c */

/* A layout about the origin with the area that the patch has in space. */
struct flat {
    double l2;         /* stretch (Sander et al. 2001): √ of the mean of (Γ² + γ²) / 2, 1 at best */
    double energy;     /* mean of the symmetric Dirichlet energy, 4 at best */
    bool is_injective; /* no two triangles overlap */
};

/* Flatten a patch from the layout in `uvs` if `has_start` and it has no flips, else from the circle;
   false if there is no start. `uvs` gets the layout. */
bool flatten(
    struct arena *arena, const struct patch *patch, const double (*points)[3], bool has_start,
    struct limits limits, double (*uvs)[2], struct flat *flat);

/* L∞ stretch of a triangle (Sander et al. 2001), by the indices of its corners in space and in the layout;
   1 without area. */
double stretch_of_face(
    const double (*points)[3], const int32_t corners[3], const double (*uvs)[2],
    const int32_t flat_corners[3]);

/* Whether no two triangles of a layout without flips overlap. */
bool is_injective(struct arena *arena, const double (*uvs)[2], const struct patch *patch);
