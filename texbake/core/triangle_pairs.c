/* Triangles that follow each other in a list and share an edge, joined to quads for Embree.

   Sculpts and scans list most of their triangles in such pairs (88 and 99 % in two MRI scans).

   Called from texbake/raycast/embree.py. */

#include <stdbool.h>

#include "core.h"

/* Write quads v0, v1, v2, v3, which are the triangles (v0, v1, v3) and (v2, v3, v1), the second without
   area where v2 = v3; and the first face of each. Returns the number of quads. */
int64_t pair_triangles(
    int64_t n, const int32_t faces[n][3], int32_t quads[n][4], int32_t first_faces[n + 1])
{
    int64_t n_quads = 0;
    for (int64_t face = 0; face < n;) {
        first_faces[n_quads] = (int32_t)face;
        int32_t *quad = quads[n_quads++];
        quad[0] = faces[face][0], quad[1] = faces[face][1];
        quad[2] = quad[3] = faces[face][2];
        bool paired = false;
        for (int edge = 0; edge < 3 && face + 1 < n; edge++) {
            /* The edge opposite v0, from v1 to v3; its neighbor runs along it from v3 to v1. */
            const int32_t v1 = faces[face][(edge + 1) % 3], v3 = faces[face][(edge + 2) % 3];
            const int32_t *next = faces[face + 1];
            for (int other = 0; other < 3; other++)
                if (next[other] == v3 && next[(other + 1) % 3] == v1) {
                    quad[0] = faces[face][edge], quad[1] = v1;
                    quad[2] = next[(other + 2) % 3], quad[3] = v3;
                    paired = true;
                }
        }
        face += paired ? 2 : 1;
    }
    first_faces[n_quads] = (int32_t)n;
    return n_quads;
}
