/* Clipping triangles, and snapping their corners to the fixed-point grid of the screen.

   The screen has width x height samples, each at the center of its cell, with row 0 at the top.
   Positions are integers in 1/256 of a sample, so coverage is decided exactly. Corners in front of
   the near plane and within the guard band are snapped directly; a triangle with any other corner is
   first clipped in homogeneous coordinates.

   Based on: Sutherland and Hodgman, "Reentrant polygon clipping", CACM 17(1), 1974; Blinn and Newell,
   "Clipping using homogeneous coordinates", SIGGRAPH 1978. The guard band is so wide that few
   triangles reach it. Intersections are always computed from the inner end of an edge, so two
   triangles that share an edge are cut at the same point.

   Called from texbake/rendering/rasterize.py, visibility_buffer.c and scanline_rasterizer.c. */

#include "clipping.h"

#include <string.h>

#include "core.h"

/* Samples on either side of the screen's center. With the 2^18 samples of the largest screen, grid
   coordinates stay below 2^28 and edge functions below 2^60. */
static const double GUARD = 0x1p19;

enum { N_PLANES = 5 }; /* near, left, right, bottom, top */

struct guard_band {
    double x, y; /* half its size in clip space, in units of w */
};

static struct guard_band guard_band_of(int64_t width, int64_t height)
{
    return (struct guard_band){2.0 * GUARD / width, 2.0 * GUARD / height};
}

/* Snap a point of clip space (w > 0) to the grid: column and row in 1/256 of a sample. */
static inline void to_grid(const double *clip, int64_t width, int64_t height, int64_t *point)
{
    const double column = (0.5 + 0.5 * clip[0] / clip[3]) * width;
    const double row = (0.5 - 0.5 * clip[1] / clip[3]) * height;
    point[0] = (int64_t)floor(column * SUBPIXELS + 0.5);
    point[1] = (int64_t)floor(row * SUBPIXELS + 0.5);
}

EXPORT void project_vertices(
    int64_t n, const double positions[n][3], const double matrix[4][4], int64_t width,
    int64_t height, int32_t grid[n][2], float depths[n], int64_t start, int64_t stop)
{
    const struct guard_band guard = guard_band_of(width, height);
    for (int64_t v = start; v < stop; v++) {
        double clip[4];
        to_clip(matrix, positions[v], clip);
        const double x = clip[0], y = clip[1], z = clip[2], w = clip[3];
        if (z <= w && fabs(x) <= guard.x * w && fabs(y) <= guard.y * w && 0.0 < w && w < INFINITY) {
            int64_t point[2];
            to_grid(clip, width, height, point);
            grid[v][0] = (int32_t)point[0];
            grid[v][1] = (int32_t)point[1];
            depths[v] = (float)(z / w);
        } else {
            grid[v][0] = OFF_GRID;
        }
    }
}

/* Signed distance of a point of clip space to a plane. */
static double inside(const double *corner, int plane, struct guard_band guard)
{
    switch (plane) {
    case 0: return corner[3] - corner[2];
    case 1: return guard.x * corner[3] + corner[0];
    case 2: return guard.x * corner[3] - corner[0];
    case 3: return guard.y * corner[3] + corner[1];
    default: return guard.y * corner[3] - corner[1];
    }
}

/* Intersect an edge with a plane, always starting from the inner end. */
static void cut(
    const double *from, const double *to, double distance_in, double distance_out, double *made)
{
    const double along = distance_in / (distance_in - distance_out);
    for (int k = 0; k < 4; k++)
        made[k] = from[k] + along * (to[k] - from[k]);
}

/* Clip a convex polygon against a plane; return the number of corners left, 0 for none. */
static int64_t clip_by_plane(
    int64_t n_corners, const double (*polygon)[4], int plane, struct guard_band guard,
    double (*kept)[4])
{
    int64_t n_kept = 0;
    for (int64_t i = 0; i < n_corners; i++) {
        const double *here = polygon[i], *after = polygon[(i + 1) % n_corners];
        const double distance = inside(here, plane, guard);
        const double distance_after = inside(after, plane, guard);
        if (distance >= 0.0) {
            memcpy(kept[n_kept++], here, sizeof *kept);
            if (distance_after < 0.0)
                cut(here, after, distance, distance_after, kept[n_kept++]);
        } else if (distance_after >= 0.0) {
            cut(after, here, distance_after, distance, kept[n_kept++]);
        }
    }
    return n_kept;
}

/* Clip a triangle against the near plane and the guard band, and snap the rest to the grid. No
   corner is left if a coordinate is not finite. */
void clip_triangle(
    const double (*positions)[3], const int32_t *corners, const double (*matrix)[4], int64_t width,
    int64_t height, struct clipped_triangle *clipped)
{
    double polygon[MAX_CORNERS][4], kept[MAX_CORNERS][4];
    clipped->n_corners = 0;
    for (int i = 0; i < 3; i++) {
        to_clip(matrix, positions[corners[i]], polygon[i]);
        for (int k = 0; k < 4; k++)
            if (!isfinite(polygon[i][k]))
                return;
    }
    const struct guard_band guard = guard_band_of(width, height);
    int64_t n_corners = 3;
    for (int plane = 0; plane < N_PLANES; plane++) {
        n_corners = clip_by_plane(n_corners, polygon, plane, guard, kept);
        memcpy(polygon, kept, n_corners * sizeof *kept);
    }
    for (int64_t i = 0; i < n_corners; i++) {
        if (!(polygon[i][3] > 0.0)) /* the position of the camera itself */
            return;
        to_grid(polygon[i], width, height, clipped->points[i]);
        clipped->depths[i] = (float)(polygon[i][2] / polygon[i][3]);
    }
    clipped->n_corners = n_corners;
}
