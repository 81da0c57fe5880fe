/* Surfaces that touch, taken apart; and surfaces cut along a loop of three edges.

   Where an edge has more than two faces, the two that bound a solid between them belong together, and
   a vertex whose faces do not all hang together then becomes several at one place.

   When u goes to v and the two have a neighbor in common that is not opposite to their edge, the three
   edges between them are a loop around a neck or a tunnel, which closes. The surface is cut along it:
   v and the third vertex become two each, so that the surface stays one. A tetrahedron, or what else has
   come down to two faces, vanishes.

   Based on: Guéziec, Taubin, Lazarus, Horn, "Cutting and stitching: converting sets of polygons to
   manifold surfaces", IEEE Transactions on Visualization and Computer Graphics 7, 2001.

   Called from texbake/mesh/decimate.py and quadric_simplification.c. */

#include <math.h>
#include <string.h>

#include "core.h"
#include "simplification.h"
#include "union_find.h"

enum { MOST_AT_EDGE = 16 }; /* An edge of more faces stays as it is. */

/* Faces at this angle, a right angle being 1, lie on one another: as between bricks, the solids are on
   their other sides. */
static const double COINCIDENT = 1e-6;

/* The faces at an edge, and which of them belong together: -1 for one that has no partner. */
struct edge_faces {
    int n;
    int32_t at[MOST_AT_EDGE], partners[MOST_AT_EDGE]; /* places among the corners of a vertex */
    bool is_forward[MOST_AT_EDGE];
    double turns[MOST_AT_EDGE]; /* around the edge, a right angle is 1 */
};

/* From 0 to 4, growing with the angle of a direction. */
static double turns_of(double x, double y)
{
    const double size = fabs(x) + fabs(y);
    const double turn = size > 0.0 ? fabs(y) / size : 0.0;
    return x >= 0.0 ? (y >= 0.0 ? turn : 4.0 - turn) : (y >= 0.0 ? 2.0 - turn : 2.0 + turn);
}

/* List the faces of the edge between two vertices among the corners of the first; false where there
   are too many. */
static bool list_faces_at(
    const struct collapsible_mesh *mesh, int32_t vertex, int32_t other, struct edge_faces *edge)
{
    const struct corners around = corners_of(mesh, vertex);
    const int32_t tail = vertex < other ? vertex : other, head = vertex < other ? other : vertex;
    const struct vector from = vector_at(mesh->points[tail]);
    const struct vector along = minus(vector_at(mesh->points[head]), from);
    const double squared = dot(along, along);
    struct vector first = {0}, upright = {0};
    edge->n = 0;
    for (int32_t i = 0; i < around.n; i++) {
        for (int step = 1; step <= 2; step++) {
            if (vertex_after(mesh, around.corners[i], step) != other)
                continue;
            if (edge->n == MOST_AT_EDGE)
                return false;
            const int32_t third = vertex_after(mesh, around.corners[i], 3 - step);
            struct vector out = minus(vector_at(mesh->points[third]), from);
            if (squared > 0.0)
                out = weighted(out, along, 1.0, -dot(out, along) / squared);
            if (edge->n == 0) {
                first = out;
                const struct vector across = cross(along, out);
                const double length = sqrt(squared);
                upright = weighted(across, across, length > 0.0 ? 1.0 / length : 0.0, 0.0);
            }
            edge->is_forward[edge->n] = (step == 1) == (vertex == tail);
            edge->turns[edge->n] = turns_of(dot(out, first), dot(out, upright));
            edge->partners[edge->n] = -1;
            edge->at[edge->n++] = i;
        }
    }
    return true;
}

/* Pair faces of opposite windings, those that bound the narrowest solid first; false where one is
   left over. Unless it `opens` such edges, two faces are a pair however they are wound. */
static bool pair_faces_at(struct edge_faces *edge, bool opens)
{
    if (edge->n == 2 && !opens) {
        edge->partners[0] = 1;
        edge->partners[1] = 0;
        return true;
    }
    int n_left = edge->n;
    while (true) {
        double least = INFINITY;
        int one = -1, other = -1;
        for (int i = 0; i < edge->n; i++) {
            for (int j = 0; j < edge->n; j++) {
                if (edge->partners[i] >= 0 || edge->partners[j] >= 0 || !edge->is_forward[i]
                    || edge->is_forward[j])
                    continue;
                const double turn = edge->turns[i] - edge->turns[j];
                const double gap = turn < COINCIDENT ? turn + 4.0 : turn;
                if (gap < least) {
                    least = gap;
                    one = i;
                    other = j;
                }
            }
        }
        if (one < 0)
            return n_left == 0;
        edge->partners[one] = other;
        edge->partners[other] = one;
        n_left -= 2;
    }
}

/* Label the corners of a vertex by what hangs together there. */
static void label_corners(
    const struct collapsible_mesh *mesh, int32_t vertex, int64_t opens, int32_t *labels)
{
    const struct corners around = corners_of(mesh, vertex);
    const int32_t n = (int32_t)around.n;
    bool is_whole = n <= MOST_CORNERS;
    for (int32_t i = 0; i < n; i++)
        labels[i] = is_whole ? i : 0;
    for (int32_t i = 0; i < n && is_whole; i++) {
        for (int step = 1; step <= 2 && is_whole; step++) {
            struct edge_faces edge;
            const int32_t other = vertex_after(mesh, around.corners[i], step);
            is_whole = list_faces_at(mesh, vertex, other, &edge)
                && (edge.n == 1 || pair_faces_at(&edge, opens > 0) || opens > 0);
            if (opens > 1 && edge.n > 2)
                continue;
            for (int k = 0; k < edge.n && is_whole; k++)
                if (edge.partners[k] >= 0)
                    join_labels(labels, edge.at[k], edge.at[edge.partners[k]]);
        }
    }
    for (int32_t i = 0; i < n && !is_whole; i++)
        labels[i] = 0;
    number_labels(labels, n);
}

/* Write for each corner which of the vertices at its place it gets, from 0 on. Edges with a face that
   has no partner of the other winding stay if `opens` is 0; if it is 2, all of more than two faces
   open. Returns how many vertices are added. */
EXPORT int64_t separate_surfaces(
    int64_t n_vertices, int64_t n_faces, const int32_t faces[n_faces][3],
    const double points[n_vertices][3], int64_t opens, int32_t copies[n_faces][3])
{
    OPEN_ARENA(arena);
    struct collapsible_mesh mesh = {.n_vertices = n_vertices, .n_faces = n_faces};
    mesh.faces = take(arena, n_faces, sizeof *mesh.faces);
    mesh.points = take(arena, n_vertices, sizeof *mesh.points);
    for (int64_t face = 0; face < n_faces; face++)
        memcpy(mesh.faces[face], faces[face], sizeof *faces);
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        memcpy(mesh.points[vertex], points[vertex], sizeof *points);
    mesh.wedges = mesh.faces;
    prepare_mesh(arena, &mesh);
    memset(copies, 0, (size_t)n_faces * sizeof *copies);
    int32_t *labels = TAKE(arena, int32_t, 3 * n_faces);
    int64_t n_added = 0;
    for (int32_t vertex = 0; vertex < n_vertices; vertex++) {
        const struct corners around = corners_of(&mesh, vertex);
        if (around.n == 0 || !(mesh.kinds[vertex] == COMPLEX || (opens && mesh.is_mixed)))
            continue;
        label_corners(&mesh, vertex, opens, labels);
        int32_t most = 0;
        for (int64_t i = 0; i < around.n; i++) {
            copies[around.corners[i] >> 2][around.corners[i] & 3] = labels[i];
            most = labels[i] > most ? labels[i] : most;
        }
        n_added += most;
    }
    close_arena(arena);
    return n_added;
}

/* Link the vertices at each place in a ring. */
void find_twins(struct arena *arena, struct collapsible_mesh *mesh)
{
    int32_t *at = TAKE(arena, int32_t, mesh->n_copies);
    memset(at, 0xFF, (size_t)mesh->n_copies * sizeof *at); /* -1 */
    mesh->twins = TAKE(arena, int32_t, mesh->n_vertices);
    for (int32_t vertex = 0; vertex < mesh->n_vertices; vertex++) {
        int32_t *first = &at[mesh->copy_of[wedge_at(mesh, corners_of(mesh, vertex).corners[0])]];
        mesh->twins[vertex] = *first < 0 ? vertex : mesh->twins[*first];
        if (*first < 0)
            *first = vertex;
        else
            mesh->twins[*first] = vertex;
    }
}

void leave_twins(struct collapsible_mesh *mesh, int32_t vertex)
{
    int32_t before = vertex;
    while (mesh->twins[before] != vertex)
        before = mesh->twins[before];
    mesh->twins[before] = mesh->twins[vertex];
    mesh->twins[vertex] = vertex;
}

/* Whether an edge between v and a neighbor of u, marked with `of_one`, would lie on one between others
   at their places. */
bool doubles_edge(
    const struct collapsible_mesh *mesh, int32_t v, struct corners of_u, int32_t of_one)
{
    for (int64_t i = 0; i < 2 * of_u.n && mesh->twins[v] != v; i++) {
        const int32_t end = vertex_after(mesh, of_u.corners[i / 2], 1 + (i & 1));
        if (mesh->marks[end] != of_one || mesh->twins[end] == end)
            continue;
        for (int32_t twin = mesh->twins[v]; twin != v; twin = mesh->twins[twin]) {
            const struct corners around = corners_of(mesh, twin);
            for (int64_t j = 0; j < 2 * around.n; j++) {
                const int32_t other = vertex_after(mesh, around.corners[j / 2], 1 + (j & 1));
                int32_t at = mesh->twins[end];
                while (at != end && at != other)
                    at = mesh->twins[at];
                if (at == other)
                    return true;
            }
        }
    }
    return false;
}

static void join_twins(struct collapsible_mesh *mesh, int32_t vertex, int32_t half)
{
    mesh->twins[half] = mesh->twins[vertex];
    mesh->twins[vertex] = half;
}

/* List the corners around a vertex from the neighbor `from` on until another, as a closed surface winds
   them; return how many. */
static int32_t list_arc(
    const struct collapsible_mesh *mesh, int32_t vertex, int32_t from, int32_t to, int32_t *arc)
{
    const struct corners around = corners_of(mesh, vertex);
    int32_t n = 0;
    for (int32_t at = from; at != to && n < around.n;) {
        int64_t i = 0;
        while (i < around.n - 1 && vertex_after(mesh, around.corners[i], 1) != at)
            i++;
        arc[n++] = around.corners[i];
        at = vertex_after(mesh, around.corners[i], 2);
    }
    return n;
}

/* Give some corners to another vertex. */
static void give_corners(
    struct collapsible_mesh *mesh, const int32_t *arc, int32_t n, int32_t vertex, int32_t wedge)
{
    for (int32_t i = 0; i < n; i++) {
        mesh->faces[arc[i] >> 2][arc[i] & 3] = vertex;
        mesh->wedges[arc[i] >> 2][arc[i] & 3] = wedge;
    }
}

/* Bring the corners of a vertex that it still has to the front; return how many. */
static int32_t keep_own(struct collapsible_mesh *mesh, int32_t vertex)
{
    struct corner_list *list = &mesh->lists[vertex];
    int32_t *corners = mesh->pool + list->start, n = 0;
    for (int32_t i = 0; i < list->count; i++) {
        const int32_t corner = corners[i];
        if (mesh->faces[corner >> 2][corner & 3] != vertex)
            continue;
        corners[i] = corners[n];
        corners[n++] = corner;
    }
    return n;
}

/* Let u go to v, and cut the surface along their loop with a third vertex: u becomes the second half
   of v, and a vertex that has gone that of the third. */
void cut_loop(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    struct collapse *collapse)
{
    const int32_t x = collapse->third;
    const struct spare_vertex half = mesh->spares[--mesh->n_spares];
    collapse->third_half = half.vertex;
    /* Of the arcs around u and v, the faces of their edge go with it. */
    int32_t *arc = mesh->arcs;
    const int32_t n_u = list_arc(mesh, u, x, v, arc) - 1;
    const int32_t n = n_u + list_arc(mesh, v, u, x, arc + n_u) - 1;
    memmove(arc + n_u, arc + n_u + 1, (size_t)(n - n_u) * sizeof *arc);
    int32_t *arc_x = arc + n;
    const int32_t n_x = list_arc(mesh, x, v, u, arc_x);
    const int32_t wedge_x = wedge_at(mesh, arc_x[0]);
    collapse->third = -1;
    collapse_edge(mesh, u, v, place, collapse);
    mesh->n_spares--; /* u is used again */
    collapse->third = x;
    give_corners(mesh, arc, n, u, collapse->wedges_u[0]);
    give_corners(mesh, arc_x, n_x, half.vertex, half.wedge);
    mesh->copy_of[collapse->wedges_u[0]] = mesh->copy_of[collapse->wedges_v[0]];
    mesh->copy_of[half.wedge] = mesh->copy_of[wedge_x];
    mesh->lists[v].count = keep_own(mesh, v);
    memcpy(mesh->merged, arc, (size_t)n * sizeof *arc);
    take_merged(mesh, u, n);
    struct corner_list *list = &mesh->lists[x];
    list->count = list->room = keep_own(mesh, x);
    mesh->lists[half.vertex] = (struct corner_list){list->start + list->count, n_x, n_x};
    memcpy(mesh->points[u], mesh->points[v], sizeof *mesh->points);
    memcpy(mesh->points[half.vertex], mesh->points[x], sizeof *mesh->points);
    mesh->kinds[u] = mesh->kinds[half.vertex] = INTERIOR;
    if (mesh->twins == NULL)
        return;
    join_twins(mesh, v, u);
    join_twins(mesh, x, half.vertex);
}
