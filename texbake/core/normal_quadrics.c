/* What a collapse does to shading: the squared change of normals that a surface interpolates.

   Over a face, normals change linearly. The error of a vertex sums the squared differences between
   these functions, continued to where it goes, and the normal there, weighted with the areas of its
   faces. At a hard edge, each of the normals has an error of its own.

   Based on: Hoppe, "New quadric metric for simplifying meshes with appearance attributes", 1999.

   Called from quadric_simplification.c. */

#include "simplification.h"

#include <math.h>

/* Normals of a face as three functions g p + d. */
static bool normals_of_face(
    const double (*points)[4], const int32_t *face, const double *const normals[3],
    double functions[3][4], double *area)
{
    const struct vector a = vector_at(points[face[0]]);
    const struct vector ab = minus(vector_at(points[face[1]]), a);
    const struct vector ac = minus(vector_at(points[face[2]]), a);
    const struct vector across = cross(ab, ac);
    const double squared = dot(across, across);
    if (!(squared > 0.0))
        return false;
    const struct vector of_b = cross(ac, across), of_c = cross(across, ab);
    for (int k = 0; k < 3; k++) {
        const double b = (normals[1][k] - normals[0][k]) / squared;
        const double c = (normals[2][k] - normals[0][k]) / squared;
        const struct vector slope = weighted(of_b, of_c, b, c);
        functions[k][0] = slope.x;
        functions[k][1] = slope.y;
        functions[k][2] = slope.z;
        functions[k][3] = normals[0][k] - dot(slope, a);
    }
    *area = 0.5 * sqrt(squared);
    return true;
}

static void add_functions(struct normal_quadric *q, const double functions[3][4], double weight)
{
    q->weight += weight;
    for (int k = 0; k < 3; k++) {
        const double *f = functions[k];
        q->squares = add_quadrics(&q->squares, &(struct quadric){
            weight * f[0] * f[0], weight * f[0] * f[1], weight * f[0] * f[2], weight * f[1] * f[1],
            weight * f[1] * f[2], weight * f[2] * f[2], weight * f[0] * f[3], weight * f[1] * f[3],
            weight * f[2] * f[3], weight * f[3] * f[3]});
        for (int i = 0; i < 4; i++)
            q->sums[k][i] += weight * f[i];
    }
}

/* Add one quadric to another. */
void add_normal_quadrics(struct normal_quadric *to, const struct normal_quadric *added)
{
    to->squares = add_quadrics(&to->squares, &added->squares);
    to->weight += added->weight;
    for (int i = 0; i < 12; i++)
        to->sums[i / 4][i % 4] += added->sums[i / 4][i % 4];
}

/* The error of a normal at a place. */
double normal_error(const struct normal_quadric *q, struct vector p, const double *normal)
{
    double error = quadric_at(&q->squares, p);
    for (int k = 0; k < 3; k++) {
        const double *s = q->sums[k];
        const double mean = s[0] * p.x + s[1] * p.y + s[2] * p.z + s[3];
        error += normal[k] * (q->weight * normal[k] - 2.0 * mean);
    }
    return error > 0.0 ? error : 0.0;
}

/* Add the normals of the faces of a mesh to the quadrics of their rows. */
void add_face_normals(
    const struct collapsible_mesh *mesh, const struct attribute *attribute,
    struct normal_quadric *quadrics)
{
    for (int64_t i = 0; i < mesh->n_faces; i++) {
        int64_t rows[3];
        const double *normals[3];
        for (int k = 0; k < 3; k++) {
            rows[k] = attribute->row_of[mesh->wedges[i][k]];
            normals[k] = attribute->values + 3 * rows[k];
        }
        double functions[3][4], area;
        const double (*points)[4] = (const double(*)[4])mesh->points;
        if (!normals_of_face(points, mesh->faces[i], normals, functions, &area))
            continue;
        for (int k = 0; k < 3; k++)
            add_functions(&quadrics[rows[k]], (const double(*)[4])functions, area);
    }
}
