/* Faces divided into parts: every face gets the label of the nearest seed.

   Distances are small whole numbers. Faces that wait are kept in one list for each distance ahead,
   and one list is due at a time, so that no priority queue is needed.

   Based on: Dial, "Algorithm 360: Shortest-Path Forest with Topological Ordering", 1969.

   Called from texbake/mapping/atlas/cutting/parts.py. */

#include "arena.h"
#include "core.h"

/* Labels of faces that await a label; what is neither this nor a label takes none. Python has the
   same number, and the longest step and the distance of faces that nothing reaches. */
static const int32_t OPEN = -1;
static const int32_t FAR = INT32_MAX;
enum { N_SLOTS = 63 + 1 };

/* A face, the label offered to it, and the next row of its list. */
struct offer {
    int32_t face, label, next;
};

struct flood {
    const int32_t (*neighbors)[3];
    const int32_t (*steps)[3];
    const int32_t *within; /* no step crosses from one value to another; NULL: all have the same */
    int32_t *labels;
    int32_t *distances;
    int32_t *sizes;      /* faces of each label */
    struct offer *queue; /* three rows a face, and one a source */
    int64_t most;        /* faces of a label */
};

/* Lists of offers, one for each distance ahead. */
struct offers {
    int32_t heads[N_SLOTS];
    int32_t n_rows;
    int64_t n_waiting;
};

static void add_offer(struct offers *offers, struct offer *queue, int64_t slot, int32_t face, int32_t label)
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
        if (other < 0 || flood->labels[other] != OPEN)
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

static void spread(
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
            if (flood->labels[due.face] != OPEN)
                continue;
            if (flood->sizes[due.label] >= flood->most)
                flood->distances[due.face] = FAR; /* another label may take it */
            else
                settle(flood, &offers, due.face, due.label, distance);
        }
    }
}

/* Label every open face by its nearest source. No label gets more than `most` faces, and no step
   crosses from one value of `within` to another; `steps` are from 1 to 63. */
int64_t flood_faces(
    int64_t n_faces, int64_t n_sources, int64_t n_labels,
    const int32_t neighbors[n_faces][3], const int32_t steps[n_faces][3],
    int32_t labels[n_faces], const int32_t sources[n_sources],
    const int32_t source_labels[n_sources], const int32_t within[n_faces], int64_t most,
    int32_t distances[n_faces])
{
    OPEN_ARENA(arena);
    for (int64_t face = 0; face < n_faces; face++)
        distances[face] = FAR;
    const struct flood flood = {
        neighbors, steps, within, labels, distances, TAKE_ZEROS(arena, int32_t, n_labels),
        TAKE(arena, struct offer, 3 * n_faces + n_sources), most};
    spread(&flood, n_sources, sources, source_labels);
    close_arena(arena);
    return 0;
}

/* Give every open face a new label, in patches of at most `part_faces` faces. */
int64_t seed_faces(
    int64_t n_faces, const int32_t neighbors[n_faces][3], const int32_t steps[n_faces][3],
    int32_t labels[n_faces], int64_t part_faces)
{
    OPEN_ARENA(arena);
    int32_t n_labels = 0;
    int32_t *distances = TAKE(arena, int32_t, n_faces);
    for (int64_t face = 0; face < n_faces; face++) {
        distances[face] = FAR;
        if (labels[face] >= n_labels)
            n_labels = labels[face] + 1;
    }
    const struct flood flood = {
        neighbors, steps, NULL, labels, distances,
        TAKE_ZEROS(arena, int32_t, n_labels + n_faces),
        TAKE(arena, struct offer, 3 * n_faces + 1), part_faces};
    for (int32_t face = 0; face < n_faces; face++) {
        if (labels[face] == OPEN) {
            spread(&flood, 1, &face, &n_labels);
            n_labels++;
        }
    }
    close_arena(arena);
    return 0;
}

/* Give every face that borders its own part on one side only to the part on the other two. Without
   such teeth, borders are less likely to overlap when the parts are flattened. */
void trim_teeth(int64_t n_faces, const int32_t neighbors[n_faces][3], int32_t labels[n_faces])
{
    for (int round = 0; round < 2; round++) {
        for (int64_t face = 0; face < n_faces; face++) {
            const int32_t one = neighbors[face][0], two = neighbors[face][1];
            const int32_t three = neighbors[face][2];
            if (one < 0 || two < 0 || three < 0)
                continue;
            if (labels[one] == labels[two] || labels[one] == labels[three])
                labels[face] = labels[one];
            else if (labels[two] == labels[three])
                labels[face] = labels[two];
        }
    }
}
