/* Faces divided into connected parts of similar size, with borders along creases.

   Parts grow from seeds like the cells of a Voronoi diagram, over a graph of the faces in which a
   step across a crease is long, so that borders settle on creases. Each seed then moves to the
   middle of its part, which makes parts compact and of similar size.

   Distances are small whole numbers: ties stay ties in spite of rounding in the positions, so that
   parts do not depend on the size and position of a model. Faces that wait are kept in one list for
   each distance ahead, and one list is due at a time, so that no priority queue is needed.

   Based on: Cohen-Steiner, Alliez, Desbrun, "Variational Shape Approximation", 2004 (Lloyd's
   iteration over the faces of a mesh, flooded from seeds); Dial, "Algorithm 360: Shortest-Path Forest
   with Topological Ordering", 1969.

   Called from part_division.c and texbake/mapping/atlas/cutting/parts.py. */

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "arena.h"
#include "core.h"
#include "numbers.h"
#include "parts.h"

/* Distance of faces that nothing reaches. */
#define FAR_AWAY INT32_MAX

/* Steps between neighbors are from 1 to this. */
enum { LONGEST_STEP = 63, N_SLOTS = LONGEST_STEP + 1 };

/* A face, the label offered to it, and the next row of its list. */
struct offer {
    int32_t face, label, next;
};

struct flood {
    const int32_t (*neighbors)[3];
    const int32_t (*steps)[3];
    const int32_t *within; /* no step crosses from one value to another; NULL: all have the same */
    int32_t *labels;
    int32_t *distances;  /* FAR_AWAY at first */
    int32_t *sizes;      /* faces of each label */
    struct offer *queue; /* three rows per face, and one per source */
    int64_t most;        /* faces of a label */
};

/* Lists of offers, one for each distance ahead. */
struct offers {
    int32_t heads[N_SLOTS];
    int32_t n_rows;
    int64_t n_waiting;
};

static void add_offer(
    struct offers *offers, struct offer *queue, int64_t slot, int32_t face, int32_t label)
{
    queue[offers->n_rows] = (struct offer){face, label, offers->heads[slot]};
    offers->heads[slot] = offers->n_rows++;
    offers->n_waiting++;
}

/* Label a face that awaits a label, and offer the label to its neighbors. */
static void settle(
    const struct flood *flood, struct offers *offers, int32_t face, int32_t label, int64_t distance)
{
    flood->labels[face] = label;
    flood->distances[face] = (int32_t)distance;
    flood->sizes[label]++;
    for (int side = 0; side < 3; side++) {
        const int32_t other = flood->neighbors[face][side];
        if (other < 0 || flood->labels[other] != OPEN_FACE)
            continue;
        if (flood->within && flood->within[other] != flood->within[face])
            continue;
        const int64_t reach = distance + flood->steps[face][side];
        if (reach < flood->distances[other]) {
            flood->distances[other] = (int32_t)reach;
            add_offer(offers, flood->queue, reach % N_SLOTS, other, label);
        }
    }
}

/* Label every open face by its nearest source. */
static void flood_from(
    const struct flood *flood, int64_t n_sources, const int32_t *sources,
    const int32_t *source_labels)
{
    struct offers offers = {.n_rows = 0, .n_waiting = 0};
    for (int slot = 0; slot < N_SLOTS; slot++)
        offers.heads[slot] = -1;
    for (int64_t row = 0; row < n_sources; row++)
        add_offer(&offers, flood->queue, 0, sources[row], source_labels[row]);
    for (int64_t distance = 0; offers.n_waiting > 0; distance++) {
        int32_t *head = &offers.heads[distance % N_SLOTS];
        while (*head >= 0) {
            const struct offer due = flood->queue[*head];
            *head = due.next;
            offers.n_waiting--;
            if (flood->labels[due.face] != OPEN_FACE)
                continue;
            if (flood->sizes[due.label] >= flood->most)
                flood->distances[due.face] = FAR_AWAY; /* another label may take it */
            else
                settle(flood, &offers, due.face, due.label, distance);
        }
    }
}

/* Length of a step between neighbors at the mean distance. It is not a round number, so that the
   steps of regular meshes do not lie halfway between two whole numbers. */
static const double UNITS_A_STEP = 4.236;

/* How many times longer a step across a right angle is than one on a plane. */
static const double CREASE = 30.0;

/* Parts of fewer faces than `LEAST_TRIMMED` would lose too much if their teeth were cut off. */
enum { N_ITERATIONS = 3, N_TRIMS = 2, LEAST_TRIMMED = 24 };

/* Parts stop growing at this multiple of their intended size, and parts below this share of it go to
   a neighbor. */
static const double MOST_SHARE = 1.5;
static const double LEAST_SHARE = 0.25;

/* What a division works on. */
struct division {
    const struct face_graph *graph;
    const int32_t *within;
    int32_t (*steps)[3];
    int32_t *labels, *distances, *sizes, *reached, *sources, *source_labels;
    struct offer *queue;
    int64_t part_faces, least, most;
};

/* Whole-numbered steps from the lengths between neighbors. */
static void set_steps(const struct face_graph *graph, int32_t (*steps)[3])
{
    double sum = 0.0;
    int64_t n_sides = 0;
    for (int64_t face = 0; face < graph->n_faces; face++) {
        for (int side = 0; side < 3; side++) {
            if (graph->neighbors[face][side] >= 0) {
                sum += graph->lengths[face][side];
                n_sides++;
            }
        }
    }
    const double units = sum > 0.0 ? UNITS_A_STEP * (double)n_sides / sum : 0.0;
    for (int64_t face = 0; face < graph->n_faces; face++)
        for (int side = 0; side < 3; side++)
            steps[face][side] =
                (int32_t)clamp_f64(rint(units * graph->lengths[face][side]), 1.0, LONGEST_STEP);
}

static struct flood flood_of(const struct division *division, int64_t most)
{
    return (struct flood){
        division->graph->neighbors, (const int32_t (*)[3])division->steps, division->within,
        division->labels, division->distances, division->sizes, division->queue, most};
}

/* Give the faces that are still open new labels, in patches of at most `part_faces` faces; return
   the number of labels. */
static int32_t seed(const struct division *division, int32_t n_labels)
{
    const int64_t n_faces = division->graph->n_faces;
    const struct flood flood = flood_of(division, division->part_faces);
    for (int64_t face = 0; face < n_faces; face++)
        division->distances[face] = FAR_AWAY;
    for (int32_t face = 0; face < n_faces; face++) {
        if (division->labels[face] == OPEN_FACE) {
            division->sizes[n_labels] = 0;
            flood_from(&flood, 1, &face, &n_labels);
            n_labels++;
        }
    }
    return n_labels;
}

/* Find the face farthest from the border of every label that is not too small: the first of several,
   and one of a part without any border. Return how many there are, in `sources`. */
static int64_t find_centers(const struct division *division, int32_t n_labels)
{
    const int64_t n_faces = division->graph->n_faces;
    const int32_t *labels = division->labels;
    int32_t *sizes = division->sizes, *sources = division->sources;
    int64_t n_borders = 0;
    memset(sizes, 0, (size_t)n_labels * sizeof *sizes);
    for (int32_t face = 0; face < n_faces; face++) {
        division->reached[face] = labels[face] >= 0 ? OPEN_FACE : CLOSED_FACE;
        division->distances[face] = FAR_AWAY;
        bool is_border = false;
        for (int side = 0; side < 3; side++) {
            const int32_t other = division->graph->neighbors[face][side];
            is_border |= other < 0 || labels[other] != labels[face];
        }
        if (labels[face] >= 0 && is_border) {
            sources[n_borders] = face;
            division->source_labels[n_borders++] = labels[face];
        }
    }
    struct flood flood = flood_of(division, n_faces);
    flood.labels = division->reached;
    flood.within = labels;
    flood_from(&flood, n_borders, sources, division->source_labels);
    int32_t *farthest = division->source_labels; /* of each label */
    memset(sizes, 0, (size_t)n_labels * sizeof *sizes);
    for (int32_t face = 0; face < n_faces; face++) {
        const int32_t label = labels[face];
        if (label < 0)
            continue;
        if (sizes[label]++ == 0 || division->distances[face] > division->distances[farthest[label]])
            farthest[label] = face;
    }
    int64_t n_centers = 0;
    for (int32_t label = 0; label < n_labels; label++)
        if (sizes[label] >= max_i64(division->least, 1))
            sources[n_centers++] = farthest[label];
    return n_centers;
}

/* Flood again from the middles of the parts; return the number of labels. */
static int32_t move_seeds(const struct division *division, int32_t n_labels)
{
    const int64_t n_faces = division->graph->n_faces;
    const int64_t n_centers = find_centers(division, n_labels);
    for (int64_t face = 0; face < n_faces; face++) {
        if (division->labels[face] >= 0)
            division->labels[face] = OPEN_FACE;
        division->distances[face] = FAR_AWAY;
    }
    for (int32_t label = 0; label < n_centers; label++) {
        division->source_labels[label] = label;
        division->sizes[label] = 0;
    }
    const struct flood flood = flood_of(division, division->most);
    flood_from(&flood, n_centers, division->sources, division->source_labels);
    return seed(division, (int32_t)n_centers);
}

/* Two labels that meet along a side, as one number. */
static int compare_pairs(const void *one, const void *other)
{
    const int64_t a = *(const int64_t *)one, b = *(const int64_t *)other;
    return (a > b) - (a < b);
}

/* Merge every label of too few faces into the large one that it shares most sides with. */
static void merge_pockets(struct arena *arena, const struct division *division, int32_t n_labels)
{
    const arena_mark mark = mark_arena(arena);
    const struct face_graph *graph = division->graph;
    int32_t *labels = division->labels, *sizes = division->sizes;
    memset(sizes, 0, (size_t)n_labels * sizeof *sizes);
    for (int64_t face = 0; face < graph->n_faces; face++)
        if (labels[face] >= 0)
            sizes[labels[face]]++;
    int64_t *pairs = TAKE(arena, int64_t, 3 * graph->n_faces), n_pairs = 0;
    for (int64_t face = 0; face < graph->n_faces; face++) {
        if (labels[face] < 0 || sizes[labels[face]] >= division->least)
            continue;
        for (int side = 0; side < 3; side++) {
            const int32_t other = graph->neighbors[face][side];
            if (other < 0 || labels[other] < 0 || sizes[labels[other]] < division->least)
                continue;
            if (!division->within || division->within[other] == division->within[face])
                pairs[n_pairs++] = (int64_t)labels[face] << 32 | labels[other];
        }
    }
    qsort(pairs, (size_t)n_pairs, sizeof *pairs, compare_pairs);
    int32_t *into = TAKE(arena, int32_t, n_labels);
    int64_t *shared = TAKE_ZEROS(arena, int64_t, n_labels);
    for (int32_t label = 0; label < n_labels; label++)
        into[label] = label;
    for (int64_t first = 0, next; first < n_pairs; first = next) {
        next = first + 1;
        while (next < n_pairs && pairs[next] == pairs[first])
            next++;
        const int32_t small = (int32_t)(pairs[first] >> 32);
        if (next - first >= shared[small]) {
            shared[small] = next - first;
            into[small] = (int32_t)(pairs[first] & INT32_MAX);
        }
    }
    for (int64_t face = 0; face < graph->n_faces; face++)
        if (labels[face] >= 0)
            labels[face] = into[labels[face]];
    reset_arena(arena, mark);
}

/* Give every face that borders its own part on one side only to the part on the other two. Without
   such teeth, borders are less likely to overlap when the parts are flattened. */
static void trim_teeth(const struct division *division)
{
    int32_t *labels = division->labels;
    for (int64_t face = 0; face < division->graph->n_faces; face++) {
        const int32_t *sides = division->graph->neighbors[face];
        if (labels[face] < 0 || sides[0] < 0 || sides[1] < 0 || sides[2] < 0)
            continue;
        const int32_t one = labels[sides[0]], two = labels[sides[1]], three = labels[sides[2]];
        if (one >= 0 && (one == two || one == three))
            labels[face] = one;
        else if (two >= 0 && two == three)
            labels[face] = two;
    }
}

/* Number the labels in use in their order; return how many there are. */
static int32_t renumber(const struct division *division, int32_t n_labels)
{
    int32_t *numbers = division->sizes, n_used = 0;
    memset(numbers, 0, (size_t)n_labels * sizeof *numbers);
    for (int64_t face = 0; face < division->graph->n_faces; face++)
        if (division->labels[face] >= 0)
            numbers[division->labels[face]] = 1;
    for (int32_t label = 0; label < n_labels; label++)
        numbers[label] = numbers[label] ? n_used++ : -1;
    for (int64_t face = 0; face < division->graph->n_faces; face++)
        if (division->labels[face] >= 0)
            division->labels[face] = numbers[division->labels[face]];
    return n_used;
}

int32_t divide_faces(
    struct arena *arena, const struct face_graph *graph, const int32_t *within,
    int64_t part_faces, int32_t *labels)
{
    const arena_mark mark = mark_arena(arena);
    const int64_t n = graph->n_faces;
    struct division division = {
        graph, within, take(arena, n, sizeof *division.steps), labels, TAKE(arena, int32_t, n),
        TAKE(arena, int32_t, 2 * n + 1), TAKE(arena, int32_t, n), TAKE(arena, int32_t, n + 1),
        TAKE(arena, int32_t, n + 1), TAKE(arena, struct offer, 4 * n + 1), part_faces,
        (int64_t)(LEAST_SHARE * (double)part_faces), (int64_t)(MOST_SHARE * (double)part_faces)};
    set_steps(graph, division.steps);
    int32_t n_labels = seed(&division, 0);
    for (int i = 0; i < N_ITERATIONS; i++)
        n_labels = move_seeds(&division, n_labels);
    merge_pockets(arena, &division, n_labels);
    for (int i = 0; i < N_TRIMS && part_faces >= LEAST_TRIMMED; i++)
        trim_teeth(&division);
    n_labels = renumber(&division, n_labels);
    reset_arena(arena, mark);
    return n_labels;
}

/* Divide faces as `divide_faces` does; `within` comes with the connected piece of each face. */
EXPORT int64_t divide_into_parts(
    int64_t n_faces, const int32_t neighbors[n_faces][3], const double lengths[n_faces][3],
    const int32_t within[n_faces], int64_t part_faces, int32_t labels[n_faces])
{
    OPEN_ARENA(arena);
    const struct face_graph graph = {n_faces, neighbors, lengths};
    const int32_t n_labels = divide_faces(arena, &graph, within, part_faces, labels);
    close_arena(arena);
    return n_labels;
}

/* Area-weighted normal of each face, added up over its neighbors in some rounds. */
static double (*smooth_normals(
    struct arena *arena, int64_t n_faces, const double (*points)[3], const int32_t (*faces)[3],
    const int32_t (*neighbors)[3], int64_t n_rounds))[3]
{
    double (*normals)[3] = take(arena, n_faces, sizeof *normals);
    double (*added)[3] = take(arena, n_faces, sizeof *added);
    for (int64_t face = 0; face < n_faces; face++) {
        const double *a = points[faces[face][0]], *b = points[faces[face][1]];
        const double *c = points[faces[face][2]];
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            normals[face][i] = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
        }
    }
    for (int64_t round = 0; round < n_rounds; round++) {
        for (int64_t face = 0; face < n_faces; face++) {
            memcpy(added[face], normals[face], sizeof added[face]);
            for (int side = 0; side < 3; side++)
                for (int i = 0; neighbors[face][side] >= 0 && i < 3; i++)
                    added[face][i] += normals[neighbors[face][side]][i];
        }
        double (*kept)[3] = normals;
        normals = added;
        added = kept;
    }
    return normals;
}

/* Write how far each neighbor of a face is: from center to center, and more across a crease. Normals
   are averaged over neighbors in some rounds beforehand, so that noise makes no creases. */
EXPORT int64_t find_step_lengths(
    int64_t n, int64_t n_faces, const double points[n][3], const int32_t faces[n_faces][3],
    const int32_t neighbors[n_faces][3], int64_t n_rounds, double lengths[n_faces][3])
{
    OPEN_ARENA(arena);
    double (*normals)[3] = smooth_normals(arena, n_faces, points, faces, neighbors, n_rounds);
    double (*centers)[3] = take_zeros(arena, n_faces, sizeof *centers);
    for (int64_t face = 0; face < n_faces; face++) {
        double *normal = normals[face];
        const double square = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2];
        const double length = max_f64(sqrt(square), DBL_MIN);
        for (int i = 0; i < 3; i++) {
            normal[i] /= length;
            for (int corner = 0; corner < 3; corner++)
                centers[face][i] += points[faces[face][corner]][i] / 3.0;
        }
    }
    for (int64_t face = 0; face < n_faces; face++) {
        for (int side = 0; side < 3; side++) {
            const int32_t other = neighbors[face][side];
            double square = 0.0, cosine = 0.0;
            for (int i = 0; other >= 0 && i < 3; i++) {
                const double step = centers[other][i] - centers[face][i];
                square += step * step;
                cosine += normals[face][i] * normals[other][i];
            }
            lengths[face][side] = other < 0 ? 0.0 : sqrt(square) * (1.0 + CREASE * (1.0 - cosine));
        }
    }
    close_arena(arena);
    return 0;
}
