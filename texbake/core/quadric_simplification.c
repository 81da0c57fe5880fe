/* Fewer triangles by collapsing edges, always the one whose collapse moves the surface least.

   The error of a vertex is a sum of squared distances from the planes of the faces that it stands
   for, weighted with their areas. At a boundary and at a seam, planes through its edges, upright on
   the faces, are added; and for each vertex a little of the squared distance from where it was, so
   that a flat part keeps well-shaped triangles and every least error has one place.

   Each vertex waits with its cheapest collapse in a heap. Where one changes what is around it, it is
   looked at again only when its turn comes: errors hardly ever shrink, so that it cannot come too
   late.

   Of a mesh that bends, the errors in some of its poses are added, each with quadrics of its own;
   and of one that is shaded by its normals, those of the normals.

   Errors are divided by the root of the area that they are summed over. That is between the order of
   their sums, in which a hand or an ear goes early because its area is small, and that of their means.
   Near the end, the greatest distance of the vertices that are gone from the faces around is added.
   Measured on 19 meshes, this brings both the greatest and the RMS distance down; a greater or smaller
   share of either makes one of the two larger and neither smaller. Where vertices move, the distance of
   new edges from the faces before is added, too; see carried_places.c.

   Departs from Garland and Heckbert in starting again several times on the way, with the planes of the
   surface as it then is, as Lindstrom and Turk do at every step, beside a share of the errors so far.

   Based on: Garland, Heckbert, "Surface simplification using quadric error metrics", 1997; Cohen,
   Manocha, Olano, "Simplifying polygonal models using successive mappings", 1997 (the lazy heap);
   Lindstrom, Turk, "Fast and memory efficient polygonal simplification", 1998; Mohr, Gleicher,
   "Deformation sensitive decimation", 2003 (poses).

   Called from texbake/mesh/decimate.py and piecewise_simplification.c. */

#include "simplification.h"

#include <math.h>
#include <string.h>

#include "core.h"
#include "numbers.h"

/* Weights, next to the area of a face: of an edge's upright plane, as a multiple of its squared
   length, and of a vertex's own place, as a share of the areas around it. A seam that moves along the
   surface changes no distance: with a weight of 10, the RMS distance of a sofa with many seams was
   twice as great, and its texture coordinates were no closer. */
static const double BOUNDARY_WEIGHT = 10.0, SEAM_WEIGHT = 1.0;
static const double PLACE_WEIGHT = 1e-6;

/* Multiples of the target number of faces at which the errors start again, and the share of the
   earlier errors that is kept. A vertex's sum of errors counts each earlier face more than once;
   measured, five restarts bring the result closer to the surface by a fifth. If nothing were kept,
   the rim of a thin plate would recede at each restart, because errors are relative to the present
   rim. */
static const double RESTARTS[] = {4.0, 3.0, 2.0, 1.5, 1.2, 1.0};
static const double REMEMBERED = 0.3;

/* Weight of the squared distance of places next to the mean squared error, and the restart from which
   on it counts: where vertices move, and where they stay. */
static const double PLACES_WEIGHT = 0.3;
enum { MEASURED_FROM = 1, MEASURED_FROM_IF_FIXED = 3 };

/* A face is not turned further than this cosine by one collapse. */
static const double LEAST_COSINE = 0.2;

enum { CHILDREN = 4 }; /* of each place of the heap; they share a cache line */

static inline bool comes_before(struct waiting a, struct waiting b)
{
    return (a.cost < b.cost) | ((a.cost == b.cost) & (a.vertex < b.vertex));
}

static void sift_down(struct simplification *s, int64_t at)
{
    struct waiting *heap = s->heap;
    const struct waiting moved = heap[at];
    while (CHILDREN * at + 1 < s->n_heap) {
        const int64_t first = CHILDREN * at + 1, end = min_i64(first + CHILDREN, s->n_heap);
        int64_t child = first;
        for (int64_t other = first + 1; other < end; other++)
            child = comes_before(heap[other], heap[child]) ? other : child;
        if (!comes_before(heap[child], moved))
            break;
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = moved;
}

static void push(struct simplification *s, struct waiting added)
{
    int64_t at = s->n_heap++;
    while (at > 0 && comes_before(added, s->heap[(at - 1) / CHILDREN])) {
        s->heap[at] = s->heap[(at - 1) / CHILDREN];
        at = (at - 1) / CHILDREN;
    }
    s->heap[at] = added;
    s->is_waiting[added.vertex] = true;
}

static void drop_first(struct simplification *s)
{
    s->is_waiting[s->heap[0].vertex] = false;
    s->heap[0] = s->heap[--s->n_heap];
    if (s->n_heap > 0)
        sift_down(s, 0);
}

/* Add the upright plane of the edge from a corner to the next to both ends. */
static void add_edge_plane(
    struct simplification *s, const int32_t *face, int corner, double weight)
{
    const int32_t tail = face[corner], head = face[(corner + 1) % 3];
    const struct vector from = vector_at(s->mesh.points[tail]);
    const struct vector along = minus(vector_at(s->mesh.points[head]), from);
    const struct vector back = minus(vector_at(s->mesh.points[face[(corner + 2) % 3]]), from);
    const struct vector upright = cross(along, cross(along, back));
    const double length = sqrt(dot(upright, upright));
    if (!(length > 0.0))
        return;
    const struct vector unit = {upright.x / length, upright.y / length, upright.z / length};
    add_plane(&s->quadrics[tail], unit, from, weight * dot(along, along));
    add_plane(&s->quadrics[head], unit, from, weight * dot(along, along));
}

/* Weight of the edge from a corner to the next, among those of its tail: 0 inside a surface. */
static double edge_weight(
    const struct collapsible_mesh *mesh, int32_t corner, struct corners of_tail)
{
    const int32_t *face = mesh->faces[corner >> 2], *wedges = mesh->wedges[corner >> 2];
    const int k = corner & 3;
    const int32_t head = face[(k + 1) % 3];
    for (int64_t i = 0; i < of_tail.n; i++) {
        const int32_t other = of_tail.corners[i], *wedges_across = mesh->wedges[other >> 2];
        const int step = vertex_after(mesh, other, 2) == head ? 2 : 1;
        if (other == corner || vertex_after(mesh, other, step) != head)
            continue;
        const bool is_seam = wedge_at(mesh, other) != wedges[k]
            || wedges_across[((other & 3) + step) % 3] != wedges[(k + 1) % 3];
        return is_seam ? SEAM_WEIGHT : 0.0;
    }
    return BOUNDARY_WEIGHT;
}

/* How much a face counts, by what its vertices do. */
static double importance_of(const struct simplification *s, const int32_t *face)
{
    double sum = 0.0;
    for (int k = 0; k < 3 && s->importance; k++)
        sum += s->importance[s->vertex_ids[face[k]]];
    return s->importance ? sum / 3.0 : 1.0;
}

static void add_face_quadrics(
    const struct simplification *s, const double (*points)[4], struct quadric *quadrics)
{
    const struct collapsible_mesh *mesh = &s->mesh;
    for (int64_t i = 0; i < mesh->n_faces; i++) {
        const int32_t *face = mesh->faces[i];
        const struct vector a = vector_at(points[face[0]]);
        const struct vector across = cross(
            minus(vector_at(points[face[1]]), a), minus(vector_at(points[face[2]]), a));
        const double length = sqrt(dot(across, across));
        if (!(length > 0.0))
            continue;
        const struct vector normal = {across.x / length, across.y / length, across.z / length};
        const double weight = importance_of(s, face) * length;
        struct quadric plane = {0};
        add_plane(&plane, normal, a, 0.5 * weight);
        for (int k = 0; k < 3; k++) {
            struct quadric *quadric = &quadrics[face[k]];
            *quadric = add_quadrics(quadric, &plane);
            add_point(quadric, vector_at(points[face[k]]), PLACE_WEIGHT * weight);
        }
    }
}

/* Whether an edge of a vertex may lie at a boundary or a seam. */
static bool may_have_side(
    const struct collapsible_mesh *mesh, int32_t vertex, struct corners around)
{
    if (around.n > MOST_CORNERS)
        return false;
    if (mesh->kinds[vertex] != INTERIOR)
        return true;
    for (int64_t i = 1; i < around.n && mesh->wedges != mesh->faces; i++)
        if (wedge_at(mesh, around.corners[0]) != wedge_at(mesh, around.corners[i]))
            return true;
    return false; /* a seam that ends here has two wedges at the other end */
}

/* Add the planes of edges at boundaries and seams. */
static void add_edge_quadrics(struct simplification *s)
{
    struct collapsible_mesh *mesh = &s->mesh;
    for (int32_t vertex = 0; vertex < mesh->n_vertices; vertex++) {
        const struct corners around = corners_of(mesh, vertex);
        if (!may_have_side(mesh, vertex, around))
            continue;
        for (int64_t i = 0; i < around.n; i++) {
            const int32_t corner = around.corners[i];
            const double weight = edge_weight(mesh, corner, around);
            const int32_t *face = mesh->faces[corner >> 2];
            if (weight > 0.0)
                add_edge_plane(s, face, corner & 3, importance_of(s, face) * weight);
        }
    }
}

static inline bool may_leave(const struct simplification *s, int32_t u)
{
    return !s->mesh.is_fixed[u] && s->mesh.kinds[u] != COMPLEX;
}

/* Whether u and v may meet somewhere else: both inside, both at a boundary or both at a seam. */
static inline bool may_meet(const struct simplification *s, int32_t u, int32_t v)
{
    return s->moves && !s->mesh.is_fixed[v] && s->mesh.kinds[v] == s->mesh.kinds[u]
        && s->n_wedges[v] == s->n_wedges[u];
}

/* Whether a vertex that may leave may go to another, as far as their kinds tell. Where they meet,
   neither way costs less, and the vertex with the lower number stays. */
static inline bool may_go(const struct simplification *s, int32_t u, int32_t v)
{
    if (may_meet(s, u, v))
        return v < u;
    return s->mesh.kinds[u] == INTERIOR || s->mesh.kinds[v] != INTERIOR;
}

/* The sum of the weights of the planes of a quadric, of which the squared lengths of normals are 1. */
static inline double weight_of(const struct quadric *q)
{
    return q->xx + q->yy + q->zz;
}

/* The factor that makes sums of squared errors comparable; 1 where nothing has an area. */
static inline double factor_of(const struct quadric *q)
{
    const double weight = weight_of(q);
    return weight > 0.0 ? 1.0 / sqrt(weight) : 1.0;
}

static inline double error_at(const struct quadric *q, struct vector place)
{
    return factor_of(q) * quadric_at(q, place);
}

/* The normals of u and those of v that they become when u goes to v, at a hard edge two of each. */
static int normal_pairs(const struct simplification *s, int32_t u, int32_t v, int64_t pairs[2][2])
{
    const struct corners around = corners_of(&s->mesh, u);
    const int32_t *row_of = s->attributes.normals.row_of;
    int n = 0;
    for (int64_t i = 0; i < around.n && n < 2; i++) {
        const int32_t corner = around.corners[i];
        for (int step = 1; step <= 2; step++) {
            if (vertex_after(&s->mesh, corner, step) != v)
                continue;
            const int32_t *wedges = s->mesh.wedges[corner >> 2];
            pairs[n][0] = row_of[wedges[corner & 3]];
            pairs[n][1] = row_of[wedges[((corner & 3) + step) % 3]];
            n += n == 0 || pairs[0][0] != pairs[1][0];
            break;
        }
    }
    return n;
}

/* The error of the normals of u once it has gone to v. */
static double shading_error(const struct simplification *s, int32_t u, int32_t v)
{
    int64_t pairs[2][2];
    const int n = normal_pairs(s, u, v, pairs);
    double sum = 0.0;
    for (int i = 0; i < n; i++)
        sum += normal_error(
            &s->of_normals[pairs[i][0]], vector_at(s->mesh.points[v]),
            s->attributes.normals.values + 3 * pairs[i][1]);
    return factor_of(&s->quadrics[u]) * s->normal_weight * sum;
}

/* Where u and v meet if they may move, and the error there. */
static double least_error(
    const double (*points)[4], const struct quadric *quadrics, int32_t u, int32_t v,
    struct vector *place)
{
    const struct quadric sum = add_quadrics(&quadrics[u], &quadrics[v]);
    *place = vector_at(points[v]);
    const struct vector edge = minus(vector_at(points[u]), *place);
    const struct vector middle = weighted(edge, *place, 0.5, 1.0);
    struct vector step;
    if (step_to_least(&sum, middle, &step) && dot(step, step) <= 4.0 * dot(edge, edge)) {
        *place = weighted(middle, step, 1.0, 1.0);
        return error_at(&sum, *place);
    }
    const double at_v = error_at(&sum, *place), at_middle = error_at(&sum, middle);
    if (at_middle < at_v)
        *place = middle;
    return min_f64(at_v, at_middle);
}

/* The sum of the errors in all poses once u has gone to v; where they meet, each pose has its own
   place. */
static double posed_error(const struct simplification *s, int32_t u, int32_t v, bool meets)
{
    double sum = 0.0;
    for (int64_t pose = 0; pose < s->n_poses; pose++) {
        const double (*points)[4] = (const double(*)[4])posed_points(s, pose);
        const struct quadric *quadrics = posed_quadrics(s, pose);
        struct vector place;
        sum += meets ? least_error(points, quadrics, u, v, &place)
                     : error_at(&quadrics[u], vector_at(points[v])) + points[v][3];
    }
    return sum;
}

/* Let u go to v in all poses. */
static void collapse_poses(struct simplification *s, int32_t u, int32_t v, bool meets)
{
    for (int64_t pose = 0; pose < s->n_poses; pose++) {
        double (*points)[4] = posed_points(s, pose);
        struct quadric *quadrics = posed_quadrics(s, pose);
        struct vector place = vector_at(points[v]);
        if (meets)
            least_error((const double(*)[4])points, quadrics, u, v, &place);
        quadrics[v] = add_quadrics(&quadrics[u], &quadrics[v]);
        memcpy(points[v], &place, sizeof place);
        points[v][3] = error_at(&quadrics[v], place);
    }
}

/* Where u and v meet when u goes to v, and the error there. */
static inline double cost_of(
    const struct simplification *s, int32_t u, int32_t v, struct vector *place)
{
    const double (*points)[4] = (const double(*)[4])s->mesh.points;
    if (may_meet(s, u, v))
        return least_error(points, s->quadrics, u, v, place) + posed_error(s, u, v, true);
    *place = vector_at(points[v]);
    const double shading = s->of_normals == NULL ? 0.0 : shading_error(s, u, v);
    return error_at(&s->quadrics[u], *place) + points[v][3] + shading + posed_error(s, u, v, false);
}

/* Whether a collapse is cheaper than another, and comes after a third one. */
static inline bool comes_between(
    double cost, int32_t v, double least, int32_t target, double cost_before, int32_t before)
{
    return ((cost < least) | ((cost == least) & (v < target)))
        & ((cost > cost_before) | ((cost == cost_before) & (v > before)));
}

/* Set a vertex's cheapest collapse, of those that come after one that is not possible: of a higher
   cost, or of the same and a higher target. Returns its cost. */
static double choose_target(struct simplification *s, int32_t u, double cost_before, int32_t before)
{
    const struct collapsible_mesh *mesh = &s->mesh;
    double least = INFINITY;
    int32_t target = -1;
    const struct corners around = may_leave(s, u) ? corners_of(mesh, u) : (struct corners){0};
    const int n_steps = steps_to_neighbors(mesh, u);
    if (n_steps == 1 && !s->moves && s->n_poses == 0 && s->of_normals == NULL) {
        const struct quadric quadric = s->quadrics[u];
        const double factor = factor_of(&quadric);
        for (int64_t i = 0; i < around.n; i++) {
            const int32_t v = vertex_after(mesh, around.corners[i], 1);
            const double *point = mesh->points[v];
            const double cost = factor * quadric_at(&quadric, vector_at(point)) + point[3];
            const bool is_next = comes_between(cost, v, least, target, cost_before, before);
            least = is_next ? cost : least;
            target = is_next ? v : target;
        }
        s->targets[u] = target;
        s->errors[u] = least;
        return least;
    }
    for (int64_t i = 0; i < around.n; i++) {
        for (int step = 1; step <= n_steps; step++) {
            const int32_t v = vertex_after(mesh, around.corners[i], step);
            if (!may_go(s, u, v))
                continue;
            struct vector place;
            const double cost = cost_of(s, u, v, &place);
            if (!comes_between(cost, v, least, target, cost_before, before))
                continue;
            least = cost;
            target = v;
        }
    }
    s->targets[u] = target;
    s->errors[u] = least;
    return least;
}

static double choose_any_target(struct simplification *s, int32_t u)
{
    return choose_target(s, u, -1.0, -1);
}

/* Put a vertex that may be collapsed again back into the queue. */
static void wait_again(struct simplification *s, int32_t u)
{
    s->is_stale[u] = true;
    if (s->is_waiting[u] || !may_leave(s, u))
        return;
    const double cost = choose_any_target(s, u);
    if (s->targets[u] >= 0)
        push(s, (struct waiting){cost, u});
}

/* Look again at what the collapse into v changed: v and its neighbors; those that had no collapse at
   once, the others when it is their turn. Errors grow, so that few come too late. */
static void update_around(struct simplification *s, int32_t v)
{
    const struct corners around = corners_of(&s->mesh, v);
    const int n_steps = steps_to_neighbors(&s->mesh, v);
    wait_again(s, v);
    for (int64_t i = 0; i < around.n; i++)
        for (int step = 1; step <= n_steps; step++)
            wait_again(s, vertex_after(&s->mesh, around.corners[i], step));
}

static void fill_heap(struct simplification *s)
{
    s->n_heap = 0;
    for (int32_t vertex = 0; vertex < s->mesh.n_vertices; vertex++) {
        const double cost = choose_any_target(s, vertex);
        if (s->targets[vertex] < 0)
            continue;
        s->is_waiting[vertex] = true;
        s->heap[s->n_heap++] = (struct waiting){cost, vertex};
    }
    for (int64_t at = (s->n_heap + CHILDREN - 2) / CHILDREN - 1; at >= 0; at--)
        sift_down(s, at);
}

/* Count the wedges of each vertex, up to three. */
static void count_wedges(struct simplification *s)
{
    const struct collapsible_mesh *mesh = &s->mesh;
    for (int32_t vertex = 0; vertex < mesh->n_vertices; vertex++) {
        const struct corners around = corners_of(mesh, vertex);
        int32_t found[3];
        int n_found = 0;
        for (int64_t i = 0; i < around.n && n_found < 3; i++) {
            const int32_t wedge = wedge_at(mesh, around.corners[i]);
            bool is_new = true;
            for (int j = 0; j < n_found; j++)
                is_new = is_new && found[j] != wedge;
            if (is_new)
                found[n_found++] = wedge;
        }
        s->n_wedges[vertex] = (uint8_t)n_found;
    }
}

/* The mesh has its points, faces, wedges, and which vertices are fixed and shared. */
void begin_simplification(struct arena *arena, struct simplification *s, bool lock_boundary)
{
    struct collapsible_mesh *mesh = &s->mesh;
    const int64_t n = mesh->n_vertices;
    mesh->least_cosine = LEAST_COSINE;
    prepare_mesh(arena, mesh);
    mesh->twins = NULL;
    if (mesh->copy_of != NULL && !s->moves)
        find_twins(arena, mesh);
    for (int64_t vertex = 0; lock_boundary && vertex < n; vertex++)
        mesh->is_fixed[vertex] |= mesh->kinds[vertex] == BOUNDARY;
    s->n_wedges = TAKE_ZEROS(arena, uint8_t, n);
    if (s->moves)
        count_wedges(s);
    s->quadrics = take_zeros(arena, n, sizeof *s->quadrics);
    for (int64_t vertex = 0; s->so_far && vertex < n; vertex++)
        s->quadrics[vertex] = scaled_quadric(&s->so_far[s->vertex_ids[vertex]], REMEMBERED);
    s->targets = TAKE(arena, int32_t, n);
    s->errors = TAKE(arena, double, n);
    s->is_measured = TAKE_ZEROS(arena, bool, n);
    s->heap = TAKE(arena, struct waiting, n + CHILDREN - 1) + CHILDREN - 1;
    s->is_waiting = TAKE_ZEROS(arena, bool, n);
    s->is_stale = TAKE_ZEROS(arena, bool, n);
    add_face_quadrics(s, (const double(*)[4])mesh->points, s->quadrics);
    add_edge_quadrics(s);
    for (int64_t pose = 0; pose < s->n_poses; pose++) {
        double (*points)[4] = posed_points(s, pose);
        struct quadric *quadrics = posed_quadrics(s, pose);
        add_face_quadrics(s, (const double(*)[4])points, quadrics);
        for (int64_t vertex = 0; vertex < n; vertex++)
            points[vertex][3] = error_at(&quadrics[vertex], vector_at(points[vertex]));
    }
    s->of_normals = NULL;
    if (s->normal_weight > 0.0) {
        s->of_normals = take_zeros(arena, s->n_normals, sizeof *s->of_normals);
        add_face_normals(mesh, &s->attributes.normals, s->of_normals);
    }
    for (int64_t vertex = 0; vertex < n; vertex++)
        mesh->points[vertex][3] = error_at(
            &s->quadrics[vertex], vector_at(mesh->points[vertex]));
    fill_heap(s);
}

/* Bring into the cache what the vertices need that may be first in the heap after this one. */
static inline void fetch_next(const struct simplification *s)
{
    for (int64_t i = 1; i <= CHILDREN && i < s->n_heap; i++) {
        const int32_t next = s->heap[i].vertex;
        const struct quadric *quadric = &s->quadrics[next];
        __builtin_prefetch(quadric);
        __builtin_prefetch(&quadric->c);
        __builtin_prefetch(s->mesh.pool + s->mesh.lists[next].start);
    }
}

/* The squared distance of the farthest corner of the faces of a vertex from a place. */
static double size_around(const struct collapsible_mesh *mesh, int32_t vertex, struct vector place)
{
    const struct corners around = corners_of(mesh, vertex);
    double most = 0.0;
    for (int64_t i = 0; i < 3 * around.n; i++) {
        const int32_t corner = mesh->faces[around.corners[i / 3] >> 2][i % 3];
        const struct vector offset = minus(vector_at(mesh->points[corner]), place);
        most = max_f64(most, dot(offset, offset));
    }
    return most;
}

/* What the distance of places adds to the cost of the first collapse of the heap. */
static double cost_of_places(
    struct simplification *s, int32_t u, int32_t v, struct vector place, struct collapse *collapse)
{
    if (s->places.points == NULL || s->is_measured[u])
        return 0.0;
    s->is_measured[u] = true;
    const double weight = weight_of(&s->quadrics[u]) + weight_of(&s->quadrics[v]);
    double most = distance_of_places(&s->mesh, &s->places, s->vertex_ids, u, v, place, s->moves);
    /* Nothing near is left of a part that vanishes. */
    if (s->mesh.may_cut && can_collapse(&s->mesh, u, v, place, collapse) && collapse->vanishes)
        most = max_f64(most, size_around(&s->mesh, u, place));
    return PLACES_WEIGHT * sqrt(weight) * most;
}

/* Let the normals of u become those of v. */
static void join_normals(struct simplification *s, int32_t u, int32_t v)
{
    int64_t pairs[2][2];
    const int n = normal_pairs(s, u, v, pairs);
    for (int i = 0; i < n; i++)
        add_normal_quadrics(&s->of_normals[pairs[i][1]], &s->of_normals[pairs[i][0]]);
}

/* Where two vertices meet, the more important one counts. */
static void join_importance(struct simplification *s, int32_t u, int32_t v)
{
    double *of_v = &s->importance[s->vertex_ids[v]];
    if (s->moves)
        *of_v = max_f64(*of_v, s->importance[s->vertex_ids[u]]);
}

/* Let a vertex share what it stands for with the second half that it got at its place. */
static void share_vertex(struct simplification *s, int32_t vertex, int32_t half)
{
    s->quadrics[vertex] = s->quadrics[half] = scaled_quadric(&s->quadrics[vertex], 0.5);
    s->mesh.points[vertex][3] = s->mesh.points[half][3] = error_at(
        &s->quadrics[vertex], vector_at(s->mesh.points[vertex]));
    for (int64_t pose = 0; pose < s->n_poses; pose++) {
        double (*points)[4] = posed_points(s, pose);
        struct quadric *quadrics = posed_quadrics(s, pose);
        quadrics[vertex] = quadrics[half] = scaled_quadric(&quadrics[vertex], 0.5);
        points[vertex][3] = error_at(&quadrics[vertex], vector_at(points[vertex]));
        memcpy(points[half], points[vertex], sizeof *points);
    }
    s->n_wedges[half] = s->n_wedges[vertex];
    s->mesh.is_fixed[half] = false;
    if (s->importance)
        s->importance[s->vertex_ids[half]] = s->importance[s->vertex_ids[vertex]];
    if (s->places.points != NULL)
        share_places(&s->mesh, &s->places, s->vertex_ids, vertex, half);
    update_around(s, half);
}

/* Make the cheapest collapse; false where none is possible. */
bool collapse_cheapest(
    struct simplification *s, int32_t *u, double *cost, struct collapse *collapse)
{
    while (s->n_heap > 0) {
        struct waiting *first = s->heap;
        *u = first->vertex;
        fetch_next(s);
        if (!s->is_stale[*u]) {
            const int32_t v = s->targets[*u];
            struct vector place = vector_at(s->mesh.points[v]);
            *cost = s->moves ? cost_of(s, *u, v, &place) : first->cost;
            const double added = cost_of_places(s, *u, v, place, collapse);
            if (added > 0.0) {
                first->cost += added;
                sift_down(s, 0);
                continue;
            }
            if (can_collapse(&s->mesh, *u, v, place, collapse)
                && carry_attributes(&s->mesh, &s->attributes, *u, v, place, collapse)) {
                drop_first(s);
                collapse_poses(s, *u, v, may_meet(s, *u, v));
                if (s->of_normals != NULL)
                    join_normals(s, *u, v);
                if (collapse->third >= 0)
                    cut_loop(&s->mesh, *u, v, place, collapse);
                else
                    collapse_edge(&s->mesh, *u, v, place, collapse);
                if (s->places.points != NULL)
                    join_places(&s->places, s->vertex_ids[*u], s->vertex_ids[v]);
                if (s->importance)
                    join_importance(s, *u, v);
                s->quadrics[v] = add_quadrics(&s->quadrics[*u], &s->quadrics[v]);
                s->mesh.points[v][3] = error_at(&s->quadrics[v], place);
                if (collapse->third >= 0) {
                    share_vertex(s, v, *u);
                    share_vertex(s, collapse->third, collapse->third_half);
                }
                update_around(s, v);
                return true;
            }
        }
        first->cost = s->is_stale[*u] ? choose_any_target(s, *u)
                                      : choose_target(s, *u, s->errors[*u], s->targets[*u]);
        s->is_stale[*u] = s->is_measured[*u] = false;
        if (s->targets[*u] < 0)
            drop_first(s);
        else
            sift_down(s, 0);
    }
    return false;
}

/* Fill a mesh with faces of wedges, its vertices numbered in order without those that no face has. */
static void take_faces(
    struct arena *arena, struct simplification *s, int64_t n_vertices, int64_t n_faces,
    const int32_t *vertex_of, const double (*points)[3], const int32_t (*faces)[3])
{
    struct collapsible_mesh *mesh = &s->mesh;
    int32_t *numbers = TAKE_ZEROS(arena, int32_t, n_vertices);
    for (int64_t face = 0; face < n_faces; face++)
        for (int k = 0; k < 3; k++)
            numbers[vertex_of[faces[face][k]]] = 1;
    s->vertex_ids = TAKE(arena, int32_t, n_vertices);
    mesh->n_vertices = 0;
    for (int32_t vertex = 0; vertex < n_vertices; vertex++) {
        s->vertex_ids[mesh->n_vertices] = vertex;
        mesh->n_vertices += numbers[vertex];
        numbers[vertex] = (int32_t)mesh->n_vertices - 1;
    }
    mesh->n_faces = n_faces;
    mesh->faces = take(arena, n_faces, sizeof *mesh->faces);
    mesh->wedges = take(arena, n_faces, sizeof *mesh->wedges);
    for (int64_t face = 0; face < n_faces; face++) {
        for (int k = 0; k < 3; k++) {
            mesh->wedges[face][k] = faces[face][k];
            mesh->faces[face][k] = numbers[vertex_of[faces[face][k]]];
        }
    }
    mesh->points = take(arena, mesh->n_vertices, sizeof *mesh->points);
    for (int64_t vertex = 0; vertex < mesh->n_vertices; vertex++)
        memcpy(mesh->points[vertex], points[s->vertex_ids[vertex]], sizeof *points);
    mesh->is_fixed = TAKE_ZEROS(arena, bool, mesh->n_vertices);
    mesh->is_shared = TAKE_ZEROS(arena, bool, mesh->n_vertices);
}

/* Read the poses of the vertices of a mesh, or write them back. */
static void read_poses(struct arena *arena, struct simplification *s, struct poses *poses)
{
    const int64_t n = s->mesh.n_vertices;
    s->n_poses = poses->n;
    s->posed_points = take(arena, n * poses->n, sizeof *s->posed_points);
    s->posed_quadrics = take(arena, n * poses->n, sizeof *s->posed_quadrics);
    for (int64_t pose = 0; pose < poses->n; pose++) {
        for (int64_t vertex = 0; vertex < n; vertex++) {
            const int64_t from = pose * poses->n_vertices + s->vertex_ids[vertex];
            memcpy(posed_points(s, pose)[vertex], poses->points[from], sizeof *poses->points);
            posed_quadrics(s, pose)[vertex] = scaled_quadric(&poses->so_far[from], REMEMBERED);
        }
    }
}

static void write_poses(const struct simplification *s, struct poses *poses)
{
    for (int64_t pose = 0; pose < poses->n; pose++) {
        for (int64_t vertex = 0; vertex < s->mesh.n_vertices; vertex++) {
            const int64_t to = pose * poses->n_vertices + s->vertex_ids[vertex];
            memcpy(poses->points[to], posed_points(s, pose)[vertex], sizeof *poses->points);
            poses->so_far[to] = posed_quadrics(s, pose)[vertex];
        }
    }
}

/* Collapse edges until `n_wanted` faces are left or no edge can, with errors from the surface as it
   is now; return how many faces are left, in front of the others. */
static int64_t simplify_from_here(
    struct arena *arena, struct simplification *s, int64_t n_vertices, int64_t n_faces,
    const int32_t *vertex_of, double (*points)[3], int32_t (*faces)[3], struct poses *poses,
    int64_t n_wanted, bool lock_boundary)
{
    const struct collapsible_mesh *mesh = &s->mesh;
    take_faces(
        arena, s, n_vertices, n_faces, vertex_of, (const double(*)[3])points,
        (const int32_t(*)[3])faces);
    read_poses(arena, s, poses);
    begin_simplification(arena, s, lock_boundary);
    int32_t u;
    double cost;
    struct collapse collapse;
    while (mesh->n_left > n_wanted && collapse_cheapest(s, &u, &cost, &collapse))
        continue;
    for (int64_t vertex = 0; vertex < mesh->n_vertices; vertex++) {
        s->so_far[s->vertex_ids[vertex]] = s->quadrics[vertex];
        memcpy(points[s->vertex_ids[vertex]], mesh->points[vertex], sizeof *points);
    }
    write_poses(s, poses);
    int64_t n_left = 0;
    for (int64_t face = 0; face < n_faces; face++)
        if (mesh->faces[face][0] >= 0)
            memcpy(faces[n_left++], mesh->wedges[face], sizeof *faces);
    return n_left;
}

/* Collapse edges until `n_wanted` faces are left or no edge can. Faces are rows of wedges, each at a
   vertex; points and faces are overwritten, the faces by those that are left. Returns how many.

   Where vertices move, `uvs` and `normals` are carried along: their rows, one for each wedge and not
   shared by vertices, tell which wedges have a value in common.

   Each pose has points of all vertices, one after the other: the error is the sum of those at rest
   and in all poses, so that what bends keeps its edges. They are overwritten.

   Where vertices stay, errors of normals count as well, by their squares times a weight.

   With `copy_of`, each wedge is a vertex, and it says which was the first at its place; where vertices
   stay, no edge comes to lie on one at the same two places. If it also `may_cut`, the topology may
   change: vertices that are gone return at places of others. */
EXPORT int64_t collapse_edges(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, int64_t n_uvs, int64_t n_normals,
    int64_t n_posed,
    const int32_t vertex_of[n_wedges], double points[n_vertices][3], int32_t faces[n_faces][3],
    OPTIONAL const int32_t uv_rows[n_wedges], OPTIONAL double uvs[n_uvs][2],
    OPTIONAL const int32_t normal_rows[n_wedges], OPTIONAL double normals[n_normals][3],
    OPTIONAL double posed[n_posed][3], OPTIONAL int32_t copy_of[n_wedges],
    OPTIONAL double importance[n_vertices], double normal_weight,
    int64_t n_wanted, bool moves, bool lock_boundary, bool may_cut)
{
    struct simplification s = {
        .mesh.copy_of = copy_of,
        .mesh.n_copies = n_wedges,
        .mesh.may_cut = copy_of != NULL && may_cut,
        .moves = moves,
        .importance = importance,
        .n_normals = n_normals,
        .normal_weight = normals && !moves ? normal_weight : 0.0,
        .attributes = {
            .uvs = {uvs ? 2 : 0, uv_rows, (double *)uvs, false},
            .normals = {normals ? 3 : 0, normal_rows, (double *)normals, true}}};
    OPEN_ARENA(arena);
    s.so_far = take_zeros(arena, n_vertices, sizeof *s.so_far);
    struct poses poses = {
        posed && n_vertices ? n_posed / n_vertices : 0, n_vertices, posed,
        take_zeros(arena, posed ? n_posed : 0, sizeof *poses.so_far)};
    int64_t n_left = n_faces;
    for (size_t i = 0; i < sizeof RESTARTS / sizeof *RESTARTS; i++) {
        const int64_t n_next = (int64_t)(RESTARTS[i] * (double)n_wanted);
        if (n_next >= n_left)
            continue;
        if (s.places.points == NULL && i >= (moves ? MEASURED_FROM : MEASURED_FROM_IF_FIXED))
            begin_places(arena, &s.places, n_vertices, (const double(*)[3])points);
        const arena_mark mark = mark_arena(arena);
        const int64_t n_before = n_left;
        n_left = simplify_from_here(
            arena, &s, n_vertices, n_left, vertex_of, points, faces, &poses, n_next,
            lock_boundary);
        reset_arena(arena, mark);
        if (n_left == n_before && !moves)
            break; /* other errors would not make a collapse possible */
    }
    close_arena(arena);
    return n_left;
}
