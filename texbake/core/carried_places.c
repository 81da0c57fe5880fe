/* How far a collapse would leave the surface from where it was, at the places of the vertices.

   Each vertex stands for those that came together at it. After a collapse, the distance of such a
   place is that to the closest of the faces around the vertex. Sums of squared distances from planes
   say little of a hand, an ear or a rod that vanishes, for its area is small and its planes go on.

   The other way, the middles of new edges are compared with the faces before the collapse. That sees
   faces that run across a hole or from one surface to another, where no vertex is far from anything.
   Measured on 116 cases, the greatest distance became 9 % smaller, and the RMS distance 1 % greater.

   Based on: Klein, Liebich, Straßer, "Mesh reduction with error control", Visualization 1996 (the
   distance from the vertices that are gone).

   Called from quadric_simplification.c. */

#include <math.h>
#include <string.h>

#include "closest_on_triangle.h"
#include "simplification.h"

/* Let each vertex stand for itself alone. */
void begin_places(
    struct arena *arena, struct carried_places *places, int64_t n, const double (*points)[3])
{
    places->points = take(arena, n, sizeof *places->points);
    memcpy(places->points, points, (size_t)n * sizeof *points);
    places->first = TAKE(arena, int32_t, n);
    places->last = TAKE(arena, int32_t, n);
    places->next = TAKE(arena, int32_t, n);
    for (int32_t place = 0; place < n; place++) {
        places->next[place] = -1;
        places->first[place] = places->last[place] = place;
    }
}

/* Let the second vertex also stand for what the first did. */
void join_places(struct carried_places *places, int32_t u, int32_t v)
{
    if (places->first[u] < 0)
        return;
    if (places->first[v] < 0)
        places->first[v] = places->first[u];
    else
        places->next[places->last[v]] = places->first[u];
    places->last[v] = places->last[u];
}

/* The squared distance of a point to the closest face of a vertex that has moved to a place, except
   faces that another vertex belongs to; the search ends once the distance is at most `enough`. */
static double distance_around(
    const struct collapsible_mesh *mesh, int32_t vertex, int32_t other, struct vector place,
    struct vector point, double enough)
{
    const struct corners around = corners_of(mesh, vertex);
    double least = INFINITY;
    for (int64_t i = 0; i < around.n && least > enough; i++) {
        const int32_t next = vertex_after(mesh, around.corners[i], 1);
        const int32_t previous = vertex_after(mesh, around.corners[i], 2);
        if (next == other || previous == other)
            continue;
        /* In an order that rounds alike whichever way the face is wound. */
        const struct vector a = vector_at(mesh->points[next < previous ? next : previous]);
        const struct vector b = vector_at(mesh->points[next < previous ? previous : next]);
        const struct nearness near = closest_on_triangle(
            minus(a, place), minus(b, place), minus(point, place));
        least = min_f64(least, near.squared);
    }
    return least;
}

/* Whether an edge of a face leads from the vertex of some corners to another one. */
static bool leads_to(const struct collapsible_mesh *mesh, struct corners around, int32_t vertex)
{
    for (int64_t i = 0; i < around.n; i++)
        if (vertex_after(mesh, around.corners[i], 1) == vertex)
            return true;
    return false;
}

/* The greatest squared distance of the middles of new edges from the faces around two vertices as they
   are, if these meet, or `most` if none is greater. */
static double distance_of_edges(
    const struct collapsible_mesh *mesh, int32_t u, int32_t v, struct vector meeting, double most)
{
    for (int end = 0; end < 2; end++) {
        const int32_t near = end == 0 ? u : v, far = end == 0 ? v : u;
        const struct vector from = vector_at(mesh->points[near]);
        const struct vector other = vector_at(mesh->points[far]);
        const struct corners around = corners_of(mesh, near);
        for (int64_t i = 0; i < 2 * around.n; i++) {
            /* At a boundary, one edge has no face that leads along it from here. */
            const bool is_next = i < around.n;
            const int32_t end_id = vertex_after(mesh, around.corners[i % around.n], is_next ? 1 : 2);
            if (end_id == far || (!is_next && leads_to(mesh, around, end_id)))
                continue;
            const struct vector middle = weighted(
                meeting, vector_at(mesh->points[end_id]), 0.5, 0.5);
            double least = distance_around(mesh, near, -1, from, middle, most);
            if (least > most)
                least = min_f64(least, distance_around(mesh, far, near, other, middle, most));
            if (least > most && least < INFINITY)
                most = least;
        }
    }
    return most;
}

/* The greatest squared distance of the places that two vertices stand for, if these meet; `with_edges`
   also of new edges, which may bridge a hole. */
double distance_of_places(
    const struct collapsible_mesh *mesh, const struct carried_places *places,
    const int32_t *vertex_ids, int32_t u, int32_t v, struct vector meeting, bool with_edges)
{
    double most = 0.0;
    for (int end = 0; end < 2; end++) {
        const int32_t near = end == 0 ? u : v, far = end == 0 ? v : u;
        for (int32_t place = places->first[vertex_ids[near]]; place >= 0; place = places->next[place]) {
            const struct vector point = vector_at(places->points[place]);
            double least = distance_around(mesh, near, far, meeting, point, most);
            if (least > most)
                least = min_f64(least, distance_around(mesh, far, near, meeting, point, most));
            if (least > most && least < INFINITY)
                most = least;
        }
    }
    return with_edges ? distance_of_edges(mesh, u, v, meeting, most) : most;
}

/* Let each of the two vertices that one has become stand for what is closer to it. */
void share_places(
    const struct collapsible_mesh *mesh, struct carried_places *places, const int32_t *vertex_ids,
    int32_t vertex, int32_t half)
{
    int32_t place = places->first[vertex_ids[vertex]];
    places->first[vertex_ids[vertex]] = places->first[vertex_ids[half]] = -1;
    while (place >= 0) {
        const struct vector point = vector_at(places->points[place]);
        const struct vector at = vector_at(mesh->points[vertex]);
        const double of_vertex = distance_around(mesh, vertex, -1, at, point, 0.0);
        const double of_half = distance_around(mesh, half, -1, at, point, 0.0);
        const int32_t list = vertex_ids[of_half < of_vertex ? half : vertex];
        const int32_t next = places->next[place];
        places->next[place] = -1;
        if (places->first[list] < 0)
            places->first[list] = place;
        else
            places->next[places->last[list]] = place;
        places->last[list] = place;
        place = next;
    }
}
