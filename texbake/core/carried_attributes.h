/* Texture coordinates and normals that follow the vertices of a collapsible mesh; see
   carried_attributes.c. */

#ifndef TEXBAKE_CARRIED_ATTRIBUTES_H
#define TEXBAKE_CARRIED_ATTRIBUTES_H

#include "collapsible_mesh.h"

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
    struct collapsible_mesh *mesh, const struct carried_attributes *attributes, int32_t u, int32_t v,
    struct vector place, const struct collapse *collapse);

#endif
