/* Texture coordinates and normals at a vertex that moves with the collapse of an edge.

   The new place takes the values of the closest point on the faces around both ends, as they are
   before the collapse. At a seam each side looks at its own faces only, so that neither runs over
   the edge of its chart, and values that both sides have in common stay one.

   Based on: Cohen, Manocha, Olano, "Simplifying polygonal models using successive mappings", 1997;
   Hoppe, "New quadric metric for simplifying meshes with appearance attributes", 1999 (wedges).

   Called from quadric_simplification.c. */

#include "simplification.h"

#include <math.h>
#include <string.h>

#include "closest_on_triangle.h"

enum { MOST_COMPONENTS = 3 };

/* A row of v, the one of u that becomes it, and the value that it gets. */
struct change {
    int32_t row_u, row_v;
    double value[MOST_COMPONENTS];
};

static inline int32_t row_at(
    const struct collapsible_mesh *mesh, const struct attribute *attribute, int32_t corner)
{
    return attribute->row_of[wedge_at(mesh, corner)];
}

/* Look at the faces of some corners that have a row, and interpolate in the closest; return the
   squared distance to it, or the one given if none is closer. */
static double interpolate_closest(
    const struct collapsible_mesh *mesh, const struct attribute *attribute, struct corners around,
    int32_t row, struct vector place, double least, double *value)
{
    for (int64_t i = 0; i < around.n; i++) {
        const int32_t corner = around.corners[i];
        if (row_at(mesh, attribute, corner) != row)
            continue;
        const int32_t *face = mesh->faces[corner >> 2], *wedges = mesh->wedges[corner >> 2];
        const struct vector a = vector_at(mesh->points[face[0]]);
        const struct nearness near = closest_on_triangle(
            minus(vector_at(mesh->points[face[1]]), a), minus(vector_at(mesh->points[face[2]]), a),
            minus(place, a));
        if (!(near.squared < least))
            continue;
        least = near.squared;
        const double weights[3] = {1.0 - near.v - near.w, near.v, near.w};
        for (int c = 0; c < attribute->n_components; c++) {
            value[c] = 0.0;
            for (int k = 0; k < 3; k++) {
                const int64_t at = (int64_t)attribute->row_of[wedges[k]] * attribute->n_components;
                value[c] += weights[k] * attribute->values[at + c];
            }
        }
    }
    return least;
}

static void make_unit(double *value)
{
    const struct vector v = vector_at(value);
    const double length = sqrt(dot(v, v));
    if (!(length > 0.0))
        return;
    for (int c = 0; c < 3; c++)
        value[c] /= length;
}

/* The values that the rows of v get; returns how many rows there are. */
static int list_changes(
    const struct collapsible_mesh *mesh, const struct attribute *attribute, struct corners of_u,
    struct corners of_v, int32_t v, struct vector place, const struct collapse *collapse,
    struct change changes[2])
{
    const bool moves = memcmp(mesh->points[v], &place, sizeof place) != 0;
    const size_t size = (size_t)attribute->n_components * sizeof(double);
    int n = 0;
    for (int side = 0; side < 2; side++) {
        const int32_t row_u = attribute->row_of[collapse->wedges_u[side]];
        const int32_t row_v = attribute->row_of[collapse->wedges_v[side]];
        if (n == 1 && changes[0].row_u == row_u && changes[0].row_v == row_v)
            continue;
        struct change *change = &changes[n++];
        change->row_u = row_u;
        change->row_v = row_v;
        memcpy(change->value, attribute->values + (int64_t)row_v * attribute->n_components, size);
        if (!moves)
            continue;
        const double least = interpolate_closest(
            mesh, attribute, of_u, row_u, place, INFINITY, change->value);
        interpolate_closest(mesh, attribute, of_v, row_v, place, least, change->value);
        if (attribute->is_unit)
            make_unit(change->value);
    }
    return n;
}

static inline double area_of(const double *const uvs[3])
{
    return (uvs[1][0] - uvs[0][0]) * (uvs[2][1] - uvs[0][1])
        - (uvs[2][0] - uvs[0][0]) * (uvs[1][1] - uvs[0][1]);
}

/* Whether no face of some corners flips in texture space. The faces of the edge do not count:
   the collapse removes them. */
static bool charts_stay(
    const struct collapsible_mesh *mesh, const struct attribute *uvs, struct corners around,
    int32_t other, bool is_u, int n_changes, const struct change changes[2])
{
    for (int64_t i = 0; i < around.n; i++) {
        const int32_t corner = around.corners[i];
        const int32_t *face = mesh->faces[corner >> 2], *wedges = mesh->wedges[corner >> 2];
        if (face[0] == other || face[1] == other || face[2] == other)
            continue;
        const double *before[3], *after[3];
        for (int k = 0; k < 3; k++)
            before[k] = after[k] = uvs->values + 2 * (int64_t)uvs->row_of[wedges[k]];
        const int32_t row = row_at(mesh, uvs, corner);
        for (int j = 0; j < n_changes; j++)
            if (row == (is_u ? changes[j].row_u : changes[j].row_v))
                after[corner & 3] = changes[j].value;
        const double area = area_of(before);
        if (area != 0.0 && !(area * area_of(after) > 0.0))
            return false;
    }
    return true;
}

static void write_changes(
    const struct attribute *attribute, int n_changes, const struct change changes[2])
{
    for (int j = 0; j < n_changes; j++)
        memcpy(
            attribute->values + (int64_t)changes[j].row_v * attribute->n_components,
            changes[j].value, (size_t)attribute->n_components * sizeof(double));
}

/* Give the wedges of v what they have where u and v meet; false, and nothing changed, where a face
   would turn over in texture space. To be called before the collapse. */
bool carry_attributes(
    const struct collapsible_mesh *mesh, const struct carried_attributes *attributes, int32_t u,
    int32_t v, struct vector place, const struct collapse *collapse)
{
    const struct attribute *uvs = &attributes->uvs, *normals = &attributes->normals;
    if (uvs->n_components == 0 && normals->n_components == 0)
        return true;
    const struct corners of_u = corners_of(mesh, u), of_v = corners_of(mesh, v);
    struct change changes[2];
    if (uvs->n_components > 0) {
        const int n = list_changes(mesh, uvs, of_u, of_v, v, place, collapse, changes);
        if (!charts_stay(mesh, uvs, of_u, v, true, n, changes)
            || !charts_stay(mesh, uvs, of_v, u, false, n, changes))
            return false;
        write_changes(uvs, n, changes);
    }
    if (normals->n_components > 0) {
        const int n = list_changes(mesh, normals, of_u, of_v, v, place, collapse, changes);
        write_changes(normals, n, changes);
    }
    return true;
}
