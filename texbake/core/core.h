/* Every function that Python calls, and the one table of what each may be given.

   `texbake/core/declarations.py` reads these prototypes when a function is first called, and
   `binding.py` checks every array against them: its type, its dimensions, that it is contiguous and
   aligned, that sizes of the same name agree, and that what is written to is writable. An array
   that is only read is `const`.

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

/* processor.c */
bool has_x86_64_v3(void);

/* conjugate_gradient.c */
int64_t solve_blocks(
    int64_t n, int64_t n_entries,
    const int64_t row_starts[n + 1], const int32_t columns[n_entries],
    const double blocks[n_entries][4], const double target[n][2], const double uvs[n][2],
    const int32_t regions[n], double solution[n][2], double tolerance, int64_t n_iterations);

/* decimals.c */
void read_numbers(
    int64_t n, int64_t n_values, int64_t n_lines, int64_t n_hard,
    const uint8_t text[n], int64_t start, int64_t stop, int64_t lead, bool fill,
    const uint64_t fives[256][2], double values[n_values], int64_t lines[n_lines],
    int64_t hard[n_hard][2], int64_t tally[3]);

/* face_components.c */
int64_t number_components(
    int64_t n_vertices, int64_t n_faces, const int32_t faces[n_faces][3],
    int32_t components[n_faces]);

/* face_crossings.c */
void find_crossings(
    int64_t n_vertices, int64_t n_faces, int64_t n_nodes, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], const int32_t order[n_faces], const float boxes[n_nodes][6],
    const int32_t nodes[n_nodes][2], const double normals[n_faces][3], double depth, int64_t most,
    int64_t start, int64_t stop, int32_t others[n_faces], bool unsure[n_faces]);

/* mean_curvature.c */
void add_curvatures(
    int64_t n_vertices, int64_t n_faces, const double points[n_vertices][3],
    const int32_t faces[n_faces][3], const int32_t firsts[n_vertices],
    const double normals[n_vertices][3], double turns[n_vertices], double areas[n_vertices]);

/* mikktspace_fans.c */
void pair_edges(
    int64_t n, const int64_t keys[n], const int64_t edges[n], const int32_t starts[n],
    int32_t neighbors[n]);
int64_t number_fans(
    int64_t n_faces, int64_t n_corners, const int32_t vertices[n_faces][3],
    const int32_t neighbors[n_faces][3], const bool unmapped[n_faces], bool preserving[n_faces],
    int32_t fans[n_faces][3], bool fan_preserving[n_corners]);

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

/* orange_pores.c */
void pore_depths(
    int64_t n, int64_t n_pores, int64_t n_starts, int64_t n_entries,
    const double directions[n][3], const double centers[n_pores][3], const double radii[n_pores],
    const double depths_of_pores[n_pores], int64_t n_cells, const int64_t cell_starts[n_starts],
    const int64_t cell_pores[n_entries], double depths[n]);

/* orientation.c */
void join_orientations(
    int64_t n, int64_t n_pairs, int64_t parents[n], bool flips[n], const int64_t one[n_pairs],
    const int64_t other[n_pairs], const bool along[n_pairs]);

/* pinched_vertices.c */
int64_t has_pinched_vertex(int64_t n_vertices, int64_t n_faces, const int32_t faces[n_faces][3]);

/* ply_rows.c */
int64_t walk_binary_rows(
    int64_t n, int64_t n_columns, int64_t n_rows, const uint8_t bytes[n], int64_t start,
    const int64_t layout[n_columns][3], bool big_endian, int64_t offsets[n_columns][n_rows],
    int64_t sizes[n_columns][n_rows], int64_t end[1]);
int64_t walk_text_rows(
    int64_t n, int64_t n_columns, int64_t n_rows, const double numbers[n], int64_t start,
    const int64_t layout[n_columns][3], int64_t offsets[n_columns][n_rows],
    int64_t sizes[n_columns][n_rows], int64_t end[1]);
void gather_pieces(
    int64_t n, int64_t n_pieces, int64_t n_gathered, const uint8_t bytes[n], int64_t unit_size,
    const int64_t offsets[n_pieces], const int64_t lengths[n_pieces], uint8_t gathered[n_gathered]);

/* triangle_tree.c */
void morton_keys(
    int64_t n_vertices, int64_t n_faces,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3], const double low[3],
    double cells_a_unit, int64_t axis_bits, int64_t id_bits, int64_t start, int64_t stop,
    uint64_t keys[n_faces]);
int64_t build_triangle_tree(
    int64_t n_vertices, int64_t n_faces, int64_t n_most,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t ids[n_faces], const uint64_t codes[n_faces], float boxes[n_most][6],
    int32_t nodes[n_most][2]);
void closest_points(
    int64_t n_vertices, int64_t n_faces, int64_t n_nodes, int64_t n,
    const double positions[n_vertices][3], const int32_t faces[n_faces][3],
    const int32_t order[n_faces], const float boxes[n_nodes][6], const int32_t nodes[n_nodes][2],
    const double points[n][3], double max_distance, int64_t start, int64_t stop,
    double distances[n], int32_t face_ids[n], double barycentrics[n][3]);

/* vertex_normals.c */
void face_normals(
    int64_t n_vertices, int64_t n_faces, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], double scale, double rounding, int64_t start, int64_t stop,
    double normals[n_faces][3]);
void vertex_normals(
    int64_t n_vertices, int64_t n_faces, const double positions[n_vertices][3],
    const int32_t faces[n_faces][3], double scale, double rounding, int64_t start, int64_t stop,
    double normals[n_vertices][3]);

/* weld.c */
void hash_rows(
    int64_t n, int64_t k, const uint32_t words[n][k], int64_t start, int64_t stop,
    uint32_t hashes[n]);
int64_t weld_part(
    int64_t n, int64_t k, const uint32_t words[n][k], const uint32_t hashes[n], int64_t part_bits,
    int64_t part, int32_t firsts[n]);

#pragma GCC visibility pop

#endif
