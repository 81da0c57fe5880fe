/* A part of a mesh while it is cut into charts, for other files of the core. A part is here any set
   of faces that is flattened together; it becomes a chart, or is divided into smaller parts. */

#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "arena.h"

/* Some faces of the root part, ascending, and how they are connected and laid out. */
struct part {
    int64_t n_faces;
    int32_t *face_ids;
    int32_t *opposite;     /* of each half-edge, numbered within the part; -1: none */
    int32_t (*faces)[3];   /* vertices: one for each fan of faces */
    int64_t n_vertices;
    double (*uvs)[2];
    double area, l2;
    double hull_area, length; /* of the layout: area of its convex hull, and its greatest extent */
    bool is_laid, is_injective;
    struct part *halves;   /* once they are made */
    int64_t n_halves;
};

/* Limits that charts must keep. */
struct chart_limits {
    double most_l2;     /* stretch */
    double most_length; /* a longer one is divided */
    double most_area;   /* a larger one is divided, but for one that is nearly all there is */
    double most_flat_area; /* the same for one that is hardly stretched, if more */
    double total_area;  /* of all charts of the mesh */
    double tiny_area;   /* of a chart whose stretch hardly counts */
    double depth;       /* overlaps up to this depth do not count */
};

/* The root part, and the charts found in it so far. */
struct cutting {
    struct arena *arena;
    const double (*points)[3];
    const int32_t (*corners)[3];
    const double (*lengths)[3]; /* negative within a polygon */
    const double (*weights)[3]; /* of seams along each side */
    double (*normals)[3]; /* without noise; of unit length, or 0 */
    double *areas;
    struct chart_limits limits;
    bool is_noisy; /* stretch that dividing does not lower is accepted */
    int64_t n_faces;
    int32_t *opposite;    /* -1 also where a chart was cut open */
    struct part **charts; /* room for two per face; NULL: joined with another */
    int64_t n_charts;
};

static inline int32_t next_corner(int32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

/* Length in space of a side of a face of the root. */
static inline double side_length(const struct cutting *cutting, int32_t face, int side)
{
    const double *a = cutting->points[cutting->corners[face][side]];
    const double *b = cutting->points[cutting->corners[face][(side + 1) % 3]];
    const double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return sqrt(x * x + y * y + z * z);
}

/* Whether a half-edge of a part lies between triangles of one polygon of the mesh. */
static inline bool is_in_polygon(const struct cutting *cutting, const struct part *part, int32_t edge)
{
    return part->opposite[edge] >= 0
        && cutting->lengths[part->face_ids[edge / 3]][edge % 3] < 0.0;
}

/* part_layout.c: number the vertices of a part (corners are one vertex if the faces between them are
   connected), and return their places. */
double (*place_vertices(const struct cutting *cutting, struct part *part))[3];

/* Most Newton steps of a layout. */
enum { FULL_EFFORT = 50 };

/* Flatten all faces of a part together, unless too many of them overlap. The second has its vertices
   already, and begins with the layout in `part->uvs` if `has_start`. */
void lay_out(const struct cutting *cutting, struct part *part);
void lay_out_from(
    const struct cutting *cutting, struct part *part, const double (*places)[3], bool has_start,
    int64_t n_steps);

/* Measure the hull and the length of a layout. */
void measure_hull(struct part *part);

/* layout_division.c: whether a layout is compact and not too large; and a part divided along a line
   through its layout, NULL if that does not help. */
bool packs_well(const struct cutting *cutting, const struct part *part);
struct part *divide_layout(const struct cutting *cutting, const struct part *part, int64_t *n_parts);

/* part_division.c: whether a part is one piece; divide a part in pieces, along creases, or in halves,
   and flatten each. */
bool is_connected(const struct cutting *cutting, const struct part *part);
void divide(const struct cutting *cutting, struct part *part);

/* Move the borders between labels of the faces of a part, by the weights of edges. */
void straighten(const struct cutting *cutting, const struct part *part, int32_t *labels);

/* Find the first face in the polygon of each face of a part. */
void find_polygons(const struct cutting *cutting, const struct part *part, int32_t *firsts);

/* Make a part of the faces of each label. */
struct part *split(
    struct arena *arena, const struct part *part, const int32_t *labels, int32_t n_labels);

/* seam_cutting.c: cut a part with holes, such as a tube, open from one to the next until its stretch is
   within bounds; false, and the part as it was, if it does not help. */
bool cut_open(struct cutting *cutting, struct part *part);

/* chart_joining.c: let charts join neighbors. */
void join_charts(struct cutting *cutting);
