/* Every function that Python calls, and the one table of what each may be given.

   `texbake/core/declarations.py` reads these prototypes, and `binding.py` checks every array by them:
   its type, its dimensions, that it is contiguous and aligned, that sizes of the same name agree, and
   that what is written to is writable. An array that is only read is `const`.

   A size stands before the arrays that have it. Where an array's dimension is the size alone, or
   the size plus or minus a constant, Python does not pass it: it comes from the shape. An array that
   may be left out (None in Python, NULL here) is OPTIONAL, and its sizes are then 0.

   A function that needs memory of its own takes it from an arena (arena.h) and returns int64_t,
   OUT_OF_MEMORY if there is none; Python then raises MemoryError. */

#ifndef TEXBAKE_CORE_H
#define TEXBAKE_CORE_H

#include <stdbool.h>
#include <stdint.h>

#define OPTIONAL
#define OUT_OF_MEMORY INT64_MIN

#pragma GCC visibility push(default)

/* ambient_occlusion.c */
void find_places(
    int64_t sample_rows, int64_t sample_columns, int64_t n_positions, int64_t n_faces,
    int64_t height, int64_t width, const int32_t face_ids[sample_rows][sample_columns],
    const float depths[sample_rows][sample_columns], int64_t side, double near,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double rays[3][3], double places[height][width][3], double normals[height][width][3],
    int64_t start, int64_t stop);
void find_arriving_shares(
    int64_t height, int64_t width, const double places[height][width][3],
    const double normals[height][width][3], const double right[3], const double up[3],
    double pixels_per_unit, double radius, int64_t n_slices, int64_t n_steps,
    float out[height][width], int64_t start, int64_t stop);
void smooth_shares(
    int64_t height, int64_t width, const float rough[height][width],
    const double places[height][width][3], const double normals[height][width][3], double radius,
    float out[height][width], int64_t start, int64_t stop);

/* barycentric.c */
void interpolate_corners(
    int64_t n, int64_t n_faces, int64_t n_values, int64_t n_channels, const int32_t faces[n],
    const float barycentrics[n][2], const float values[n_values][n_channels],
    const int32_t corners[n_faces][3], float found[n][n_channels]);

void interpolate_high_normals(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const float normals[n_normals][3],
    const int32_t corners[n_faces][3], float values[n][3]);

void from_tangent_space(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const float normals[n_normals][3],
    const int32_t corners[n_faces][3], const float tangents[n_faces][3][4], float values[n][3]);

void to_tangent_space(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const double normals[n_normals][3],
    const int32_t corners[n_faces][3], const float tangents[n_faces][3][4], bool normalize,
    float values[n][3]);

void measure_displacements(
    int64_t n, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const float offsets[n][3], const double normals[n_normals][3],
    const int32_t corners[n_faces][3], float values[n][1]);

void move_points(
    int64_t n, int64_t n_faces, int64_t n_vertices, const int32_t faces[n],
    const float barycentrics[n][2], const float offsets[n][3],
    const double positions[n_vertices][3], const int32_t corners[n_faces][3], float values[n][3]);

void place_in_image(
    int64_t n, int64_t n_faces, int64_t n_uvs, const int32_t faces[n],
    const float barycentrics[n][2], const double uvs[n_uvs][2], const int32_t corners[n_faces][3],
    const double placing[2][3], double places[n][2]);

/* bilinear_lookup.c */
void sample_bilinear(
    int64_t height, int64_t width, int64_t n_channels, int64_t n,
    const float image[height][width][n_channels], const double uvs[n][2], int64_t wraps,
    const float border[n_channels], float out[n][n_channels], int64_t start, int64_t stop);

void sample_nearest(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t sizes[n_levels][2],
    const double uvs[n][2], int64_t wraps, const float border[n_channels],
    float out[n][n_channels], int64_t start, int64_t stop);

/* bottom_left.c */
int64_t place_charts(
    int64_t n_cells, int64_t n_charts, int64_t n_poses, int64_t n_order, int64_t n_widths,
    const uint8_t masks[n_cells], const int64_t starts[n_charts][n_poses],
    const int64_t boxes[n_charts][n_poses][2], const int32_t order[n_order], int64_t n_rows,
    int64_t n_columns, const int32_t half_widths[n_widths], bool all_or_nothing, int64_t hurry,
    int32_t places[n_charts][4], int32_t tops[n_charts], int64_t work[1]);

/* bump_maps.c */
void measure_pixel_steps(
    int64_t n_positions, int64_t n_faces, int64_t n, const double positions[n_positions][3],
    const int32_t faces[n_faces][3], const int32_t of_fragments[n], const float changes[n][4],
    double out[n][2]);
void tilt_normals(
    int64_t n_positions, int64_t n_faces, int64_t n_normals, int64_t n,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_faces[n_faces][3],
    const double steps[n_faces][4], const double to_object[3][3], const int32_t of_fragments[n],
    const double weights[n][2], const float shading[n][3], const bool back_facing[n],
    const double to_world[3][3], const double heights[n], const double slopes[n][2],
    const double back[3], float out[n][3]);
void find_light_steps(
    int64_t n_positions, int64_t n_faces, int64_t n_normals, int64_t n, int64_t n_directions,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_faces[n_faces][3],
    const double surface_steps[n_faces][4], const double to_object[3][3],
    const int32_t of_fragments[n], const double weights[n][2], const float shading[n][3],
    const bool back_facing[n], const float directions[n_directions][3],
    const double directions_to_object[3][3], const double steps[n][2], double shifts[n][2],
    double lengths[n]);
void bend_embossed(
    int64_t n_positions, int64_t n_faces, int64_t n_normals, int64_t n, int64_t n_directions,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_faces[n_faces][3],
    const double surface_steps[n_faces][4], const double to_object[3][3],
    const int32_t of_fragments[n], const double weights[n][2], const float shading[n][3],
    const bool back_facing[n], const float directions[n_directions][3],
    const double directions_to_object[3][3], const double to_world[3][3],
    const double slopes[n][2], bool in_object, bool normalized, double lifts[n]);
void add_embossed(
    int64_t n, int64_t n_directions, int64_t n_radiance, int64_t n_base, int64_t n_metalness,
    const float normals[n][3], const float directions[n_directions][3],
    const float radiance[n_radiance][3], const float base[n_base][3],
    const float metalness[n_metalness][1], const double lifts[n], float out[n][3]);

/* catmull_rom.c */
void sample_bicubic(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t sizes[n_levels][2],
    const double uvs[n][2], int64_t wraps, const float border[n_channels],
    float out[n][n_channels], int64_t start, int64_t stop);

/* cell_differences.c */
int64_t judge_four_samples(
    int64_t n_texels, int64_t n_room, int64_t n_channels, int64_t n_maps, int64_t n,
    int64_t height, int64_t width, const uint8_t counts[n_texels], const int64_t masks[n_texels],
    const int32_t charts[n_room], const float values[n_room][n_channels],
    const int32_t children[n_room], const int32_t firsts[n_maps + 1], const double scales[n_maps],
    const float steps[n_texels], const int32_t parents[n], float means[n_texels][n_channels],
    float errors[n]);
void judge_cells(
    int64_t n, int64_t n_room, int64_t n_channels, int64_t n_maps, int64_t level, int64_t height,
    int64_t width, int64_t first, const int32_t texels[n], const uint8_t spots[n],
    const uint8_t weights[n], const int32_t children[n_room], const int32_t charts[n_room],
    const float values[n_room][n_channels], const int32_t firsts[n_maps + 1],
    const double scales[n_maps], float errors[n]);
void choose_divided(
    int64_t n, int64_t n_texels, bool may_divide, const int32_t texels[n],
    const uint8_t weights[n], const float errors[n], const uint8_t counts[n_texels],
    float texel_errors[n_texels], bool divided[n]);

/* chart_bitmaps.c */
void mark_faces(
    int64_t n_faces, int64_t n_charts, int64_t n_poses, int64_t n_cells,
    const double corners[n_faces][3][n_poses][2], const int32_t face_charts[n_faces],
    double scale, const double shifts[n_charts][n_poses][2], double margin,
    const int64_t boxes[n_charts][n_poses][2], const int64_t starts[n_charts][n_poses],
    uint8_t masks[n_cells]);
int64_t list_spans(
    int64_t n_cells, int64_t n_charts, int64_t n_poses, int64_t most,
    const uint8_t masks[n_cells], const int64_t mask_starts[n_charts][n_poses],
    const int64_t mask_boxes[n_charts][n_poses][2], int64_t turns, int32_t spans[most][3],
    int64_t starts[n_charts][n_poses * turns][2]);
int64_t list_reach(
    int64_t n_spans, int64_t n_charts, int64_t n_orientations, int64_t n_widths, int64_t most,
    const int32_t spans[n_spans][3], const int64_t starts[n_charts][n_orientations][2],
    const int32_t boxes[n_charts][n_orientations][2], const int32_t half_widths[n_widths],
    int32_t reach[most][3], int64_t reach_starts[n_charts][n_orientations][2]);
void find_least_boxes(
    int64_t n_points, int64_t n_charts, int64_t n_angles, const double uvs[n_points][2],
    const int64_t starts[n_charts + 1], const double cosines[n_angles],
    const double sines[n_angles], int64_t best[n_charts]);

/* chart_cutting.c */
int64_t cut_charts(
    int64_t n, int64_t n_faces, int64_t n_corners, const double points[n][3],
    const int32_t corners[n_faces][3], const int32_t opposite[3 * n_faces],
    const double lengths[n_faces][3], double most_l2, double most_length, double most_area,
    double total_area, double depth, int32_t labels[n_faces], int32_t faces[n_faces][3], double uvs[n_corners][2],
    int64_t n_vertices[1]);

/* clipping.c */
void project_vertices(
    int64_t n, const double positions[n][3], const double matrix[4][4], int64_t width,
    int64_t height, int32_t grid[n][2], float depths[n], int64_t start, int64_t stop);

/* color_ramp.c */
void sample_ramp(
    int64_t n_stops, int64_t n_channels, int64_t n,
    const float stops[n_stops][n_channels], const float values[n], int64_t wrap,
    const float border[n_channels], float out[n][n_channels], int64_t start, int64_t stop);

/* compositing.c */
void mark_seen_objects(
    int64_t height, int64_t width, int64_t n_objects, const int32_t face_ids[height][width],
    const int64_t starts[n_objects + 1], bool seen[n_objects], int64_t start, int64_t stop);
void keep_finite(int64_t n, float light[n][3], double brightest);
void put_layer_behind(
    int64_t height, int64_t width, int64_t n, const int32_t of_samples[height][width],
    const float colors[n][3], const float opacity[n], OPTIONAL const float directions[n][3],
    float light[height][width][3], float passed[height][width],
    OPTIONAL float normals[height][width][3], bool seen[height][width]);
void sum_samples(
    int64_t sample_rows, int64_t sample_columns, int64_t height, int64_t width,
    const float light[sample_rows][sample_columns][3],
    const float passed[sample_rows][sample_columns],
    OPTIONAL const float normals[sample_rows][sample_columns][3],
    const bool seen[sample_rows][sample_columns], int64_t first_row, int64_t side,
    float color[height][width][4], float coverage[height][width],
    OPTIONAL float normal_sums[height][width][3]);
void find_nearest(
    int64_t sample_rows, int64_t sample_columns, int64_t height, int64_t width,
    const int32_t face_ids[sample_rows][sample_columns],
    const float depths[sample_rows][sample_columns], int64_t side, double near,
    int32_t ids_out[height][width], float depths_out[height][width]);
void add_fragments(
    int64_t n, int64_t n_pixels, const int32_t pixels[n], const float counts[n],
    const float light[n][3], OPTIONAL const float normals[n][3], float color[n_pixels][4],
    float coverage[n_pixels], OPTIONAL float normal_sums[n_pixels][3]);
void finish_pixels(
    int64_t height, int64_t width, int64_t rows_behind, int64_t columns_behind,
    float color[height][width][4], float coverage[height][width],
    OPTIONAL float normals[height][width][3], double n_samples,
    const float behind[rows_behind][columns_behind][3], bool opaque, int64_t start, int64_t stop);

/* conjugate_gradient.c */
int64_t solve_blocks(
    int64_t n, int64_t n_entries,
    const int64_t row_starts[n + 1], const int32_t columns[n_entries],
    const double blocks[n_entries][4], const double target[n][2], const double uvs[n][2],
    const int32_t regions[n], double solution[n][2], double tolerance, int64_t n_iterations);

/* coordinate_descent.c */
double fit_cage(
    int64_t n_vertices, int64_t n_faces, int64_t n_points, int64_t n_corners,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const double normals[n_vertices][3], const double points[n_points][3],
    const int64_t first_points[n_faces + 1], const int64_t order[n_corners],
    const int64_t first_corners[n_vertices + 1], const double floors[n_vertices],
    const double ceilings[n_vertices], int64_t n_sweeps, double distances[n_vertices]);

/* cube_levels.c */
int64_t shrink_cube_rows(
    int64_t size, int64_t small, int64_t n_channels,
    const float faces[6][size][size][n_channels], const double weights[size][size],
    float out[6][small][small][n_channels], int64_t start, int64_t stop);

/* cube_lighting.c */
int64_t average_hemispheres(
    int64_t n_directions, int64_t n_channels, int64_t n,
    const float directions[n_directions][3], const double angles[n_directions],
    const float radiance[n_directions][n_channels], const float normals[n][3],
    float out[n][n_channels], int64_t start, int64_t stop);

int64_t average_lobes(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n_samples, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels], const double lobe[n_samples][5], const float normals[n][3],
    float out[n][n_channels], int64_t start, int64_t stop);

/* cube_lookup.c */
void sample_cube(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels], const float directions[n][3], OPTIONAL const float levels[n],
    int64_t filter, float out[n][n_channels], int64_t start, int64_t stop);

/* decimals.c */
void read_numbers(
    int64_t n, int64_t n_values, int64_t n_lines, int64_t n_hard,
    const uint8_t text[n], int64_t start, int64_t stop, int64_t lead, bool fill,
    const uint64_t fives[256][2], double values[n_values], int64_t lines[n_lines],
    int64_t hard[n_hard][2], int64_t tally[3]);

/* displacement.c */
void take_middles(
    int64_t n_values, int64_t n, const double values[n_values][3], const int32_t ends[n][2],
    double out[restrict n][3]);
int64_t move_vertices(
    int64_t n_places, int64_t n_channels, int64_t n, const int32_t vertices[n_places],
    const double values[n_places][n_channels], const double points[n][3],
    const double normals[n][3], const double linear[3][3], double out[n][3]);
void measure_texel_lengths(
    int64_t n, int64_t n_base, int64_t n_points, int64_t n_edges, const int32_t faces[n][3],
    const int32_t face_edges[n][3], const int32_t base_faces[n], const float weights[n][3][2],
    OPTIONAL const double corners[n_base][3][2], const uint8_t outside[n_points],
    double lengths[n_edges]);
void view_vertices(
    int64_t n, const double points[n][3], const double positions[n][3], const double eye[3],
    const double back[3], double near, double steepest, const double sides[5][4],
    const double margins[5], uint8_t outside[n], double nearest[n], double slants[n],
    int64_t start, int64_t stop);
void measure_excess(
    int64_t n, int64_t n_points, const int32_t ends[n][2], const double points[n_points][3],
    const double positions[n_points][3], const double nearest[n_points],
    const double slants[n_points], const double texels[n], double scale, double out[n],
    int64_t start, int64_t stop);

/* distance_transform.c */
int64_t search_columns(
    int64_t height, int64_t width, const int32_t charts[height][width], int64_t reach,
    int16_t nearest[height][width], int16_t other[height][width], int32_t owners[height][width],
    int64_t start, int64_t stop);

int64_t search_rows(
    int64_t height, int64_t width, const int32_t charts[height][width], int64_t reach,
    const int16_t nearest[height][width], const int16_t other[height][width],
    int32_t indices[height][width], int64_t meeting[height], int64_t start, int64_t stop);

void spread_owners(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const int32_t owners[n],
    const float background[n_channels], float out[n][n_channels], int64_t start, int64_t stop);

void copy_texels(
    int64_t n_texels, int64_t n_channels, int64_t n, float values[n_texels][n_channels],
    const int64_t targets[n], const int32_t sources[n], const float neutral[n_channels],
    int64_t start, int64_t stop);

/* ear_clipping.c */
int64_t triangulate_polygons(
    int64_t n_vertices, int64_t n_corners, int64_t n_polygons, int64_t n_triangles,
    const double positions[n_vertices][3], const int32_t vertices[n_corners],
    const int64_t first_corners[n_polygons], const int64_t sizes[n_polygons],
    const int64_t first_triangles[n_polygons], int64_t triangles[n_triangles][3],
    bool is_crossed[n_polygons], int64_t first, int64_t stop);

/* edge_functions.c */
void bin_faces(
    int64_t n_faces, int64_t n_listed, const int64_t corners[n_faces][3][2], int64_t n_rows,
    int64_t n_columns, int64_t firsts[n_rows * n_columns + 1], OPTIONAL int32_t faces[n_listed]);
void write_masks(
    int64_t n_faces, int64_t n_bins, int64_t n_listed, int64_t n, int64_t n_texels,
    const int64_t corners[n_faces][3][2], const int64_t firsts[n_bins + 1],
    const int32_t faces[n_listed], int64_t n_columns, int64_t first_row, int64_t width,
    const int64_t texels[n], const int32_t owners[n_texels], uint8_t counts[n_texels],
    int64_t masks[n_texels]);
void mark_lines(
    int64_t n, int64_t height, int64_t width, const int64_t edges[n][2][2],
    bool marked[height][width]);
void find_owners(
    int64_t n_faces, int64_t n_bins, int64_t n_listed, int64_t n,
    const int64_t corners[n_faces][3][2], const int64_t firsts[n_bins + 1],
    const int32_t faces[n_listed], int64_t n_columns, const int64_t points[n][2],
    int32_t owners[n], double weights[n][2]);

/* elementary.c */
void array_sin(int64_t n, const double x[n], double out[n]);
void array_cos(int64_t n, const double x[n], double out[n]);
void array_tan(int64_t n, const double x[n], double out[n]);
void array_asin(int64_t n, const double x[n], double out[n]);
void array_acos(int64_t n, const double x[n], double out[n]);
void array_atan(int64_t n, const double x[n], double out[n]);
void array_exp(int64_t n, const double x[n], double out[n]);
void array_log(int64_t n, const double x[n], double out[n]);
void array_log2(int64_t n, const double x[n], double out[n]);
void array_log10(int64_t n, const double x[n], double out[n]);
void array_atan2(int64_t n, const double x[n], const double y[n], double out[n]);
void array_hypot(int64_t n, const double x[n], const double y[n], double out[n]);
void array_power(int64_t n, const double x[n], const double y[n], double out[n]);
void array_float_power(int64_t n, const float x[n], const float y[n], float out[n]);

/* elliptical_weighted_average.c */
int64_t sample_ellipses(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n, int64_t n_weights,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels][2], const double uvs[n][2], const float derivatives[n][4],
    double max_anisotropy, int64_t wraps, const float border[n_channels],
    const float weights[n_weights], double pixel_radius_squared, float out[n][n_channels],
    int64_t start, int64_t stop);

/* exposure.c */
void count_bright(
    int64_t height, int64_t width, const float color[height][width][4],
    const float coverage[height][width], int64_t counts[height][2], int64_t start, int64_t stop);
void expose_pixels(
    int64_t height, int64_t width, float color[height][width][4],
    const float coverage[height][width], OPTIONAL const float behind[3], double exposure,
    int64_t start, int64_t stop);

/* face_components.c */
int64_t number_components(
    int64_t n_vertices, int64_t n_faces, const int32_t faces[n_faces][3],
    int32_t components[n_faces]);

/* face_crossings.c */
void find_crossings(
    int64_t n_vertices, int64_t n_faces, int64_t n_kept, int64_t n_nodes,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t order[n_kept], const float boxes[n_nodes][6],
    const int32_t nodes[n_nodes][2], const double normals[n_faces][3], double depth, int64_t most,
    int64_t start, int64_t stop, int32_t others[n_faces], bool unsure[n_faces]);

/* face_parts.c */
int64_t divide_into_parts(
    int64_t n_faces, const int32_t neighbors[n_faces][3], const double lengths[n_faces][3],
    const int32_t within[n_faces], int64_t part_faces, int32_t labels[n_faces]);

int64_t find_step_lengths(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    const int32_t neighbors[n_faces][3], int64_t n_rounds, double lengths[n_faces][3]);

/* flatten.c */
int64_t flatten_patch(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    bool has_start, int64_t n_iterations, double accuracy, bool keep_apart, double uvs[n][2],
    double figures[3]);

int64_t measure_layout(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    double uvs[n][2], double figures[3]);


/* folded_faces.c */
void find_folded(
    int64_t n_vertices, int64_t n_faces, const double before[n_vertices][3],
    const double after[n_vertices][3], const int32_t faces[n_faces][3], bool folded[n_faces],
    int64_t start, int64_t stop);
void split_quads(
    int64_t n_vertices, int64_t n_quads, const double before[n_vertices][3],
    const double after[n_vertices][3], const int32_t quads[n_quads][4],
    int32_t faces[n_quads][2][3], int64_t start, int64_t stop);

/* fourier.c */
int64_t fourier_transform_rows(
    int64_t n, int64_t length, double real[n][length], double imaginary[n][length], bool inverse,
    int64_t start, int64_t stop);

/* gradient_noise.c */
void fill_noise(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double gradients[256][3], float out[n][1], bool quintic, double bound, int64_t start,
    int64_t stop);

void fill_octave_sums(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double gradients[256][3], double sums[n], bool quintic, int64_t n_octaves,
    double lacunarity, double gain, double mean, int64_t start, int64_t stop);

void fill_octave_values(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double gradients[256][3], float out[n][1], bool quintic, int64_t n_octaves,
    double lacunarity, double gain, double mean, double offset, double scale, int64_t start,
    int64_t stop);

/* grid_dilation.c */
int64_t measure_planes(
    int64_t nx, int64_t ny, int64_t nz, const uint8_t labels[nx][ny][nz],
    uint16_t squares[nx][ny][nz], int64_t label, int64_t radius, int64_t start, int64_t stop);
void reach_planes(
    int64_t nx, int64_t ny, int64_t nz, const uint16_t squares[nx][ny][nz],
    bool reached[nx][ny][nz], int64_t radius, int64_t radius_squared, int64_t start, int64_t stop);

/* grid_flood.c */
int64_t flood_room(
    int64_t nx, int64_t ny, int64_t nz, const bool blocked[nx][ny][nz], uint8_t labels[nx][ny][nz],
    int64_t start, int64_t label);
int64_t next_room(
    int64_t nx, int64_t ny, int64_t nz, const bool blocked[nx][ny][nz],
    const uint8_t labels[nx][ny][nz], int64_t start);

/* guided_local_search.c */
int64_t separate_charts(
    int64_t n_charts, int64_t n_orientations, int64_t n_spans, int64_t n_reach,
    const int32_t boxes[n_charts][n_orientations][2], const int32_t spans[n_spans][3],
    const int64_t starts[n_charts][n_orientations][2], const int32_t reach[n_reach][3],
    const int64_t reach_starts[n_charts][n_orientations][2], int64_t margin,
    int32_t places[n_charts][3], const int32_t base[n_charts][n_charts],
    int32_t weights[n_charts][n_charts], int64_t n_rows, int64_t n_columns, int64_t n_samples,
    int64_t radius, int64_t step, int64_t patience, int64_t most_work, int64_t seed,
    int32_t best_places[n_charts][3], int64_t work[1]);

/* interpolation.c */
void move_to_base(
    int64_t n, int64_t n_changes, int64_t n_pieces, const int32_t faces[n],
    const double weights[n][2], const float changes[n_changes][4],
    const float corners[n_pieces][3][2], double weights_out[n][2], float changes_out[n_changes][4]);
void interpolate_positions(
    int64_t n_points, int64_t n_faces, int64_t n, const double points[n_points][3],
    const int32_t corners[n_faces][3], const int32_t faces[n], const double weights[n][2],
    double out[restrict n][3]);
void find_view_directions(
    int64_t n, const float places[n][2], const double rays[3][3], float out[restrict n][3]);
void interpolate_uvs(
    int64_t n_uvs, int64_t n_faces, int64_t n, int64_t n_changes, int64_t n_out,
    const double uvs[n_uvs][2], const int32_t corners[n_faces][3], const int32_t faces[n],
    const double weights[n][2], const float changes[n_changes][4], double out[n][2],
    float changes_out[n_out][4]);
void find_scaled_points(
    int64_t n_positions, int64_t n_faces, int64_t n, int64_t n_changes, int64_t n_widths,
    const double positions[n_positions][3], const int32_t corners[n_faces][3],
    const double matrix[3][4], const int32_t faces[n], const double weights[n][2],
    const float changes[n_changes][4], double out[n][3], float widths[n_widths][3]);

/* lamps.c */
void find_arriving_light(
    int64_t n, const double points[n][3], const float normals[n][3], const double position[3],
    const double axis[3], double inner, double outer, double decay, const float color[1][3],
    float directions[n][3], float radiance[n][3]);
void reflect_lambert(
    int64_t n, int64_t n_directions, int64_t n_radiance, int64_t n_base, const float normals[n][3],
    const float directions[n_directions][3], const float radiance[n_radiance][3],
    const float base[n_base][3], float out[n][3]);
void reflect_blinn_phong(
    int64_t n, int64_t n_directions, int64_t n_radiance, int64_t n_base, int64_t n_specular,
    int64_t n_exponent, int64_t n_gloss, const float normals[n][3],
    const float directions[n_directions][3], const float radiance[n_radiance][3],
    const float to_eye[n][3], const float base[n_base][3], const float specular[n_specular][3],
    const float exponent[n_exponent][1], const float gloss[n_gloss][1], float out[n][3]);
void reflect_metallic(
    int64_t n, int64_t n_directions, int64_t n_radiance, int64_t n_base, int64_t n_roughness,
    int64_t n_metalness, const float normals[n][3], const float directions[n_directions][3],
    const float radiance[n_radiance][3], const float to_eye[n][3], const float base[n_base][3],
    const float roughness[n_roughness][1], const float metalness[n_metalness][1],
    double dielectric, double least_alpha, float out[n][3]);

/* latitude_longitude.c */
int64_t convert_to_cube(
    int64_t height, int64_t width, int64_t n_channels, int64_t size,
    const float image[height][width][n_channels], int64_t n_lookups,
    float out[6][size][size][n_channels], int64_t start, int64_t stop);

int64_t convert_from_cube(
    int64_t n_texels, int64_t n_channels, int64_t height, int64_t width,
    const float texels[n_texels][n_channels], int64_t size, int64_t n_lookups,
    float out[height][width][n_channels], int64_t start, int64_t stop);

/* line_walks.c */
int64_t find_walks(
    int64_t n_places, int64_t n_slots, int64_t n_lines, int64_t n_walked,
    const int64_t starts[n_places], int64_t nexts[n_places], const int64_t stops[n_places],
    const int64_t leads_to[n_slots], const int64_t line_of[n_slots], bool used[n_lines],
    int64_t walks[n_walked], int64_t ends[n_lines]);
int64_t write_walks(
    int64_t n_points, int64_t n_walks, int64_t n_bytes, const int64_t points[n_points][2],
    const int64_t ends[n_walks], bool closed, OPTIONAL uint8_t text[n_bytes],
    int64_t text_ends[n_walks]);

/* mean_curvature.c */
void add_curvatures(
    int64_t n_vertices, int64_t n_faces, const double points[n_vertices][3],
    const int32_t faces[n_faces][3], const int32_t firsts[n_vertices],
    const double normals[n_vertices][3], double turns[n_vertices], double areas[n_vertices]);

/* median_split.c */
void sort_into_nodes(
    int64_t n, float middles[n][3], uint64_t places[n], int64_t unit, int64_t least);
void find_middles(
    int64_t n, int64_t n_vertices, int64_t n_faces, const uint64_t places[n],
    const double positions[n_vertices][3], const int32_t faces[n_faces][3], const double center[3],
    double scale, float middles[n][3]);

/* mikktspace_fans.c */
void pair_edges(
    int64_t n, const int64_t keys[n], const int64_t edges[n], const int32_t starts[n],
    int32_t neighbors[n]);
int64_t number_fans(
    int64_t n_faces, int64_t n_corners, const int32_t vertices[n_faces][3],
    const int32_t neighbors[n_faces][3], const bool unmapped[n_faces], bool preserving[n_faces],
    int32_t fans[n_faces][3], bool fan_preserving[n_corners]);

/* mip_levels.c */
int64_t fill_mip_level(
    int64_t n_rows, int64_t n_values, int64_t height, int64_t width, int64_t n_channels,
    int64_t n_row_taps, int64_t n_column_taps, const float values[n_rows][n_values],
    const int64_t rows[height][n_row_taps], const float row_weights[height][n_row_taps],
    const int64_t columns[width][n_column_taps], const float column_weights[width][n_column_taps],
    float out[height][width][n_channels], int64_t start, int64_t stop);

/* mip_lookup.c */
void find_mip_levels(
    int64_t n, const float derivatives[n][4], float width, float height, float out[n],
    int64_t start, int64_t stop);

void sample_trilinear(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels][2], const double uvs[n][2],
    OPTIONAL const float derivatives[n][4], int64_t wraps, const float border[n_channels],
    float out[n][n_channels], int64_t start, int64_t stop);

/* morton_tree.c */
void place_on_curve(
    int64_t n, int64_t n_vertices, const double positions[n_vertices][3], const int32_t faces[n][3],
    int64_t first, const double box[3], double cells_per_unit, uint64_t places[n]);
void count_digits(int64_t n, const uint64_t places[n], int64_t shift, int64_t counts[1024]);
void move_by_digits(
    int64_t n, int64_t n_all, const uint64_t places[n], int64_t shift, int64_t next[1024],
    uint64_t sorted[n_all]);
void fill_leaves(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_leaves, int64_t n_nodes,
    const uint64_t places[n], const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const double center[3], double scale,
    double leaves[n_leaves][9][8], int32_t ids[n_leaves][8], float nodes[n_nodes][6][8]);
void join_boxes(
    int64_t n_children, int64_t n_nodes, const float children[n_children][6][8],
    float nodes[n_nodes][6][8]);

/* multisampling.c */
int64_t count_fragments(
    int64_t height, int64_t width, int64_t n_objects, const int32_t face_ids[height][width],
    const int64_t starts[n_objects + 1], int64_t side, bool merges, int64_t first_row,
    int64_t stop_row, int64_t counts[n_objects]);

int64_t list_fragments(
    int64_t height, int64_t width, int64_t n_objects, int64_t n, int64_t n_rows,
    const int32_t face_ids[height][width], const int64_t starts[n_objects + 1], int64_t side,
    bool merges, int64_t first_row, int64_t stop_row, int64_t left, int64_t top, int64_t fine,
    int64_t nexts[n_objects], int32_t faces[n], float places[n][2], int32_t pixels[n],
    float counts[n],
    OPTIONAL int32_t of_samples[n_rows][width]);

/* narrow_band.c */
void mark_band_blocks(
    int64_t n_vertices, int64_t n_faces, int64_t n_listed, int64_t nx, int64_t ny, int64_t nz,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t listed[n_listed], const int64_t starts[nx + 1], bool active[nx][ny][nz],
    double width, int64_t start, int64_t stop);
void measure_band(
    int64_t n_vertices, int64_t n_faces, int64_t n_listed, int64_t nx, int64_t ny, int64_t nz,
    int64_t n_slots, const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t listed[n_listed], const int64_t starts[nx + 1],
    const int32_t slots[nx][ny][nz], float distances[n_slots][512], double width, int64_t start,
    int64_t stop);
void label_shell(
    int64_t nx, int64_t ny, int64_t nz, int64_t n_slots, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const float distances[n_slots][512],
    uint8_t labels[width][height][depth], double greatest, int64_t start, int64_t stop);

/* newton.c */
void find_faces_under(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_half_edges,
    const double targets[n][3], const double distances[n], const int32_t closest[n],
    const double weights[n][3], const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const double normals[n_vertices][3],
    const int32_t opposite[n_half_edges], int32_t owners[n], double heights[n], bool exact[n]);

/* normal_cones.c */
int64_t grow_charts(
    int64_t n_faces, const int32_t neighbors[n_faces][3], const double normals[n_faces][3],
    int32_t charts[n_faces], double axes[n_faces][3]);

/* obj_rows.c */
void find_statements(
    int64_t n, int64_t n_offsets, const uint8_t bytes[n], bool fill, int64_t nexts[5],
    int64_t offsets[n_offsets]);
void read_rows(
    int64_t n, int64_t n_rows, int64_t n_columns, const uint8_t bytes[n],
    const int64_t starts[n_rows], int64_t start, int64_t stop, const uint64_t fives[256][2],
    double values[n_rows][n_columns], int32_t n_words[n_rows]);
void read_corners(
    int64_t n, int64_t n_rows, int64_t n_v, int64_t n_vt, int64_t n_vn, int64_t n_corners,
    const uint8_t bytes[n], const int64_t starts[n_rows], int64_t start, int64_t stop,
    const int64_t ends[n_rows], const int64_t v[n_v], const int64_t vt[n_vt], const int64_t vn[n_vn],
    int32_t corners[3][n_corners]);

/* hashed_edges.c */
int64_t count_open_vertices(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, const int32_t vertex_of[n_wedges],
    const int32_t faces[n_faces][3]);
void hash_positions(
    int64_t n_vertices, const double positions[n_vertices][3], uint64_t keys[n_vertices],
    int64_t start, int64_t stop);
void sum_sides(
    int64_t n_vertices, int64_t n_faces, int64_t n_bands, const double positions[n_vertices][3],
    const uint64_t keys[n_vertices], const int32_t faces[n_faces][3], const double origin[3],
    int64_t band, uint64_t edges[n_bands], double volumes[n_bands], int64_t start, int64_t stop);

/* orange_pores.c */
void pore_depths(
    int64_t n, int64_t n_pores, int64_t n_starts, int64_t n_entries,
    const double directions[n][3], const double centers[n_pores][3], const double radii[n_pores],
    const double depths_of_pores[n_pores], int64_t n_cells, const int64_t cell_starts[n_starts],
    const int64_t cell_pores[n_entries], double depths[n]);

/* order_search.c */
int64_t search_orders(
    int64_t n_spans, int64_t n_charts, int64_t n_orientations,
    const int32_t boxes[n_charts][n_orientations][2], const int32_t spans[n_spans][3],
    const int64_t starts[n_charts][n_orientations][2], const double shares[n_charts],
    int64_t n_rows, int64_t n_columns, int64_t height, int64_t most_work, int64_t seed,
    int32_t order[n_charts], int32_t places[n_charts][3], int64_t work[1]);

/* orientation.c */
void join_orientations(
    int64_t n, int64_t n_pairs, int64_t parents[n], bool flips[n], const int64_t one[n_pairs],
    const int64_t other[n_pairs], const bool along[n_pairs]);

/* parallax.c */
void follow_rays(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n,
    const float texels[n_texels][n_channels], const int64_t offsets[n_levels],
    const int64_t sizes[n_levels][2], int64_t wraps, float border, float factor,
    const double starts[n][2], const double steps[n][2], const int64_t levels[n], int64_t layers,
    double shares[n]);

/* pcg64.c */
void draw_uniform(int64_t n, uint64_t seed, double values[n]);

/* perspective_weights.c */
void weigh_fragments(
    int64_t n, int64_t n_vertices, int64_t n_faces, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const double matrix[4][4], double width, double height,
    bool affine, const int32_t face_ids[n], const float places[n][2], double weights[n][2],
    bool back_facing[n], OPTIONAL float changes[n][4]);

/* photo_weights.c */
void weigh_by_camera(
    int64_t n, int64_t n_faces, const int32_t faces[n], const double positions[n][3],
    const double normals[n][3], const double matrix[3][4], const double seen_from[4],
    const double face_normals[n_faces][3], const double steps[n_faces][3][2], double least_cosine,
    double falloff, double feather, double coordinates[n][2], float derivatives[n][4],
    double weights[n]);

void weigh_by_area(
    int64_t n, int64_t n_faces, const int32_t faces[n], const double barycentrics[n][2],
    const double corners[n_faces][3][2], const double facing[n_faces][3], double falloff,
    double feather, double coordinates[n][2], double weights[n]);

/* piecewise_simplification.c */
int64_t mark_shared_vertices(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, const int32_t vertex_of[n_wedges],
    const int32_t faces[n_faces][3], int64_t piece, bool is_shared[n_vertices]);
int64_t log_collapses(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, const int32_t vertex_of[n_wedges],
    const double points[n_vertices][3], const int32_t faces[n_faces][3],
    const bool is_shared[n_vertices], int64_t start, int64_t stop, int64_t n_wanted,
    bool lock_boundary, int32_t gone[n_faces], int32_t kept[n_faces], float errors[n_faces],
    uint8_t n_gone_faces[n_faces]);
int64_t apply_collapses(
    int64_t n_wedges, int64_t n_faces, int64_t n_rows, const int32_t vertex_of[n_wedges],
    const int32_t gone[n_rows], const int32_t kept[n_rows], const float errors[n_rows], float limit,
    int32_t faces[n_faces][3]);

/* pinched_vertices.c */
int64_t has_pinched_vertex(int64_t n_vertices, int64_t n_faces, const int32_t faces[n_faces][3]);

/* pineda.c */
void rasterize_uvs(
    int64_t n_faces, int64_t n_rows, int64_t n_columns, const int64_t corners[n_faces][3][2],
    const int32_t first_rows[n_faces], const int32_t last_rows[n_faces], int64_t start,
    int64_t stop, int32_t owners[n_rows][n_columns], bool overlapped[n_rows][n_columns]);

void list_tiles(
    int64_t n_lines, int64_t n_columns, int64_t n_faces, int64_t n,
    const int32_t owners[n_lines][n_columns], const int64_t corners[n_faces][3][2],
    int64_t side, int64_t first_line, int64_t first_row, int64_t per_side, int64_t at,
    int32_t texel_ids[n], int32_t faces[n], double barycentrics[n][2]);

/* planar_overlap.c */
int64_t pack_boxes(
    int64_t n_faces, int64_t most, const double corners[n_faces][3][2],
    OPTIONAL const int32_t charts[n_faces], double depth, double lines[n_faces][3][3],
    int64_t order[n_faces], double boxes[most][6], int64_t children[most][2], int64_t counts[2]);

int64_t find_planar_overlaps(
    int64_t n_faces, int64_t n_solid, int64_t n_boxes, int64_t n_places,
    const double corners[n_faces][3][2], const double lines[n_faces][3][3],
    const int64_t order[n_solid], const double boxes[n_boxes][6],
    const int64_t children[n_boxes][2], double depth, int64_t most,
    const int64_t places[n_places], bool found[n_faces], bool unsure[n_faces],
    OPTIONAL int32_t layers[n_faces]);

/* ply_rows.c */
int64_t walk_binary_rows(
    int64_t n, int64_t n_columns, int64_t n_rows, const uint8_t bytes[n], int64_t start,
    const int64_t layout[n_columns][3], bool big_endian, int64_t offsets[n_columns][n_rows],
    int64_t sizes[n_columns][n_rows], int64_t end[1]);
int64_t walk_text_rows(
    int64_t n, int64_t n_columns, int64_t n_rows, const double numbers[n], int64_t start,
    const int64_t layout[n_columns][3], int64_t offsets[n_columns][n_rows],
    int64_t sizes[n_columns][n_rows], int64_t end[1]);
bool read_triangle_rows(
    int64_t n_bytes, int64_t n, const uint8_t rows[n_bytes], int64_t row_size, int64_t skipped,
    int64_t count_size, bool big_endian, int64_t n_vertices, int32_t faces[n][3]);
void gather_pieces(
    int64_t n, int64_t n_pieces, int64_t n_gathered, const uint8_t bytes[n], int64_t unit_size,
    const int64_t offsets[n_pieces], const int64_t lengths[n_pieces], uint8_t gathered[n_gathered]);

/* processor.c */
bool has_x86_64_v3(void);

/* png_rows.c */
int64_t bound_png_rows(int64_t n_rows, int64_t row_bytes);
int64_t compress_png_rows(
    int64_t height, int64_t row_bytes, int64_t capacity, const uint8_t pixels[height][row_bytes],
    uint8_t out[capacity], uint32_t checksum[2], int64_t sample_bytes, int64_t texel_bytes,
    int64_t start, int64_t stop, bool is_last);

/* projected_pictures.c */
void find_pixel_steps(
    int64_t n, int64_t n_corners, int64_t n_faces, const double points[n][3],
    const double corners[n_corners][3], const int32_t faces[n_faces][3],
    const int32_t drawn_faces[n], const float places[n][2], const double rays[3][3],
    const double eye[3], double out[n][2][3]);
void project_points(
    int64_t n, int64_t n_steps, const double points[n][3], const double steps[n_steps][2][3],
    const double matrix[4][4], double places[n][2], float changes[n][4], float coverage[n]);

/* pulse_train.c */
void fill_checker(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], float out[n][1], int64_t n_dimensions,
    int64_t start, int64_t stop);

void fill_stripes(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const double direction[3], float out[n][1],
    int64_t pattern, double width, int64_t start, int64_t stop);

/* push_pull.c */
int64_t push_texels(
    int64_t height, int64_t width, int64_t n_channels, int64_t coarse_height,
    int64_t coarse_width, const float values[height][width][n_channels],
    const bool mask[height][width], float coarse[coarse_height][coarse_width][n_channels],
    bool coarse_mask[coarse_height][coarse_width], int64_t start, int64_t stop);

void pull_texels(
    int64_t height, int64_t width, int64_t n_channels, int64_t coarse_height,
    int64_t coarse_width, float values[height][width][n_channels], const bool mask[height][width],
    const float coarse[coarse_height][coarse_width][n_channels], int64_t start, int64_t stop);

/* quadric_simplification.c */
int64_t collapse_edges(
    int64_t n_wedges, int64_t n_vertices, int64_t n_faces, int64_t n_uvs, int64_t n_normals,
    const int32_t vertex_of[n_wedges], double points[n_vertices][3], int32_t faces[n_faces][3],
    OPTIONAL const int32_t uv_rows[n_wedges], OPTIONAL double uvs[n_uvs][2],
    OPTIONAL const int32_t normal_rows[n_wedges], OPTIONAL double normals[n_normals][3],
    int64_t n_wanted, bool moves, bool lock_boundary);

/* quadtree.c */
void write_cell_samples(
    int64_t n_faces, int64_t n_bins, int64_t n_listed, int64_t n_texels, int64_t n,
    const int64_t corners[n_faces][3][2], const int64_t firsts[n_bins + 1],
    const int32_t faces[n_listed], int64_t n_columns, const uint8_t counts[n_texels],
    const int64_t masks[n_texels], int64_t level, int64_t width, const int32_t centers[n_texels],
    const int32_t texels[n], const uint8_t spots[n], int32_t owners[n], double weights[n][2]);
void write_children(
    int64_t n, int64_t n_texels, int64_t n_room, int64_t level, int64_t first,
    const int32_t places[n], const int32_t parent_texels[n], const uint8_t parent_spots[n],
    const uint8_t counts[n_texels], const int64_t masks[n_texels], int32_t children[n_room],
    int32_t texels[4 * n], uint8_t spots[4 * n], uint8_t weights[4 * n]);
void list_in_tiles(
    int64_t height, int64_t width, int64_t n, const bool chosen[height][width], int32_t ids[n]);
void keep_values(
    int64_t n, int64_t n_channels, int64_t n_room, int64_t n_kept, const int32_t places[n],
    const int32_t charts[n], const float values[n][n_channels], int64_t first_channel,
    int32_t kept_charts[n_room], float kept[n_room][n_kept]);
int64_t take_over_samples(
    int64_t n_level, int64_t n, int64_t n_room, int64_t n_channels,
    const int32_t origins[n_level], int64_t first, int32_t cells[n], bool is_cast[n_room],
    int32_t charts[n_room], float values[n_room][n_channels]);
void add_leaves(
    int64_t n, int64_t n_room, int64_t n_channels, int64_t n_texels, int64_t first,
    const int32_t texels[n], const uint8_t weights[n], const int32_t children[n_room],
    const int32_t charts[n_room], const float values[n_room][n_channels],
    float sums[n_texels][n_channels], float areas[n_texels]);

/* quantization.c */
void quantize_u8(
    int64_t n, int64_t n_channels, const float values[n][n_channels],
    const double factors[n_channels], const double offsets[n_channels],
    OPTIONAL const double lows[n_channels], OPTIONAL const double sizes[n_channels],
    uint8_t codes[n][n_channels], double noise, double top, int64_t start, int64_t stop);

void quantize_u16(
    int64_t n, int64_t n_channels, const float values[n][n_channels],
    const double factors[n_channels], const double offsets[n_channels],
    OPTIONAL const double lows[n_channels], OPTIONAL const double sizes[n_channels],
    uint16_t codes[n][n_channels], double noise, double top, int64_t start, int64_t stop);

void quantize_srgb_u8(
    int64_t n, int64_t n_channels, int64_t n_codes, const float values[n][n_channels],
    const float thresholds[n_codes], const uint16_t first_codes[16257],
    uint8_t codes[n][n_channels], int64_t n_colors, int64_t start, int64_t stop);

void quantize_srgb_u16(
    int64_t n, int64_t n_channels, int64_t n_codes, const float values[n][n_channels],
    const float thresholds[n_codes], const uint16_t first_codes[16257],
    uint16_t codes[n][n_channels], int64_t n_colors, int64_t start, int64_t stop);

void color_ids_u8(
    int64_t n, int64_t n_colors, const float ids[n], const uint8_t colors[n_colors][3],
    uint8_t codes[n][3], int64_t start, int64_t stop);

void color_ids_u16(
    int64_t n, int64_t n_colors, const float ids[n], const uint16_t colors[n_colors][3],
    uint16_t codes[n][3], int64_t start, int64_t stop);

/* hemisphere_rays.c */
void cast_hemispheres(
    int64_t n, int64_t n_directions, int64_t n_leaves, int64_t n_nodes, int64_t n_levels,
    const double points[n][3], const float axes[n][3], const float planes[n][3],
    const uint32_t set_ids[n], const float sets[n_directions][3], int64_t n_rays, double offset,
    double outer, double inner, const double leaves[n_leaves][9][8],
    const float nodes[n_nodes][6][8], const int64_t starts[n_levels], const double box[6],
    float results[n][5]);
void place_hemispheres(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const float barycentrics[n][2], const double positions[n_vertices][3],
    const int32_t corners[n_faces][3], const double center[3], double scale,
    const float normals[n_normals][3], const int32_t normal_corners[n_faces][3],
    double points[n][3], float axes[n][3], float planes[n][3]);

/* ray_occlusion.c */
void find_mostly_hidden(
    int64_t n_vertices, int64_t n_faces, int64_t n_kept, int64_t n_nodes, int64_t n_ids,
    int64_t n_samples,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t order[n_kept], const float boxes[n_nodes][6], const int32_t nodes[n_nodes][2],
    const int32_t face_ids[n_ids], const double samples[n_samples][3], const double eye[4],
    int64_t start, int64_t stop, bool hidden[n_ids]);

/* sample_rays.c */
void cast_from_samples(
    int64_t n, int64_t n_vertices, int64_t n_faces, int64_t n_normals, const int32_t faces[n],
    const double barycentrics[n][2], const double positions[n_vertices][3],
    OPTIONAL const double starts[n_vertices][3], const int32_t corners[n_faces][3],
    const double normals[n_normals][3], const int32_t normal_corners[n_faces][3],
    OPTIONAL const double reaches[n_faces][3][2], double front, double back, double origins[n][3],
    double directions[n][3], double lengths[n], double fronts[n]);
void reshape_rays(
    int64_t n, int64_t n_vertices, int64_t n_faces, const int32_t faces[n],
    const double barycentrics[n][2], const double positions[n_vertices][3],
    const int32_t corners[n_faces][3], const float skew[n], const float offset[n],
    const double straight[n][3], double back, double origins[n][3], double directions[n][3],
    double lengths[n], double fronts[n]);
void place_samples(
    int64_t n, int64_t n_faces, const int32_t faces[n], const double barycentrics[n][2],
    const double corner_uvs[n_faces][3][2], const int32_t charts[n_faces], int64_t n_columns,
    int64_t n_rows, int32_t places[n][2], int32_t place_charts[n]);
void offsets_of_hits(
    int64_t n, const double sample_barycentrics[n][2], const double directions[n][3],
    const double fronts[n], const int32_t faces[n], const double barycentrics[n][2],
    const double distances[n], double scale, float low_barycentrics[n][2],
    float high_barycentrics[n][2], float offsets[n][3]);

/* rigid_regions.c */
int64_t find_regions(int64_t n, const double uvs[n][2], int32_t regions[n]);

/* sample_statistics.c */
void add_fragments_squared(
    int64_t n, int64_t n_pixels, const int32_t pixels[n], const float counts[n],
    const float light[n][3], double sums[n_pixels][4], double squares[n_pixels][4],
    float covered[n_pixels]);
void add_samples_squared(
    int64_t sample_rows, int64_t sample_columns, int64_t rows_behind, int64_t columns_behind,
    int64_t height, int64_t width, const float light[sample_rows][sample_columns][3],
    const float passed[sample_rows][sample_columns],
    const bool seen[sample_rows][sample_columns],
    const float behind[rows_behind][columns_behind][3], int64_t first_row, int64_t side,
    double sums[height][width][4], double squares[height][width][4], float covered[height][width]);
void write_window(
    int64_t rows, int64_t columns, int64_t rows_behind, int64_t columns_behind, int64_t height,
    int64_t width, const bool mask[rows][columns], int64_t top, int64_t left, int64_t side,
    const float behind[rows_behind][columns_behind][3], bool is_opaque, bool shows_behind,
    const double light[rows][columns][4], const double squares[rows][columns][4],
    const float covered[rows][columns], double light_out[height][width][4],
    double squares_out[height][width][4], float covered_out[height][width]);
void drop_unwanted(
    int64_t sample_rows, int64_t sample_columns, int64_t rows, int64_t columns,
    int32_t face_ids[sample_rows][sample_columns], const bool mask[rows][columns], int64_t side);
void write_codes(
    int64_t height, int64_t width, const double light[height][width][4],
    const int32_t counts[height][width], float codes[height][width][4], int64_t start, int64_t stop);
void judge_shading(
    int64_t height, int64_t width, const float codes[height][width][4],
    const int32_t shaded[height][width], const float changes[height][width],
    float errors[height][width], int64_t start, int64_t stop);
void judge_edges(
    int64_t height, int64_t width, const double light[height][width][4],
    const double squares[height][width][4], const int32_t counts[height][width],
    float errors[height][width], int64_t start, int64_t stop);

/* scanline_coverage.c */
int64_t cover_faces(
    int64_t n_faces, int64_t n_rows, int64_t n_columns,
    const double corners[n_faces][3][2], const double colors[n_faces][3], double top,
    double half_edge, double edge_light, double sums[n_rows][n_columns][4]);

int64_t cover_lines(
    int64_t n_lines, int64_t n_rows, int64_t n_columns,
    const double ends[n_lines][2][2], double top, double radius,
    uint16_t masks[n_rows][n_columns]);

/* scanline_rasterizer.c */
void draw_scanlines(
    int64_t n_vertices, int64_t n_faces, int64_t n_objects, int64_t height, int64_t width,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int64_t starts[n_objects + 1], const uint8_t modes[n_objects],
    const double matrix[4][4], int32_t face_ids[height][width], float depths[height][width],
    double weights[height][width][2]);

/* second_differences.c */
void judge_samples(
    int64_t n_texels, int64_t n_room, int64_t n_channels, int64_t n_maps, int64_t n,
    int64_t height, int64_t width, int64_t first, const uint8_t counts[n_texels],
    const int32_t charts[n_room], const float values[n_room][n_channels],
    const int32_t firsts[n_maps + 1], const double scales[n_maps], float steps[n],
    float means[n][n_channels]);
int64_t judge_partly_covered(
    int64_t n_texels, int64_t n_room, int64_t n_channels, int64_t n_maps, int64_t n,
    int64_t height, int64_t width, const uint8_t counts[n_texels], const int64_t masks[n_texels],
    const int32_t charts[n_room], const float values[n_room][n_channels],
    const int32_t firsts[n_maps + 1], const double scales[n_maps], const float steps[n_texels],
    const int64_t parts[n], float judged[n]);

/* shading_normals.c */
void interpolate_normals(
    int64_t n_normals, int64_t n_faces, int64_t n, const double normals[n_normals][3],
    const int32_t corners[n_faces][3], const int32_t faces[n], const double weights[n][2],
    const bool back_facing[n], const double back[3], float out[n][3]);
void bend_normals(
    int64_t n_normals, int64_t n_faces, int64_t n, const double normals[n_normals][3],
    const int32_t corners[n_faces][3], const float tangents[n_faces][3][4], const int32_t faces[n],
    const double weights[n][2], const float texels[n][3], double strength,
    const bool back_facing[n], const double back[3], float out[n][3]);
void turn_normals(
    int64_t n, const float texels[n][3], const double matrix[3][3], const bool back_facing[n],
    const double back[3], float out[n][3]);

/* shadow_maps.c */
void find_seen_bounds(
    int64_t height, int64_t width, int64_t n_objects, const int32_t face_ids[height][width],
    const float depths[height][width], const double rays[3][3], const double eye[3], double near,
    const int64_t starts[n_objects + 1], const bool receives[n_objects], const double axes[3][3],
    double rounding, int64_t first, int64_t stop, double bounds[n_objects][2][3]);
void dim_by_shadow(
    int64_t n, int64_t n_positions, int64_t n_faces, int64_t n_views, int64_t height,
    int64_t width, int64_t n_directions, int64_t n_radiance, const double points[n][3],
    const float normals[n][3], const int32_t own_faces[n], int64_t first_own, int64_t stop_own,
    const double positions[n_positions][3], const int32_t faces[n_faces][3],
    const double views[n_views][4][4], const float depths[n_views][height][width],
    const int32_t face_ids[n_views][height][width], const double inverses[n_views][4][4],
    bool is_cone, const double light[3], double radius,
    const float directions[n_directions][3], const float radiance[n_radiance][3],
    float out[n][3]);

/* shell_signs.c */
void see_shell(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const int32_t corners[n_slots][3],
    const float distances[n_slots][512], const uint8_t labels[width][height][depth],
    uint8_t seen[n_slots][512], int64_t start, int64_t stop);
void sign_shell(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const int32_t corners[n_slots][3],
    const float distances[n_slots][512], const uint8_t labels[width][height][depth],
    const uint8_t seen[n_slots][512], float field[n_slots][512], bool thin[n_slots][512],
    double thickness, int64_t start, int64_t stop);

/* sigma_filter.c */
void filter_by_noise(
    int64_t height, int64_t width, const float values[height][width],
    const int32_t charts[height][width], const bool has_data[height][width], double of_shares,
    double relative, int64_t start, int64_t stop, float filtered[height][width]);

/* small_matrices.c */
void sum_row_products(
    int64_t n, int64_t inner, const double a[n][inner], const double b[n][inner], double out[n]);
void multiply_matrices(
    int64_t n_a, int64_t n_b, int64_t n, int64_t rows, int64_t inner, int64_t columns,
    const double a[n_a][rows][inner], const double b[n_b][inner][columns],
    double out[n][rows][columns]);
void solve_systems(
    int64_t n, int64_t size, int64_t columns, double matrices[n][size][size],
    double sides[n][size][columns], double determinants[n]);
void orthogonalize_columns(
    int64_t n, int64_t rows, int64_t columns, double matrices[n][rows][columns],
    double rotations[n][columns][columns]);
void diagonalize(
    int64_t n, int64_t size, double matrices[n][size][size], double rotations[n][size][size]);

/* solid_patterns.c */
void fill_marble(
    int64_t n, int64_t n_coordinates, int64_t n_widths, int64_t n_stops, int64_t n_channels,
    const double points[n][n_coordinates], OPTIONAL const float widths[n][n_widths],
    const uint8_t permutation[512], const double gradients[256][3], const double direction[3],
    const double stops[n_stops][3], const double mean_color[3], float out[n][n_channels],
    bool quintic, int64_t n_octaves, double frequency, double turbulence_frequency,
    double amount, double lacunarity, double gain, double mean, double variance, int64_t start,
    int64_t stop);

void fill_wood(
    int64_t n, int64_t n_coordinates, int64_t n_widths, int64_t n_stops, int64_t n_channels,
    const double points[n][n_coordinates], OPTIONAL const float widths[n][n_widths],
    const uint8_t permutation[512], const double gradients[256][3], const double axis[3],
    const double stops[n_stops][3], const double mean_color[3], float out[n][n_channels],
    bool quintic, double rings, double wobble, double grain, double bound, int64_t start,
    int64_t stop);

void fill_granite(
    int64_t n, int64_t n_coordinates, int64_t n_widths, int64_t n_stops, int64_t n_channels,
    const double points[n][n_coordinates], OPTIONAL const float widths[n][n_widths],
    const uint8_t permutation[512], const double gradients[256][3],
    const double stops[n_stops][3], const double mean_color[3], float out[n][n_channels],
    bool quintic, int64_t n_octaves, double frequency, double lacunarity, double gain,
    double squares, double variance, int64_t start, int64_t stop);

/* streamed_vertices.c */
void read_vertices(
    int64_t n_bytes, int64_t n, const uint8_t bytes[n_bytes], const int64_t layout[9],
    const int32_t vertices[n], double positions[n][3]);
void read_run(
    int64_t n_bytes, int64_t n, const uint8_t bytes[n_bytes], const int64_t layout[9],
    int64_t first, double positions[n][3]);
void bound_points(int64_t n, const double points[n][3], double box[6]);
void bound_corners(
    int64_t n_vertices, int64_t n, const double positions[n_vertices][3], const int32_t faces[n][3],
    double box[6]);
int64_t find_not_finite(
    int64_t n_bytes, const uint8_t bytes[n_bytes], const int64_t layout[9], int64_t start,
    int64_t stop);
void set_bits(int64_t n, int64_t n_words, const int32_t numbers[n], uint64_t bits[n_words]);
void set_hashes(int64_t n, int64_t n_words, const double points[n][3], uint64_t table[n_words]);
void mark_by_hash(
    int64_t n_bytes, int64_t n_table, int64_t n_words, const uint8_t bytes[n_bytes],
    const int64_t layout[9], const uint64_t table[n_table], int64_t start, int64_t stop,
    uint64_t bits[n_words]);
int64_t rank_bits(int64_t n_words, const uint64_t bits[n_words], int32_t ranks[n_words]);
void list_bits(int64_t n_words, int64_t n, const uint64_t bits[n_words], int32_t places[n]);
int64_t keep_marked_faces(
    int64_t n, int64_t n_words, const int32_t faces[n][3], const uint64_t bits[n_words],
    const int32_t ranks[n_words], int32_t kept[n][3], int32_t numbers[n][3]);

/* supersampling.c */
int64_t sample_supersampled(
    int64_t n_texels, int64_t n_channels, int64_t n_levels, int64_t n, int64_t n_samples,
    const float texels[n_texels][n_channels], const int64_t sizes[n_levels][2],
    const double uvs[n][2], const float derivatives[n][4], const double samples[n_samples][2],
    int64_t wraps, const float border[n_channels], float out[n][n_channels], int64_t start,
    int64_t stop);

/* surface_nets.c */
void mark_solid(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], const float field[n_slots][512],
    const uint8_t labels[width][height][depth], bool solid[width][height][depth], int64_t start,
    int64_t stop);
void count_nets(
    int64_t width, int64_t height, int64_t depth, const bool solid[width][height][depth],
    int64_t n_vertices[width], int64_t n_quads[width], int64_t start, int64_t stop);
int64_t build_nets(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, int64_t n_vertices, int64_t n_quads, const int32_t slots[nx][ny][nz],
    const float field[n_slots][512], const bool thin[n_slots][512],
    const bool solid[width][height][depth], const int64_t vertex_starts[width + 1],
    const int64_t quad_starts[width + 1], double positions[n_vertices][3],
    bool is_thin[n_vertices], int32_t quads[n_quads][4], int64_t start, int64_t stop);

/* surrounding_light.c */
void reflect_ambient(
    int64_t n_normals, int64_t n_base, int64_t n_share, int64_t n, const float normals[n_normals][3],
    const double up[3], const float sky[1][3], const float ground[1][3],
    const float base[n_base][3], const float share[n_share], float out[n][3]);
void mirror_directions(
    int64_t n, const float normals[n][3], const float to_eye[n][3], float out[restrict n][3]);
void reflect_environment(
    int64_t n, int64_t n_mirrored, int64_t size, int64_t n_base, int64_t n_roughness,
    int64_t n_metalness, int64_t n_share, const float normals[n][3], const float to_eye[n][3],
    const float diffuse[n][3], const float mirrored[n_mirrored][3],
    const float table[size][size][2], const float base[n_base][3],
    const float roughness[n_roughness][1], const float metalness[n_metalness][1],
    double dielectric, const float share[n_share], float out[n][3]);
void refract_directions(
    int64_t n, const float normals[n][3], const float to_eye[n][3], const bool back_facing[n],
    double index, float out[restrict n][3]);
void mix_in_environment(
    int64_t n, int64_t n_strength, const float normals[n][3], const float to_eye[n][3],
    const float strength[n_strength][3], const float seen[n][3], bool fresnel, float out[n][3]);
void fade_into_fog(
    int64_t n, const double positions[n][3], const double eye[3], int64_t mode, double density,
    double start, double end, const double color[3], float out[n][3]);

/* texel_sums.c */
void add_samples(
    int64_t n, int64_t n_texels, int64_t n_channels, const int32_t texel_ids[n],
    const float values[n][n_channels], float sums[n_texels][n_channels]);

void keep_first_samples(
    int64_t n, int64_t n_texels, int64_t n_channels, const int32_t texel_ids[n],
    const float values[n][n_channels], const uint8_t counts[n_texels],
    float sums[n_texels][n_channels]);

void count_samples(
    int64_t n, int64_t n_texels, const int32_t texel_ids[n], uint8_t counts[n_texels]);

void combine_samples(
    int64_t n, int64_t n_channels, float sums[n][n_channels], const uint8_t counts[n],
    const float neutral[n_channels], int64_t mode);

/* tile_bundles.c */
int64_t cast_bundles(
    int64_t n, int64_t n_leaves, int64_t n_nodes, int64_t n_levels,
    const double leaves[n_leaves][9][8], const int32_t ids[n_leaves][8],
    const float nodes[n_nodes][6][8], const int64_t starts[n_levels], const double box[6],
    const double origins[n][3], const double directions[n][3], const double lengths[n],
    OPTIONAL const int32_t places[n][2], OPTIONAL const int32_t charts[n], int64_t n_together,
    bool cull, double nearest[n], double backs[n], int32_t faces[n], double barycentrics[n][2],
    double distances[n], bool passed_back[n]);
void sort_keys_of_rays(
    int64_t n, const double origins[n][3], const double directions[n][3], const double lengths[n],
    uint64_t keys[n]);

/* triangle_cutting.c */
int64_t close_marks(
    int64_t n, int64_t n_points, int64_t n_edges, const int32_t faces[n][3],
    const int32_t face_edges[n][3], const double points[n_points][3], bool marked[n_edges]);
void count_pieces(
    int64_t n, int64_t n_edges, const int32_t face_edges[n][3], const bool marked[n_edges],
    int64_t added[n + 1]);
void halve_edges(
    int64_t n, int64_t n_out, const int32_t ends[n][2], const bool marked[n],
    const int32_t halves[n], const int32_t middles[n], int32_t out[n_out][2]);
void cut_triangles(
    int64_t n, int64_t n_edges, int64_t n_points, int64_t n_out, int64_t n_ends, int64_t n_places,
    const int32_t faces[n][3], const int32_t face_edges[n][3], const int32_t base_faces[n],
    const float weights[n][3][2], const int32_t ends[n_edges][2], const bool marked[n_edges],
    const int32_t halves[n_edges], const int32_t middles[n_edges],
    const double points[n_points][3], const int64_t added[n + 1], int64_t n_halves,
    int64_t n_vertices, int32_t faces_out[n_out][3], int32_t face_edges_out[n_out][3],
    int32_t base_faces_out[n_out], float weights_out[n_out][3][2], int32_t ends_out[n_ends][2],
    int32_t place_vertices[n_places], int32_t place_faces[n_places],
    float place_weights[n_places][2], int64_t start, int64_t stop);

/* triangle_tree.c */
void morton_keys(
    int64_t n_vertices, int64_t n_faces,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3], const double low[3],
    double cells_a_unit, int64_t axis_bits, int64_t id_bits, int64_t start, int64_t stop,
    uint64_t keys[n_faces]);
int64_t build_triangle_tree(
    int64_t n_vertices, int64_t n_faces, int64_t n_kept, int64_t n_most,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t ids[n_kept], const uint64_t codes[n_kept], float boxes[n_most][6],
    int32_t nodes[n_most][2]);
void closest_points(
    int64_t n_vertices, int64_t n_faces, int64_t n_kept, int64_t n_nodes, int64_t n,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t order[n_kept], const float boxes[n_nodes][6], const int32_t nodes[n_nodes][2],
    const double points[n][3], OPTIONAL const double directions[n][3], double max_distance,
    int64_t start, int64_t stop, double distances[n], int32_t face_ids[n],
    double barycentrics[n][3]);

/* tunnel_carving.c */
int64_t carve_tunnels(
    int64_t nx, int64_t ny, int64_t nz, const bool kept[nx][ny][nz], bool solid[nx][ny][nz],
    int64_t most_steps);

/* tutte.c */

/* union_find.c */
void merge_labels(
    int64_t n_items, int64_t n_pairs,
    int32_t labels[n_items], const int32_t firsts[n_pairs], const int32_t seconds[n_pairs]);

/* value_noise.c */
void fill_value_noise(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double values[256], float out[n][1], int64_t interpolation, int64_t start, int64_t stop);

/* value_range.c */
void measure_ranges(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const bool covered[n],
    float ranges[n_channels][2], int64_t start, int64_t stop);

int64_t count_outside(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const bool covered[n],
    double scale, double mid, double least, double most, int64_t start, int64_t stop);

void count_upper_halves(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const bool covered[n],
    int64_t counts[1 << 16], int64_t start, int64_t stop);

void count_lower_halves(
    int64_t n, int64_t n_channels, const float values[n][n_channels], const bool covered[n],
    int64_t counts[1 << 16], int64_t upper, int64_t start, int64_t stop);

int64_t measure_lengths(
    int64_t n, const float vectors[n][3], const int32_t faces[n], int64_t start, int64_t stop,
    double squares[n]);

/* vertex_normals.c */
void face_normals(
    int64_t n_vertices, int64_t n_faces, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], double scale, double rounding, int64_t start, int64_t stop,
    double normals[n_faces][3]);
void add_vertex_normals(
    int64_t n_vertices, int64_t n_faces, int64_t n_normals, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const int32_t rows[n_faces][3], double scale, double rounding,
    int64_t start, int64_t stop, double normals[n_normals][3]);
int64_t normalize_sums(int64_t n, double normals[n][3]);

/* visibility_buffer.c */
int64_t sort_triangles(
    int64_t n_vertices, int64_t n_faces, int64_t n_objects, int64_t n_bands,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int64_t starts[n_objects + 1], const uint8_t modes[n_objects],
    const double matrix[4][4], const int32_t grid[n_vertices][2], int64_t width, int64_t height,
    int64_t left, int64_t top, int64_t n_columns, int64_t n_rows, int32_t survivors[n_faces],
    int16_t spans[n_faces][2], int64_t counts[n_bands], int64_t start, int64_t stop);

void scatter_triangles(
    int64_t n, int64_t n_bands, int64_t n_places, const int32_t survivors[n],
    const int16_t spans[n][2], int64_t next_places[n_bands], int32_t sorted_faces[n_places]);

void draw_triangles(
    int64_t n_vertices, int64_t n_faces, int64_t n_objects, int64_t n_in_band, int64_t n_rows,
    int64_t n_columns, const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int64_t starts[n_objects + 1], const uint8_t modes[n_objects],
    const double matrix[4][4], const int32_t grid[n_vertices][2], const float depths[n_vertices],
    int64_t width, int64_t height, int64_t left, int64_t top, const int32_t in_band[n_in_band],
    int64_t first_row, int64_t stop_row, OPTIONAL const float layer_depths[n_rows][n_columns],
    OPTIONAL const int32_t layer_faces[n_rows][n_columns],
    OPTIONAL const float last_depths[n_rows][n_columns],
    OPTIONAL uint32_t tries[n_rows][n_columns], int32_t face_ids[n_rows][n_columns],
    float depth_buffer[n_rows][n_columns]);

/* volume_lookup.c */
void sample_volume(
    int64_t depth, int64_t height, int64_t width, int64_t n_channels, int64_t n,
    const float volume[depth][height][width][n_channels], const double points[n][3], bool nearest,
    int64_t wrap, const float border[n_channels], float out[n][n_channels], int64_t start,
    int64_t stop);

/* weld.c */
void hash_rows(
    int64_t n, int64_t k, const uint32_t words[n][k], const uint64_t keys[k + 1], int64_t start,
    int64_t stop, uint32_t hashes[n]);
int64_t weld_part(
    int64_t n, int64_t k, const uint32_t words[n][k], const uint32_t hashes[n], int64_t part_bits,
    int64_t part, int32_t firsts[n]);

/* well_composed.c */
int64_t compose_well(
    int64_t n_slots, int64_t nx, int64_t ny, int64_t nz, int64_t width, int64_t height,
    int64_t depth, const int32_t slots[nx][ny][nz], bool solid[width][height][depth],
    float field[n_slots][512]);

/* winding_numbers.c */
void gather_clusters(
    int64_t n_vertices, int64_t n_faces, int64_t n_clusters, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const int64_t starts[n_clusters + 1],
    double clusters[n_clusters][7], int64_t start, int64_t stop);
void measure_winding(
    int64_t n_vertices, int64_t n_faces, int64_t n_clusters, int64_t n,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int64_t starts[n_clusters + 1], const double clusters[n_clusters][7],
    const double points[n][3], double windings[n], int64_t start, int64_t stop);

/* worley_noise.c */
void fill_cells(
    int64_t n, int64_t n_coordinates, int64_t n_widths, const double points[n][n_coordinates],
    OPTIONAL const float widths[n][n_widths], const uint8_t permutation[512],
    const double places[256][3], float out[n][1], double jitter, bool is_solid, int64_t feature,
    double mean, int64_t start, int64_t stop);

#pragma GCC visibility pop

#endif
