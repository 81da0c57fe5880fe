/* Shadow maps: what of a picture they have to cover, and how much of a light reaches a point.

   texbake/rendering/effects/shadows.py describes the tests that a texel has to pass to occlude a
   point, and names their sources.

   Called from texbake/rendering/effects: shadows.py and shadow_fit.py. */

#include <math.h>

#include "core.h"
#include "fragment_values.h"
#include "numbers.h"
#include "objects.h"

/* Maximum distance that snapping moves a corner along an axis, in texels: half a subpixel of the
   rasterizer. */
static const double SNAPPED = 0.5 / 256;

/* Twice the rounding error of a float32: once for the corners' depths, once for their mean. */
static const double ROUNDED = 1.0 / (1 << 23);

/* Extend the bounds of an object, by default empty, to a point along the axes and a margin. */
static void extend_bounds(
    double bounds[2][3], const double axes[3][3], const double point[3], double room)
{
    for (int k = 0; k < 3; k++) {
        double at = 0.0;
        for (int j = 0; j < 3; j++)
            at += axes[k][j] * point[j];
        bounds[0][k] = min_f64(bounds[0][k], at - room);
        bounds[1][k] = max_f64(bounds[1][k], at + room);
    }
}

/* Extend each object's bounds along a light's axes by its visible samples. */
EXPORT void find_seen_bounds(
    int64_t height, int64_t width, int64_t n_objects, const int32_t face_ids[height][width],
    const float depths[height][width], const double rays[3][3], const double eye[3], double near,
    const int64_t starts[n_objects + 1], const bool receives[n_objects], const double axes[3][3],
    double rounding, int64_t first, int64_t stop, double bounds[n_objects][2][3])
{
    int64_t owner = 0;
    for (int64_t row = first; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            const int32_t face = face_ids[row][column];
            if (face < 0)
                continue;
            owner = object_near(owner, face, n_objects, starts);
            if (!receives[owner])
                continue;
            const double distance = near / depths[row][column];
            const double x = column + 0.5, y = row + 0.5;
            double squared = 0.0, point[3];
            for (int k = 0; k < 3; k++) {
                const double ray = rays[0][k] + x * rays[1][k] + y * rays[2][k];
                squared += ray * ray;
                point[k] = eye[k] + distance * ray;
            }
            extend_bounds(bounds[owner], axes, point, rounding * distance * sqrt(squared));
        }
    }
}

/* The views of a light and what it sees in them. */
struct shadow_map {
    int64_t height, width;
    const double (*positions)[3]; /* of the world */
    const int32_t (*faces)[3];
    int64_t first_own, stop_own; /* faces of the object that the points belong to */
    const float *depths; /* of one view */
    const int32_t *face_ids;
    const double (*inverse)[4];
    bool is_cone;
    double radius;
};

/* A point on the map: column and row in texels, its depth, its x/w and y/w, and the growth of its
   plane's depth per texel to the right and down. */
struct shaded_point {
    double column, row, depth, x, y, slopes[2];
};

/* Cube face that a point projects to, by its largest component. */
static int64_t view_of(const double point[3], const double light[3])
{
    int64_t face = 0;
    double largest = -1.0;
    for (int k = 0; k < 3; k++) {
        const double offset = point[k] - light[k];
        if (fabs(offset) > largest) {
            largest = fabs(offset);
            face = offset > 0.0 ? 2 * k : 2 * k + 1;
        }
    }
    return face;
}

/* Write the plane (a, b, c, d) of a triangle in clip space, a x + b y + c z + d w = 0, computed
   relative to `anchor`; all 0 for a triangle without area. */
static void find_plane(
    const struct shadow_map *map, int32_t face, const double anchor[3], double plane[4])
{
    const int32_t *corners = map->faces[face];
    const double *p = map->positions[corners[0]], *q = map->positions[corners[1]];
    const double *r = map->positions[corners[2]];
    double offset = 0.0;
    for (int j = 0; j < 4; j++)
        plane[j] = 0.0;
    for (int k = 0; k < 3; k++) {
        const int y = (k + 1) % 3, z = (k + 2) % 3;
        const double normal = (q[y] - p[y]) * (r[z] - p[z]) - (q[z] - p[z]) * (r[y] - p[y]);
        offset -= normal * anchor[k];
        for (int j = 0; j < 4; j++)
            plane[j] += map->inverse[k][j] * normal;
    }
    for (int j = 0; j < 4; j++)
        plane[j] += map->inverse[3][j] * offset;
}

/* The plane of a texel's triangle at a point: its depth there, and its growth per texel. */
struct occluder {
    int64_t face;
    double there, right, down;
};

static struct occluder find_occluder(
    const struct shadow_map *map, int32_t face, const struct shaded_point *at)
{
    double plane[4];
    find_plane(map, face, map->positions[map->faces[face][0]], plane);
    /* The plane of a triangle seen edge-on is unusable; the first test decides. */
    struct occluder found = {face, INFINITY, 0.0, 0.0};
    if (plane[2] != 0.0) {
        found.there = -(plane[0] * at->x + plane[1] * at->y + plane[3]) / plane[2];
        found.right = fabs(plane[0] / plane[2]) * 2.0 / map->width;
        found.down = fabs(plane[1] / plane[2]) * 2.0 / map->height;
    }
    return found;
}

/* Whether a texel that lies in front of the point's plane occludes the point. */
static bool occludes(
    const struct occluder *occluder, const struct shaded_point *at, float seen, bool is_own,
    double across, double along)
{
    const double least = at->depth + ROUNDED * max_f64(fabs(at->depth), seen);
    bool shades = occluder->there > least;
    if (shades && is_own) {
        double rise = fabs(across) * max_f64(occluder->right, fabs(at->slopes[0]));
        rise += fabs(along) * max_f64(occluder->down, fabs(at->slopes[1]));
        shades = seen > least + rise;
    }
    return shades;
}

/* Width of the part of texel `i` that the filter's interval about a place covers. */
static inline double covered_by_filter(double place, double radius, int64_t i)
{
    return min_f64(place + radius, i + 1.0) - max_f64(place - radius, (double)i);
}

/* Lit share of the filter's square around a point. */
static double lit_share(const struct shadow_map *map, const struct shaded_point *at)
{
    const int64_t height = map->height, width = map->width;
    const double radius = map->radius, column = at->column, row = at->row;
    if (!(-radius <= column && column <= width + radius && -radius <= row && row <= height + radius))
        return 1.0;
    const double room = (fabs(at->slopes[0]) + fabs(at->slopes[1])) * SNAPPED;
    const int64_t bottom = (int64_t)floor(row + radius), right = (int64_t)floor(column + radius);
    double lit = 0.0, meeting = 0.0, dark = 0.0;
    struct occluder occluder = {-1, INFINITY, 0.0, 0.0};
    for (int64_t j = (int64_t)floor(row - radius); j <= bottom; j++) {
        const double tall = radius > 0.0 ? covered_by_filter(row, radius, j) : 1.0;
        for (int64_t i = (int64_t)floor(column - radius); i <= right; i++) {
            const double area =
                radius > 0.0 ? tall * covered_by_filter(column, radius, i) : tall;
            const double across = i + 0.5 - column, along = j + 0.5 - row;
            const double here = at->depth + across * at->slopes[0] + along * at->slopes[1];
            const bool inside = 0 <= i && i < width && 0 <= j && j < height;
            if (map->is_cone && (here <= 0.0 || !inside))
                continue; /* beyond the horizon of the point's plane, or outside the map */
            /* There are no casters outside the map of a directional light. */
            const float seen = inside ? map->depths[j * width + i] : 0.0f;
            if (seen <= 0.0f || seen <= here + room + ROUNDED * seen) {
                lit += area;
                continue;
            }
            const int32_t face = map->face_ids[j * width + i];
            if (face != occluder.face)
                occluder = find_occluder(map, face, at);
            const bool is_own = map->first_own <= face && face < map->stop_own;
            if (occludes(&occluder, at, seen, is_own, across, along))
                dark += area;
            else if (is_own)
                lit += area;
            else
                meeting += area;
        }
    }
    /* The surfaces cannot meet if no texel sees the point's own surface. */
    if (lit == 0.0)
        return dark + meeting > 0.0 ? 0.0 : 1.0;
    return (lit + meeting) / (lit + meeting + dark);
}

/* Lit share of a point of a triangle: 1 where the map has nothing to say. */
static double share_at(
    const struct shadow_map *map, const double view[4][4], const double point[3], int32_t face)
{
    double clip[4], plane[4];
    for (int j = 0; j < 4; j++) {
        clip[j] = view[j][3];
        for (int k = 0; k < 3; k++)
            clip[j] += view[j][k] * point[k];
    }
    find_plane(map, face, point, plane);
    if (!(clip[3] > 0.0 && plane[2] != 0.0))
        return 1.0;
    const double x = clip[0] / clip[3], y = clip[1] / clip[3], depth = clip[2] / clip[3];
    const struct shaded_point at = {
        (0.5 + 0.5 * x) * map->width, (0.5 - 0.5 * y) * map->height, depth, x, y,
        {-plane[0] / plane[2] * 2.0 / map->width, plane[1] / plane[2] * 2.0 / map->height}};
    if (!isfinite(at.column + at.row + depth + at.slopes[0] + at.slopes[1]))
        return 1.0;
    return lit_share(map, &at);
}

/* Write a light's radiance times the lit share from its shadow map. All points lie on faces from
   `first_own` to before `stop_own`. */
EXPORT void dim_by_shadow(
    int64_t n, int64_t n_positions, int64_t n_faces, int64_t n_views, int64_t height,
    int64_t width, int64_t n_directions, int64_t n_radiance, const double points[n][3],
    const float normals[n][3], const int32_t own_faces[n], int64_t first_own, int64_t stop_own,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double views[n_views][4][4], const float depths[n_views][height][width],
    const int32_t face_ids[n_views][height][width], const double inverses[n_views][4][4],
    bool is_cone, const double light[3], double radius,
    const float directions[n_directions][3], const float radiance[n_radiance][3],
    float out[n][3])
{
    struct shadow_map map = {
        .height = height, .width = width, .positions = positions, .faces = faces,
        .first_own = first_own, .stop_own = stop_own, .is_cone = is_cone, .radius = radius};
    for (int64_t i = 0; i < n; i++) {
        const float *arriving = radiance[row_of(n_radiance, i)];
        const double facing = sum_products(normals[i], directions[row_of(n_directions, i)]);
        double strength = 0.0;
        for (int k = 0; k < 3; k++)
            strength = max_f64(strength, arriving[k]);
        double share = 1.0;
        /* Points that face away from the light reflect nothing, so shadows are skipped. */
        if (facing > 0.0 && strength > 0.0) {
            const int64_t view = n_views > 1 ? view_of(points[i], light) : 0;
            map.depths = depths[view][0];
            map.face_ids = face_ids[view][0];
            map.inverse = inverses[view];
            share = share_at(&map, views[view], points[i], own_faces[i]);
        }
        for (int k = 0; k < 3; k++)
            out[i][k] = (float)(arriving[k] * share);
    }
}
