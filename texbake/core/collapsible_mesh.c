/* Edge collapses that leave a surface a surface, of the same topology.

   An edge of vertices u and v collapses where their neighbors in common are just the vertices
   opposite to it (the link condition), a boundary stays a boundary, each side of a seam has a
   counterpart at v, and no face flips. What is not a surface around a vertex keeps that vertex.

   Based on: Dey, Edelsbrunner, Guha, Nekhayev, "Topology preserving edge contraction", Publications
   de l'Institut Mathématique 66, 1999 (the link condition); Hoppe, "New quadric metric for
   simplifying meshes with appearance attributes", 1999 (wedges).

   Called from quadric_simplification.c. */

#include "simplification.h"

#include <math.h>
#include <string.h>


/* List the corners of a vertex in faces that are left, and forget the others. */
int64_t list_corners(struct collapsible_mesh *mesh, int32_t vertex, int32_t *corners)
{
    int64_t n = 0;
    int32_t *link = &mesh->first_corners[vertex];
    while (*link >= 0) {
        const int32_t corner = *link;
        if (vertex_at_corner(mesh, corner) < 0) {
            *link = mesh->next_corners[corner];
        } else {
            corners[n++] = corner;
            link = &mesh->next_corners[corner];
        }
    }
    return n;
}

/* Whether the faces at these corners follow one another around their vertex, once, whichever way each
   of them is wound; `is_mixed` becomes true where two run along an edge the same way. */
static enum vertex_kind kind_of(
    const struct collapsible_mesh *mesh, int64_t n, const int32_t *corners, bool *is_mixed)
{
    if (n == 0 || n > MOST_CORNERS)
        return COMPLEX;
    int32_t sides[2][MOST_CORNERS]; /* the neighbors that the face of each corner has */
    for (int64_t i = 0; i < n; i++)
        for (int side = 0; side < 2; side++)
            sides[side][i] = vertex_after(mesh, corners[i], side + 1);
    int64_t at = 0, n_open = 0;
    int from = 0; /* the side that the walk around the vertex comes from */
    bool runs_alike = false;
    for (int64_t i = 0; i < n; i++) {
        for (int side = 0; side < 2; side++) {
            int64_t n_alike = 0, n_against = 0;
            for (int64_t j = 0; j < n; j++) {
                n_alike += sides[side][j] == sides[side][i];
                n_against += sides[!side][j] == sides[side][i];
            }
            if (n_alike + n_against > 2)
                return COMPLEX;
            runs_alike = runs_alike || n_alike > 1;
            if (n_alike + n_against == 1) {
                at = i;
                from = side;
                n_open++;
            }
        }
    }
    const int64_t start = at;
    int64_t n_steps = 0;
    do {
        const int32_t across = sides[!from][at];
        int64_t next = 0;
        while (next < n && (next == at || (sides[0][next] != across && sides[1][next] != across)))
            next++;
        n_steps++;
        at = next;
        from = at < n && sides[0][at] != across;
    } while (at < n && at != start && n_steps <= n);
    if (n_steps != n || n_open > 2)
        return COMPLEX;
    *is_mixed = *is_mixed || runs_alike;
    return n_open ? BOUNDARY : INTERIOR;
}

void prepare_mesh(struct arena *arena, struct collapsible_mesh *mesh)
{
    const int64_t n = mesh->n_vertices, n_corners = 3 * mesh->n_faces;
    mesh->n_left = mesh->n_faces;
    mesh->next_corners = TAKE(arena, int32_t, n_corners);
    mesh->first_corners = TAKE(arena, int32_t, n);
    mesh->kinds = TAKE(arena, uint8_t, n);
    mesh->marks = TAKE_ZEROS(arena, int32_t, n);
    mesh->mark = 0;
    mesh->is_mixed = false;
    mesh->corners_u = TAKE(arena, int32_t, mesh->n_faces);
    mesh->corners_v = TAKE(arena, int32_t, mesh->n_faces);
    memset(mesh->first_corners, 0xFF, (size_t)n * sizeof(int32_t)); /* -1 */
    for (int64_t corner = n_corners - 1; corner >= 0; corner--) {
        const int32_t vertex = mesh->faces[corner / 3][corner % 3];
        mesh->next_corners[corner] = mesh->first_corners[vertex];
        mesh->first_corners[vertex] = (int32_t)corner;
    }
    for (int32_t vertex = 0; vertex < n; vertex++) {
        const int64_t n_around = list_corners(mesh, vertex, mesh->corners_u);
        mesh->kinds[vertex] = (uint8_t)kind_of(
            mesh, n_around, mesh->corners_u, &mesh->is_mixed);
    }
}

/* Find the faces of an edge among the corners of u; false where their number or their wedges do not
   allow a collapse. */
static bool find_edge(
    const struct collapsible_mesh *mesh, int32_t u, int32_t v, int64_t n_u,
    struct collapse *collapse)
{
    const int n_wanted = mesh->kinds[u] == BOUNDARY ? 1 : 2;
    collapse->n_faces = 0;
    for (int64_t i = 0; i < n_u; i++) {
        const int32_t corner = mesh->corners_u[i];
        for (int step = 1; step < 3; step++) {
            if (vertex_after(mesh, corner, step) != v)
                continue;
            if (collapse->n_faces == n_wanted)
                return false;
            const int32_t *wedges = mesh->wedges[corner / 3];
            collapse->wedges_u[collapse->n_faces] = wedges[corner % 3];
            collapse->wedges_v[collapse->n_faces++] = wedges[(corner % 3 + step) % 3];
        }
    }
    if (collapse->n_faces != n_wanted)
        return false;
    if (n_wanted == 1) {
        collapse->wedges_u[1] = collapse->wedges_u[0];
        collapse->wedges_v[1] = collapse->wedges_v[0];
    } else if (collapse->wedges_u[0] == collapse->wedges_u[1]
               && collapse->wedges_v[0] != collapse->wedges_v[1]) {
        return false;
    }
    for (int64_t i = 0; i < n_u; i++) {
        const int32_t wedge = mesh->wedges[mesh->corners_u[i] / 3][mesh->corners_u[i] % 3];
        if (wedge != collapse->wedges_u[0] && wedge != collapse->wedges_u[1])
            return false;
    }
    return true;
}

/* Whether the neighbors in common are those opposite to the edge, and no two faces become one. */
static bool link_allows(
    struct collapsible_mesh *mesh, int32_t v, int64_t n_u, int64_t n_v, int n_edge_faces)
{
    if (mesh->mark > INT32_MAX - 4) {
        memset(mesh->marks, 0, (size_t)mesh->n_vertices * sizeof(int32_t));
        mesh->mark = 0;
    }
    int32_t *marks = mesh->marks;
    const int32_t of_u = ++mesh->mark, of_both = ++mesh->mark;
    for (int64_t i = 0; i < n_u; i++)
        for (int step = 1; step < 3; step++)
            marks[vertex_after(mesh, mesh->corners_u[i], step)] = of_u;
    marks[v] = of_both;
    int n_common = 0;
    for (int64_t i = 0; i < n_v; i++) {
        for (int step = 1; step < 3; step++) {
            const int32_t neighbor = vertex_after(mesh, mesh->corners_v[i], step);
            if (marks[neighbor] == of_u) {
                marks[neighbor] = of_both;
                n_common++;
            }
        }
    }
    if (n_common != n_edge_faces || (n_u == n_edge_faces && n_v == n_edge_faces))
        return false;
    const bool *is_shared = mesh->is_shared;
    for (int64_t i = 0; i < n_u; i++) {
        const int32_t a = vertex_after(mesh, mesh->corners_u[i], 1);
        const int32_t b = vertex_after(mesh, mesh->corners_u[i], 2);
        const bool is_new_a = marks[a] == of_u, is_new_b = marks[b] == of_u;
        if (is_shared[v] && ((is_new_a && is_shared[a]) || (is_new_b && is_shared[b])))
            return false;
        if (a == v || b == v || is_new_a || is_new_b)
            continue;
        /* Three corners at u alone: v may have a face with the other two, as in a tetrahedron, here
           or beyond this mesh. */
        if (is_shared[v] && is_shared[a] && is_shared[b])
            return false;
        for (int64_t j = 0; j < n_v; j++) {
            const int32_t c = vertex_after(mesh, mesh->corners_v[j], 1);
            const int32_t d = vertex_after(mesh, mesh->corners_v[j], 2);
            if ((c == a && d == b) || (c == b && d == a))
                return false;
        }
    }
    return true;
}

/* Whether the faces at some corners keep their side when those corners move to a place. */
static bool sides_stay(
    const struct collapsible_mesh *mesh, int64_t n, const int32_t *corners, int32_t other,
    struct vector place)
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t next = vertex_after(mesh, corners[i], 1);
        const int32_t previous = vertex_after(mesh, corners[i], 2);
        if (next == other || previous == other)
            continue;
        const struct vector from = vector_at(mesh->points[vertex_at_corner(mesh, corners[i])]);
        const struct vector a = vector_at(mesh->points[next]);
        const struct vector ab = minus(vector_at(mesh->points[previous]), a);
        const struct vector before = cross(ab, minus(from, a)), after = cross(ab, minus(place, a));
        const double sizes = dot(before, before) * dot(after, after), cosine = dot(before, after);
        if (sizes == 0.0 ? dot(before, before) > 0.0
                         : cosine <= 0.0
                    || cosine * cosine < mesh->least_cosine * mesh->least_cosine * sizes)
            return false;
    }
    return true;
}

/* Whether u can go to v, both to a place. Its wedges become those of v. */
bool can_collapse(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    struct collapse *collapse)
{
    const int64_t n_u = list_corners(mesh, u, mesh->corners_u);
    if (!find_edge(mesh, u, v, n_u, collapse) || !sides_stay(mesh, n_u, mesh->corners_u, v, place))
        return false;
    const int64_t n_v = list_corners(mesh, v, mesh->corners_v);
    return link_allows(mesh, v, n_u, n_v, collapse->n_faces)
        && (memcmp(mesh->points[v], &place, sizeof place) == 0
            || sides_stay(mesh, n_v, mesh->corners_v, u, place));
}

void collapse_edge(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    const struct collapse *collapse)
{
    int32_t corner = mesh->first_corners[u];
    while (corner >= 0) {
        const int32_t next = mesh->next_corners[corner];
        int32_t *face = mesh->faces[corner / 3];
        if (face[0] >= 0 && (face[0] == v || face[1] == v || face[2] == v)) {
            face[0] = face[1] = face[2] = -1;
            mesh->n_left--;
        } else if (face[0] >= 0) {
            int32_t *wedge = &mesh->wedges[corner / 3][corner % 3];
            *wedge = collapse->wedges_v[*wedge != collapse->wedges_u[0]];
            face[corner % 3] = v;
            mesh->next_corners[corner] = mesh->first_corners[v];
            mesh->first_corners[v] = corner;
        }
        corner = next;
    }
    mesh->first_corners[u] = -1;
    mesh->points[v][0] = place.x;
    mesh->points[v][1] = place.y;
    mesh->points[v][2] = place.z;
}
