/* Simplification by collapsing edges, shared by the files that the sections below name.

   Based on: Garland, Heckbert, "Surface simplification using quadric error metrics", 1997. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "arena.h"
#include "vectors.h"

/* p A p + 2 b p + c, with a symmetric matrix A. */
struct quadric {
    double xx, xy, xz, yy, yz, zz, bx, by, bz, c;
};

/* Add weight times the squared distance from the plane through a point, with a unit normal. */
static inline void add_plane(struct quadric *q, struct vector n, struct vector point, double weight)
{
    const double d = -dot(n, point);
    const struct vector scaled = {weight * n.x, weight * n.y, weight * n.z};
    q->xx += scaled.x * n.x;
    q->xy += scaled.x * n.y;
    q->xz += scaled.x * n.z;
    q->yy += scaled.y * n.y;
    q->yz += scaled.y * n.z;
    q->zz += scaled.z * n.z;
    q->bx += scaled.x * d;
    q->by += scaled.y * d;
    q->bz += scaled.z * d;
    q->c += weight * d * d;
}

/* Add weight times the squared distance from a point. */
static inline void add_point(struct quadric *q, struct vector point, double weight)
{
    q->xx += weight;
    q->yy += weight;
    q->zz += weight;
    q->bx -= weight * point.x;
    q->by -= weight * point.y;
    q->bz -= weight * point.z;
    q->c += weight * dot(point, point);
}

static inline struct quadric add_quadrics(const struct quadric *a, const struct quadric *b)
{
    return (struct quadric){
        a->xx + b->xx, a->xy + b->xy, a->xz + b->xz, a->yy + b->yy, a->yz + b->yz,
        a->zz + b->zz, a->bx + b->bx, a->by + b->by, a->bz + b->bz, a->c + b->c};
}

static inline struct quadric scaled_quadric(const struct quadric *q, double factor)
{
    return (struct quadric){
        factor * q->xx, factor * q->xy, factor * q->xz, factor * q->yy, factor * q->yz,
        factor * q->zz, factor * q->bx, factor * q->by, factor * q->bz, factor * q->c};
}

/* Half the gradient: A p + b. */
static inline struct vector half_gradient(const struct quadric *q, struct vector p)
{
    return (struct vector){
        q->xx * p.x + q->xy * p.y + q->xz * p.z + q->bx,
        q->xy * p.x + q->yy * p.y + q->yz * p.z + q->by,
        q->xz * p.x + q->yz * p.y + q->zz * p.z + q->bz};
}

static inline double quadric_at(const struct quadric *q, struct vector p)
{
    const struct vector b = {q->bx, q->by, q->bz};
    const double value = dot(half_gradient(q, p), p) + dot(b, p) + q->c;
    return value > 0.0 ? value : 0.0;
}

/* The step from a point to the least value; false where there is none to rounding. By Cholesky's
   factors, without square roots. */
static inline bool step_to_least(const struct quadric *q, struct vector from, struct vector *step)
{
    const struct vector g = half_gradient(q, from);
    const double least = 1e-14 * (q->xx + q->yy + q->zz);
    if (!(q->xx > least))
        return false;
    const double l1 = q->xy / q->xx, l2 = q->xz / q->xx;
    const double d1 = q->yy - l1 * q->xy, e = q->yz - l2 * q->xy;
    if (!(d1 > least))
        return false;
    const double l3 = e / d1, d2 = q->zz - l2 * q->xz - l3 * e;
    if (!(d2 > least))
        return false;
    const double y = g.y - l1 * g.x, z = (g.z - l2 * g.x - l3 * y) / d2;
    const double y2 = y / d1 - l3 * z;
    *step = (struct vector){-(g.x / q->xx - l1 * y2 - l2 * z), -y2, -z};
    return true;
}

/* collapsible_mesh.c */

/* Vertices with more corners than this stay: looking at them takes the square of it. */
enum { MOST_CORNERS = 512 };

/* What the faces around a vertex are: a ring, a fan that ends at two edges, or anything else. */
enum vertex_kind { INTERIOR, BOUNDARY, COMPLEX };

/* The corners of a vertex lie together in the pool of its mesh, where there may be room for more. */
struct corner_list {
    int64_t start;
    int32_t count, room;
};

/* The number of a vertex that is gone, and of its wedge. */
struct spare_vertex {
    int32_t vertex, wedge;
};

/* A vertex is a place. A wedge is what corners at a place share: a mesh with seams has several at
   some vertices, and one without has as many wedges as vertices. Corner 4 f + k is that of face f:
   rows of four numbers seldom lie in two cache lines. */
struct collapsible_mesh {
    int64_t n_vertices, n_faces, n_left;
    double (*points)[4]; /* and the error there */
    int32_t (*faces)[4]; /* the vertices of a face that is gone are -1 */
    int32_t (*wedges)[4]; /* the same array where vertices and wedges have the same numbers */
    struct corner_list *lists; /* of each vertex, in faces that are left */
    int32_t *pool, *spare_pool;
    int64_t n_pool, most_pool;
    uint8_t *kinds;
    bool is_mixed; /* some neighboring faces face opposite sides */
    bool *is_fixed;  /* stays, and where it is */
    bool *is_shared; /* used by faces beyond this mesh; such vertices get no new edge between them */
    double least_cosine; /* between the normals of a face before and after */
    /* Where there may be several vertices at a place, and NULL elsewhere: a wedge that was first at the
       place of each. Then vertices and wedges are the same, but for their numbers. */
    int32_t *copy_of;
    int64_t n_copies;
    bool may_cut; /* the topology may change, with vertices that are gone as second halves of others */
    struct spare_vertex *spares;
    int64_t n_spares;
    int32_t *twins; /* of each vertex, the next at its place; NULL where they may move apart */
    /* Scratch: */
    int32_t *marks, mark, *merged, *arcs;
};

/* Some corners, as a list of their numbers. */
struct corners {
    const int32_t *corners;
    int64_t n;
};

static inline struct corners corners_of(const struct collapsible_mesh *mesh, int32_t vertex)
{
    const struct corner_list *list = &mesh->lists[vertex];
    return (struct corners){mesh->pool + list->start, list->count};
}

/* The vertex one or two corners on in the face of a corner. */
static inline int32_t vertex_after(const struct collapsible_mesh *mesh, int32_t corner, int step)
{
    const int k = corner & 3;
    return mesh->faces[corner >> 2][step == 1 ? (k == 2 ? 0 : k + 1) : (k == 0 ? 2 : k - 1)];
}

static inline int32_t wedge_at(const struct collapsible_mesh *mesh, int32_t corner)
{
    return mesh->wedges[corner >> 2][corner & 3];
}

/* How many corners on from those of a vertex each of its neighbors is met. */
static inline int steps_to_neighbors(const struct collapsible_mesh *mesh, int32_t vertex)
{
    return mesh->kinds[vertex] == INTERIOR && !mesh->is_mixed ? 1 : 2;
}

/* A collapse that has been looked at: how many faces have the edge, and the wedges that become others;
   and where it changes the topology, the third vertex of a loop that is cut, or else -1, what becomes
   its second half, and whether the part vanishes. */
struct collapse {
    int n_faces;
    int32_t wedges_u[2], wedges_v[2], third, third_half;
    bool vanishes;
};

void prepare_mesh(struct arena *arena, struct collapsible_mesh *mesh);
bool can_collapse(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    struct collapse *collapse);
void collapse_edge(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    const struct collapse *collapse);
void take_merged(struct collapsible_mesh *mesh, int32_t vertex, int32_t n);

/* surface_surgery.c */

void find_twins(struct arena *arena, struct collapsible_mesh *mesh);
void leave_twins(struct collapsible_mesh *mesh, int32_t vertex);
bool doubles_edge(
    const struct collapsible_mesh *mesh, int32_t v, struct corners of_u, int32_t of_one);
void cut_loop(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    struct collapse *collapse);

/* carried_attributes.c */

/* Values of wedges. Wedges at one place that have a row in common share its value. */
struct attribute {
    int n_components;         /* 0 for a mesh without this attribute */
    const int32_t *row_of;    /* of each wedge */
    double *values;           /* of each row */
    bool is_unit;             /* of length 1 */
};

struct carried_attributes {
    struct attribute uvs, normals;
};

bool carry_attributes(
    const struct collapsible_mesh *mesh, const struct carried_attributes *attributes, int32_t u,
    int32_t v, struct vector place, const struct collapse *collapse);

/* carried_places.c */

/* Where the vertices were that came together at each, as lists that begin with its own place. */
struct carried_places {
    double (*points)[3]; /* NULL while nothing is carried */
    int32_t *first, *last, *next; /* the ends of each list, and what follows in it; -1 for none */
};

void begin_places(
    struct arena *arena, struct carried_places *places, int64_t n, const double (*points)[3]);
void join_places(struct carried_places *places, int32_t u, int32_t v);
void share_places(
    const struct collapsible_mesh *mesh, struct carried_places *places, const int32_t *vertex_ids,
    int32_t vertex, int32_t half);
double distance_of_places(
    const struct collapsible_mesh *mesh, const struct carried_places *places,
    const int32_t *vertex_ids, int32_t u, int32_t v, struct vector meeting, bool with_edges);

/* normal_quadrics.c */

/* Sums over faces of a weight, and of their normals as functions g p + d: of the functions, and of
   their squares. */
struct normal_quadric {
    struct quadric squares;
    double sums[3][4], weight;
};

void add_face_normals(
    const struct collapsible_mesh *mesh, const struct attribute *attribute,
    struct normal_quadric *quadrics);
void add_normal_quadrics(struct normal_quadric *to, const struct normal_quadric *added);
double normal_error(const struct normal_quadric *q, struct vector p, const double *normal);

/* quadric_simplification.c */

struct waiting {
    double cost;
    int32_t vertex;
};

/* Poses of all vertices, and their quadrics when the errors started again. */
struct poses {
    int64_t n, n_vertices;
    double (*points)[3];
    struct quadric *so_far;
};

struct simplification {
    struct collapsible_mesh mesh;
    struct carried_attributes attributes;
    struct carried_places places;
    bool moves; /* vertices go to the place of least error, else one end of the edge stays */
    uint8_t *n_wedges; /* of each vertex that may move: 1, 2 at a seam, and 3 for more */
    double *importance; /* of all vertices: what a face counts by, beside its area; NULL where all do */
    struct quadric *quadrics;
    struct normal_quadric *of_normals; /* of each row; NULL where they do not count */
    int64_t n_normals;
    double normal_weight; /* square of the distance that counts as much as a radian */
    struct quadric *so_far; /* of all vertices when the errors started again; NULL if they never do */
    int32_t *vertex_ids; /* which of those the vertices of the mesh are */
    int32_t *targets; /* of each vertex's cheapest collapse, -1 for none */
    double *errors;   /* of that collapse, without the distance of places */
    bool *is_measured; /* the distance of places has been added to its cost */
    struct waiting *heap; /* of the vertices, by the cost of those */
    int64_t n_heap;
    bool *is_waiting; /* in the heap */
    int64_t n_poses; /* whose errors count as well, each with points and quadrics of all vertices */
    double (*posed_points)[4]; /* and the error there */
    struct quadric *posed_quadrics;
    bool *is_stale;   /* something around it has changed since its collapse was chosen */
};

static inline double (*posed_points(const struct simplification *s, int64_t pose))[4]
{
    return s->posed_points + pose * s->mesh.n_vertices;
}

static inline struct quadric *posed_quadrics(const struct simplification *s, int64_t pose)
{
    return s->posed_quadrics + pose * s->mesh.n_vertices;
}

void begin_simplification(struct arena *arena, struct simplification *s, bool lock_boundary);
bool collapse_cheapest(
    struct simplification *s, int32_t *u, double *cost, struct collapse *collapse);
