/* The neighbors of each vertex of a patch of triangles, its boundary, and whether it is a disk.

   Rows are filled vertex by vertex from the triangles around it, so that the time does not grow with
   the number of triangles at a vertex.

   Called from flatten.c, part_layout.c and tutte.c. */

#include "flattening.h"

#include "arena.h"
#include "core.h"
#include "union_find.h"

/* The corners of triangles at each vertex, in the order of triangles: 3 * triangle + corner. */
struct fans {
    int64_t *starts;
    int32_t *corners;
};

static struct fans fans_of(
    struct arena *arena, int64_t n, int64_t n_faces, const int32_t (*faces)[3])
{
    struct fans fans = {TAKE_ZEROS(arena, int64_t, n + 2), TAKE(arena, int32_t, 3 * n_faces)};
    int64_t *ends = fans.starts + 1; /* where the next corner of each vertex goes */
    const int32_t *vertices = *faces;
    for (int64_t corner = 0; corner < 3 * n_faces; corner++)
        ends[vertices[corner] + 1]++;
    for (int64_t vertex = 0; vertex < n; vertex++)
        ends[vertex + 1] += ends[vertex];
    for (int64_t corner = 0; corner < 3 * n_faces; corner++)
        fans.corners[ends[vertices[corner]]++] = (int32_t)corner;
    return fans;
}

/* The row of a vertex while it is filled. */
struct row {
    int32_t *columns;
    int32_t *leaving; /* triangle edges from the vertex to each column */
    int32_t *arriving;
    int64_t length;
};

/* Fill the row of a vertex; return whether its triangles form an oriented surface. `slots` holds
   the place of each column in the last row that had it, `last` which row that was. */
static bool fill_row(
    struct patch *patch, const struct fans *fans, int32_t vertex, struct row *row, int32_t *slots,
    int32_t *last)
{
    const int64_t start = patch->row_starts[vertex];
    bool is_surface = true;
    row->columns[0] = vertex;
    row->leaving[0] = row->arriving[0] = 0;
    row->length = 1;
    slots[vertex] = 0;
    last[vertex] = vertex;
    for (int64_t at = fans->starts[vertex]; at < fans->starts[vertex + 1]; at++) {
        const int32_t face = fans->corners[at] / 3, i = fans->corners[at] % 3;
        for (int j = 0; j < 3; j++) {
            const int32_t column = patch->faces[face][j];
            if (last[column] != vertex) {
                last[column] = vertex;
                slots[column] = (int32_t)row->length;
                row->leaving[row->length] = row->arriving[row->length] = 0;
                row->columns[row->length++] = column;
            }
            const int32_t slot = slots[column];
            patch->entries[face][i][j] = (int32_t)(start + slot);
            if (j == (i + 1) % 3)
                row->leaving[slot]++;
            else if (j != i)
                row->arriving[slot]++;
            if (j != i && (slot == 0 || row->leaving[slot] > 1 || row->arriving[slot] > 1))
                is_surface = false;
        }
    }
    return is_surface;
}

/* Fill all rows and list the boundary edges; return whether the triangles form a surface. */
static bool fill_rows(struct arena *arena, struct patch *patch, const struct fans *fans)
{
    int32_t *slots = TAKE(arena, int32_t, patch->n);
    int32_t *last = TAKE(arena, int32_t, patch->n);
    int64_t most = 0;
    for (int64_t vertex = 0; vertex < patch->n; vertex++) {
        const int64_t degree = fans->starts[vertex + 1] - fans->starts[vertex];
        most = degree > most ? degree : most;
        last[vertex] = -1;
    }
    int32_t *leaving = TAKE(arena, int32_t, 2 * most + 1);
    int32_t *arriving = TAKE(arena, int32_t, 2 * most + 1);
    patch->row_starts[0] = 0;
    patch->n_edges = 0;
    for (int32_t vertex = 0; vertex < patch->n; vertex++) {
        struct row row = {patch->columns + patch->row_starts[vertex], leaving, arriving, 0};
        if (!fill_row(patch, fans, vertex, &row, slots, last))
            return false;
        for (int64_t at = 1; at < row.length; at++) {
            if (leaving[at] > arriving[at]) {
                patch->edges[patch->n_edges][0] = vertex;
                patch->edges[patch->n_edges++][1] = row.columns[at];
            }
        }
        patch->row_starts[vertex + 1] = patch->row_starts[vertex] + row.length;
    }
    return true;
}

/* Chain the boundary edges into loops, unless more than one leaves some vertex. */
static void chain_loops(struct arena *arena, struct patch *patch)
{
    int32_t *following = TAKE(arena, int32_t, patch->n);
    int32_t *loop_of = TAKE_ZEROS(arena, int32_t, patch->n);
    for (int64_t vertex = 0; vertex < patch->n; vertex++)
        following[vertex] = -1;
    for (int64_t edge = 0; edge < patch->n_edges; edge++) {
        patch->has_touching_fans |= following[patch->edges[edge][0]] >= 0;
        following[patch->edges[edge][0]] = patch->edges[edge][1];
        patch->edge_loops[edge] = 0;
    }
    patch->loop_starts[0] = 0;
    if (patch->has_touching_fans)
        return;
    int64_t n_chained = 0;
    for (int64_t edge = 0; edge < patch->n_edges; edge++) { /* in the order of their vertices */
        int32_t vertex = patch->edges[edge][0];
        if (following[vertex] < 0)
            continue;
        while (following[vertex] >= 0) {
            const int32_t next = following[vertex];
            following[vertex] = -1;
            loop_of[vertex] = (int32_t)patch->n_loops;
            patch->loop_vertices[n_chained++] = vertex;
            vertex = next;
        }
        patch->loop_starts[++patch->n_loops] = n_chained;
    }
    for (int64_t edge = 0; edge < patch->n_edges; edge++)
        patch->edge_loops[edge] = loop_of[patch->edges[edge][0]];
}

/* Whether the triangles are connected by vertices, and a disk once all loops but one are filled. */
static bool find_disk(struct arena *arena, const struct patch *patch)
{
    int32_t *labels = TAKE(arena, int32_t, patch->n);
    int64_t n_used = 0;
    for (int32_t vertex = 0; vertex < patch->n; vertex++) {
        labels[vertex] = vertex;
        n_used += patch->row_starts[vertex + 1] > patch->row_starts[vertex] + 1;
    }
    for (int64_t face = 0; face < patch->n_faces; face++) {
        join_labels(labels, patch->faces[face][0], patch->faces[face][1]);
        join_labels(labels, patch->faces[face][1], patch->faces[face][2]);
    }
    const int32_t root = find_label(labels, patch->faces[0][0]);
    for (int64_t face = 1; face < patch->n_faces; face++)
        if (find_label(labels, patch->faces[face][0]) != root)
            return false;
    const int64_t n_sides = (patch->row_starts[patch->n] - patch->n) / 2;
    const int64_t euler = n_used - n_sides + patch->n_faces;
    return !patch->has_touching_fans && patch->n_loops > 0 && euler + patch->n_loops == 2;
}

bool make_patch(
    struct arena *arena, int64_t n, int64_t n_faces, const int32_t (*faces)[3],
    struct patch *patch)
{
    *patch = (struct patch){.n = n, .n_faces = n_faces, .faces = faces};
    if (n_faces == 0)
        return false;
    patch->row_starts = TAKE(arena, int64_t, n + 1);
    patch->columns = TAKE(arena, int32_t, n + 6 * n_faces);
    patch->entries = take(arena, n_faces, sizeof *patch->entries);
    patch->edges = take(arena, 3 * n_faces, sizeof *patch->edges);
    const arena_mark mark = mark_arena(arena);
    const struct fans fans = fans_of(arena, n, n_faces, faces);
    const bool is_surface = fill_rows(arena, patch, &fans);
    reset_arena(arena, mark);
    if (!is_surface)
        return false;
    patch->edge_loops = TAKE(arena, int32_t, patch->n_edges);
    patch->loop_vertices = TAKE(arena, int32_t, patch->n_edges);
    patch->loop_starts = TAKE(arena, int64_t, patch->n_edges + 1);
    const arena_mark made = mark_arena(arena);
    chain_loops(arena, patch);
    patch->is_disk = find_disk(arena, patch);
    reset_arena(arena, made);
    return true;
}
