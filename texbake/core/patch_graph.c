/* The neighbors of each vertex of a patch of triangles, and its boundary loops.

   Called from texbake/mapping/atlas/flattening/patch.py. */

#include "arena.h"
#include "core.h"

/* Rows as they are filled: each has room for two neighbors a triangle, and the vertex itself. */
struct loose_rows {
    int64_t *starts;
    int32_t *lengths;
    int32_t *columns;
    int32_t *leaving; /* triangle edges from row to column */
    int32_t *arriving;
};

static struct loose_rows make_loose_rows(
    struct arena *arena, int64_t n_faces, int64_t n_vertices, const int32_t (*faces)[3])
{
    struct loose_rows rows;
    rows.starts = TAKE_ZEROS(arena, int64_t, n_vertices + 1);
    rows.lengths = TAKE(arena, int32_t, n_vertices);
    for (int64_t face = 0; face < n_faces; face++)
        for (int i = 0; i < 3; i++)
            rows.starts[faces[face][i] + 1] += 2;
    for (int64_t vertex = 0; vertex < n_vertices; vertex++)
        rows.starts[vertex + 1] += rows.starts[vertex] + 1;
    const int64_t n_loose = rows.starts[n_vertices];
    rows.columns = TAKE(arena, int32_t, n_loose);
    rows.leaving = TAKE_ZEROS(arena, int32_t, n_loose);
    rows.arriving = TAKE_ZEROS(arena, int32_t, n_loose);
    for (int64_t vertex = 0; vertex < n_vertices; vertex++) {
        rows.columns[rows.starts[vertex]] = (int32_t)vertex;
        rows.lengths[vertex] = 1;
    }
    return rows;
}

/* Where a column stands in its row; it is added if it is new. */
static int32_t place_in_row(struct loose_rows *rows, int32_t row, int32_t column)
{
    int32_t *columns = rows->columns + rows->starts[row];
    int32_t at = 0;
    while (at < rows->lengths[row] && columns[at] != column)
        at++;
    if (at == rows->lengths[row]) {
        columns[at] = column;
        rows->lengths[row]++;
    }
    return at;
}

/* Fill the rows; return whether the triangles are an oriented surface. */
static bool fill_rows(
    struct loose_rows *rows, int64_t n_faces, const int32_t (*faces)[3], int32_t (*entries)[3][3])
{
    bool is_surface = true;
    for (int64_t face = 0; face < n_faces; face++) {
        for (int i = 0; i < 3; i++) {
            const int32_t row = faces[face][i];
            for (int j = 0; j < 3; j++) {
                const int32_t at = place_in_row(rows, row, faces[face][j]);
                const int64_t loose = rows->starts[row] + at;
                entries[face][i][j] = at;
                if (j == i)
                    continue;
                if (j == (i + 1) % 3)
                    rows->leaving[loose]++;
                else
                    rows->arriving[loose]++;
                if (at == 0 || rows->leaving[loose] > 1 || rows->arriving[loose] > 1)
                    is_surface = false;
            }
        }
    }
    return is_surface;
}

/* Write the rows one after another, and the boundary edges; return the number of these. */
static int64_t join_rows(
    const struct loose_rows *rows, int64_t n_vertices, int64_t *row_starts, int32_t *columns,
    int32_t (*boundary)[2])
{
    int64_t n_boundary = 0;
    row_starts[0] = 0;
    for (int64_t row = 0; row < n_vertices; row++) {
        row_starts[row + 1] = row_starts[row] + rows->lengths[row];
        for (int64_t at = 0; at < rows->lengths[row]; at++) {
            const int64_t loose = rows->starts[row] + at;
            columns[row_starts[row] + at] = rows->columns[loose];
            if (at > 0 && rows->leaving[loose] > rows->arriving[loose]) {
                boundary[n_boundary][0] = (int32_t)row;
                boundary[n_boundary][1] = rows->columns[loose];
                n_boundary++;
            }
        }
    }
    return n_boundary;
}

/* Find the rows of neighbors, the entry of each pair of corners, and the boundary edges; return
   the number of these, or -1 if the triangles are no oriented surface. `columns` and `boundary`
   have room for the most there can be. */
int64_t find_patch_neighbors(
    int64_t n_faces, int64_t n_vertices, int64_t n_columns, int64_t n_edges,
    const int32_t faces[n_faces][3], int64_t row_starts[n_vertices + 1],
    int32_t columns[n_columns], int32_t entries[n_faces][3][3], int32_t boundary[n_edges][2])
{
    if (n_columns < n_vertices + 6 * n_faces || n_edges < 3 * n_faces)
        return -1;
    OPEN_ARENA(arena);
    struct loose_rows rows = make_loose_rows(arena, n_faces, n_vertices, faces);
    int64_t n_boundary = -1;
    if (fill_rows(&rows, n_faces, faces, entries)) {
        n_boundary = join_rows(&rows, n_vertices, row_starts, columns, boundary);
        for (int64_t face = 0; face < n_faces; face++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    entries[face][i][j] += (int32_t)row_starts[faces[face][i]];
    }
    close_arena(arena);
    return n_boundary;
}

/* Chain boundary edges into loops; return the number of loops. `following` is the vertex after
   each, or -1; `order` gets the vertices loop by loop, `starts` where each loop starts, and after
   the last its end. */
int64_t chain_loops(
    int64_t n, const int32_t following[n], int32_t order[n], int64_t starts[n + 1])
{
    OPEN_ARENA(arena);
    bool *seen = TAKE_ZEROS(arena, bool, n);
    int64_t n_ordered = 0, n_loops = 0;
    for (int32_t first = 0; first < n; first++) {
        if (following[first] < 0 || seen[first])
            continue;
        starts[n_loops++] = n_ordered;
        for (int32_t vertex = first; vertex >= 0 && !seen[vertex]; vertex = following[vertex]) {
            seen[vertex] = true;
            order[n_ordered++] = vertex;
        }
    }
    starts[n_loops] = n_ordered;
    close_arena(arena);
    return n_loops;
}
