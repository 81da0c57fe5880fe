/* Edge collapses that leave a surface a surface, of the same topology.

   An edge of vertices u and v collapses where their neighbors in common are just the vertices
   opposite to it (the link condition), a boundary stays a boundary, each side of a seam has a
   counterpart at v, and no face flips or loses its area. What is not a surface around a vertex keeps
   that vertex.

   Based on: Dey, Edelsbrunner, Guha, Nekhayev, "Topology preserving edge contraction", Publications
   de l'Institut Mathématique 66, 1999 (the link condition); Hoppe, "New quadric metric for
   simplifying meshes with appearance attributes", 1999 (wedges).

   Called from quadric_simplification.c. */

#include "simplification.h"

#include <math.h>
#include <string.h>

#include "numbers.h"

/* No collapse brings the height of a face below this share of its longest edge: where three vertices lie
   on a crease but for rounding, the turn of the face between them says nothing. */
static const double FLATTEST = 1e-3;

/* Whether the walk from each corner of a vertex to the one whose next vertex is its previous one
   comes back after all of them. */
static bool is_ring(int64_t n, const int32_t *next, const int32_t *previous)
{
    int64_t at = 0, n_steps = 0;
    do {
        int64_t across = 0;
        while (across < n && next[across] != previous[at])
            across++;
        at = across;
        n_steps++;
    } while (at > 0 && at < n && n_steps < n);
    return at == 0 && n_steps == n;
}

/* Whether the faces at these corners follow one another around their vertex, once, whichever way each
   of them is wound; `is_mixed` becomes true where two run along an edge the same way. */
static enum vertex_kind kind_of(
    const struct collapsible_mesh *mesh, struct corners around, bool *is_mixed)
{
    const int64_t n = around.n;
    if (n == 0 || n > MOST_CORNERS)
        return COMPLEX;
    int32_t sides[2][MOST_CORNERS]; /* the neighbors that the face of each corner has */
    for (int64_t i = 0; i < n; i++)
        for (int side = 0; side < 2; side++)
            sides[side][i] = vertex_after(mesh, around.corners[i], side + 1);
    if (is_ring(n, sides[0], sides[1]))
        return INTERIOR;
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

/* List the corners of all vertices in order. */
static void list_corners(struct arena *arena, struct collapsible_mesh *mesh)
{
    struct corner_list *lists = TAKE_ZEROS(arena, struct corner_list, mesh->n_vertices);
    for (int64_t face = 0; face < mesh->n_faces; face++)
        for (int k = 0; k < 3; k++)
            lists[mesh->faces[face][k]].room++;
    int64_t start = 0;
    for (int64_t vertex = 0; vertex < mesh->n_vertices; vertex++) {
        lists[vertex].start = start;
        start += lists[vertex].room;
    }
    mesh->lists = lists;
    mesh->n_pool = start;
    mesh->most_pool = start + mesh->n_faces; /* the most corners of the vertex whose list moves */
    mesh->pool = TAKE(arena, int32_t, mesh->most_pool);
    mesh->spare_pool = TAKE(arena, int32_t, mesh->most_pool);
    for (int32_t face = 0; face < mesh->n_faces; face++) {
        for (int32_t k = 0; k < 3; k++) {
            struct corner_list *list = &lists[mesh->faces[face][k]];
            mesh->pool[list->start + list->count++] = 4 * face + k;
        }
    }
}

void prepare_mesh(struct arena *arena, struct collapsible_mesh *mesh)
{
    const int64_t n = mesh->n_vertices;
    mesh->n_left = mesh->n_faces;
    mesh->kinds = TAKE(arena, uint8_t, n);
    mesh->marks = TAKE_ZEROS(arena, int32_t, n);
    mesh->mark = 0;
    mesh->is_mixed = false;
    mesh->merged = TAKE(arena, int32_t, mesh->n_faces);
    if (mesh->may_cut) {
        mesh->spares = TAKE(arena, struct spare_vertex, n);
        mesh->n_spares = 0;
        mesh->arcs = TAKE(arena, int32_t, 3 * mesh->n_faces);
    }
    list_corners(arena, mesh);
    for (int32_t vertex = 0; vertex < n; vertex++)
        mesh->kinds[vertex] = (uint8_t)kind_of(mesh, corners_of(mesh, vertex), &mesh->is_mixed);
}

/* Find the faces of an edge among the corners of u; false where their number or their wedges do not
   allow a collapse. */
static bool find_edge(
    const struct collapsible_mesh *mesh, int32_t u, int32_t v, struct corners of_u,
    struct collapse *collapse)
{
    const int n_wanted = mesh->kinds[u] == BOUNDARY ? 1 : 2;
    collapse->n_faces = 0;
    for (int64_t i = 0; i < of_u.n; i++) {
        const int32_t corner = of_u.corners[i];
        for (int step = 1; step < 3; step++) {
            if (vertex_after(mesh, corner, step) != v)
                continue;
            if (collapse->n_faces == n_wanted)
                return false;
            const int32_t *wedges = mesh->wedges[corner >> 2];
            collapse->wedges_u[collapse->n_faces] = wedges[corner & 3];
            collapse->wedges_v[collapse->n_faces++] = wedges[((corner & 3) + step) % 3];
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
    for (int64_t i = 0; i < of_u.n && mesh->wedges != mesh->faces; i++) {
        const int32_t wedge = wedge_at(mesh, of_u.corners[i]);
        if (wedge != collapse->wedges_u[0] && wedge != collapse->wedges_u[1])
            return false;
    }
    return true;
}

/* Whether v has a face with two other vertices. */
static bool has_face(
    const struct collapsible_mesh *mesh, struct corners of_v, int32_t a, int32_t b)
{
    for (int64_t i = 0; i < of_v.n; i++) {
        const int32_t c = vertex_after(mesh, of_v.corners[i], 1);
        const int32_t d = vertex_after(mesh, of_v.corners[i], 2);
        if ((c == a && d == b) || (c == b && d == a))
            return true;
    }
    return false;
}

/* Whether the surface may be cut along a loop through u, v and the one neighbor in common, marked with
   `of_both`, that is not opposite to their edge. */
static bool finds_loop(
    const struct collapsible_mesh *mesh, int32_t u, int32_t v, struct corners of_u,
    struct corners of_v, int32_t of_both, struct collapse *collapse)
{
    if (mesh->kinds[u] != INTERIOR || mesh->kinds[v] != INTERIOR || mesh->n_spares == 0)
        return false;
    for (int64_t i = 0; i < of_u.n; i++) {
        const int32_t a = vertex_after(mesh, of_u.corners[i], 1);
        const int32_t b = vertex_after(mesh, of_u.corners[i], 2);
        if (a == v || b == v)
            continue;
        if (has_face(mesh, of_v, a, b))
            return false;
        bool is_opposite = false;
        for (int64_t j = 0; j < of_u.n; j++)
            is_opposite |= (vertex_after(mesh, of_u.corners[j], 1) == a
                            && vertex_after(mesh, of_u.corners[j], 2) == v)
                || (vertex_after(mesh, of_u.corners[j], 1) == v
                    && vertex_after(mesh, of_u.corners[j], 2) == a);
        if (mesh->marks[a] == of_both && !is_opposite)
            collapse->third = a;
    }
    const int32_t third = collapse->third;
    return third >= 0 && mesh->kinds[third] == INTERIOR && !mesh->is_fixed[third];
}

/* Whether the neighbors in common are those opposite to the edge, and no two faces become one, or else
   the topology may change. */
static bool link_allows(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct corners of_u, struct corners of_v,
    struct collapse *collapse)
{
    const int n_edge_faces = collapse->n_faces;
    const bool may_change = mesh->may_cut && !mesh->is_mixed;
    collapse->third = -1;
    collapse->vanishes = false;
    if (mesh->mark > INT32_MAX - 4) {
        memset(mesh->marks, 0, (size_t)mesh->n_vertices * sizeof(int32_t));
        mesh->mark = 0;
    }
    int32_t *marks = mesh->marks;
    const int32_t of_one = ++mesh->mark, of_both = ++mesh->mark;
    const int steps_u = steps_to_neighbors(mesh, u), steps_v = steps_to_neighbors(mesh, v);
    for (int64_t i = 0; i < of_u.n; i++)
        for (int step = 1; step <= steps_u; step++)
            marks[vertex_after(mesh, of_u.corners[i], step)] = of_one;
    marks[v] = of_both;
    int n_common = 0;
    for (int64_t i = 0; i < of_v.n; i++) {
        for (int step = 1; step <= steps_v; step++) {
            int32_t *mark = &marks[vertex_after(mesh, of_v.corners[i], step)];
            n_common += *mark == of_one;
            *mark += *mark == of_one; /* of both */
        }
    }
    if (mesh->twins != NULL && doubles_edge(mesh, v, of_u, of_one))
        return false;
    if (of_u.n == n_edge_faces && of_v.n == n_edge_faces)
        return collapse->vanishes = may_change;
    if (n_common == n_edge_faces + 1 && may_change)
        return finds_loop(mesh, u, v, of_u, of_v, of_both, collapse);
    if (n_common != n_edge_faces)
        return false;
    const bool *is_shared = mesh->is_shared;
    if (!is_shared[v] && steps_u == 1 && of_u.n > 3)
        return true; /* each further face of u has a vertex that v does not know */
    for (int64_t i = 0; i < of_u.n; i++) {
        const int32_t a = vertex_after(mesh, of_u.corners[i], 1);
        const int32_t b = vertex_after(mesh, of_u.corners[i], 2);
        const bool is_new_a = marks[a] == of_one, is_new_b = marks[b] == of_one;
        if (is_shared[v] && ((is_new_a && is_shared[a]) || (is_new_b && is_shared[b])))
            return false;
        if (a == v || b == v || is_new_a || is_new_b)
            continue;
        /* Three corners at u alone: v may have a face with the other two, as in a tetrahedron, here
           or beyond this mesh. */
        if ((is_shared[v] && is_shared[a] && is_shared[b]) || has_face(mesh, of_v, a, b)) {
            collapse->vanishes = may_change && of_u.n == of_v.n && of_u.n == n_edge_faces + 1;
            return collapse->vanishes;
        }
    }
    return true;
}

static inline double longest(struct vector a, struct vector b, struct vector c)
{
    return max_f64(dot(a, a), max_f64(dot(b, b), dot(c, c)));
}

/* Whether a face becomes flatter than `FLATTEST` and than it was: from the cross product of two sides
   and the longest squared side, afterwards and before. */
static inline bool gets_flat(
    struct vector after, double longest_after, struct vector before, double longest_before)
{
    const double size = dot(after, after);
    return size < FLATTEST * FLATTEST * longest_after * longest_after
        && size * longest_before * longest_before
        < dot(before, before) * longest_after * longest_after;
}

/* Whether the faces at some corners keep their side and an area when those corners move to a place. */
static bool sides_stay(
    const struct collapsible_mesh *mesh, int32_t vertex, struct corners around, int32_t other,
    struct vector place)
{
    const struct vector from = vector_at(mesh->points[vertex]);
    for (int64_t i = 0; i < around.n; i++) {
        const int32_t next = vertex_after(mesh, around.corners[i], 1);
        const int32_t previous = vertex_after(mesh, around.corners[i], 2);
        if (next == other || previous == other)
            continue;
        const struct vector a = vector_at(mesh->points[next]), b = vector_at(mesh->points[previous]);
        const struct vector ab = minus(b, a);
        const struct vector before = cross(ab, minus(from, a)), after = cross(ab, minus(place, a));
        const double sizes = dot(before, before) * dot(after, after), cosine = dot(before, after);
        if (sizes == 0.0 ? dot(before, before) > 0.0
                         : cosine <= 0.0
                    || cosine * cosine < mesh->least_cosine * mesh->least_cosine * sizes
                    || gets_flat(
                        after, longest(ab, minus(place, a), minus(place, b)), before,
                        longest(ab, minus(from, a), minus(from, b))))
            return false;
    }
    return true;
}

/* Whether u can go to v, both to a place. Its wedges become those of v. */
bool can_collapse(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    struct collapse *collapse)
{
    const struct corners of_u = corners_of(mesh, u), of_v = corners_of(mesh, v);
    return find_edge(mesh, u, v, of_u, collapse) && sides_stay(mesh, u, of_u, v, place)
        && link_allows(mesh, u, v, of_u, of_v, collapse)
        && (memcmp(mesh->points[v], &place, sizeof place) == 0
            || sides_stay(mesh, v, of_v, u, place));
}

/* Remove a face from the corners of its vertex, in order. */
static void forget_corner(struct collapsible_mesh *mesh, int32_t vertex, int32_t face)
{
    struct corner_list *list = &mesh->lists[vertex];
    int32_t *corners = mesh->pool + list->start;
    int32_t n = 0;
    for (int32_t i = 0; i < list->count; i++) {
        corners[n] = corners[i];
        n += corners[i] >> 2 != face;
    }
    list->count = n;
}

/* Move the lists of the vertices together, in the other pool. */
static void tidy_pool(struct collapsible_mesh *mesh)
{
    int32_t *tidied = mesh->spare_pool;
    int64_t n = 0;
    for (int64_t vertex = 0; vertex < mesh->n_vertices; vertex++) {
        struct corner_list *list = &mesh->lists[vertex];
        memcpy(tidied + n, mesh->pool + list->start, (size_t)list->count * sizeof *tidied);
        list->start = n;
        list->room = list->count;
        n += list->count;
    }
    mesh->spare_pool = mesh->pool;
    mesh->pool = tidied;
    mesh->n_pool = n;
}

/* Make the list of a vertex the merged one. */
void take_merged(struct collapsible_mesh *mesh, int32_t vertex, int32_t n)
{
    struct corner_list *list = &mesh->lists[vertex];
    list->count = 0;
    if (n > list->room) {
        if (mesh->n_pool + n > mesh->most_pool)
            tidy_pool(mesh);
        list->start = mesh->n_pool;
        list->room = n;
        mesh->n_pool += n;
    }
    list->count = n;
    memcpy(mesh->pool + list->start, mesh->merged, (size_t)n * sizeof *mesh->merged);
}

void collapse_edge(
    struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector place,
    const struct collapse *collapse)
{
    const struct corners of_u = corners_of(mesh, u), of_v = corners_of(mesh, v);
    int32_t n = 0;
    for (int64_t i = of_u.n - 1; i >= 0; i--) {
        const int32_t corner = of_u.corners[i];
        int32_t *face = mesh->faces[corner >> 2];
        const int32_t next = vertex_after(mesh, corner, 1), previous = vertex_after(mesh, corner, 2);
        if (next == v || previous == v) {
            forget_corner(mesh, next == v ? previous : next, corner >> 2);
            face[0] = face[1] = face[2] = -1;
            mesh->n_left--;
        } else {
            int32_t *wedge = &mesh->wedges[corner >> 2][corner & 3];
            *wedge = collapse->wedges_v[*wedge != collapse->wedges_u[0]];
            face[corner & 3] = v;
            mesh->merged[n++] = corner;
        }
    }
    for (int64_t i = 0; i < of_v.n; i++)
        if (mesh->faces[of_v.corners[i] >> 2][0] >= 0)
            mesh->merged[n++] = of_v.corners[i];
    mesh->lists[u].count = 0;
    take_merged(mesh, v, n);
    memcpy(mesh->points[v], &place, sizeof place);
    if (mesh->twins != NULL)
        leave_twins(mesh, u);
    if (!mesh->may_cut)
        return;
    mesh->spares[mesh->n_spares++] = (struct spare_vertex){u, collapse->wedges_u[0]};
    for (int32_t i = 0; i < n && collapse->vanishes; i++) {
        int32_t *face = mesh->faces[mesh->merged[i] >> 2];
        for (int step = 1; step <= 2; step++)
            forget_corner(mesh, vertex_after(mesh, mesh->merged[i], step), mesh->merged[i] >> 2);
        face[0] = face[1] = face[2] = -1;
        mesh->n_left--;
    }
    if (collapse->vanishes)
        mesh->lists[v].count = 0;
}
