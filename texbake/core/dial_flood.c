/* Faces divided into parts: every face gets the label of the nearest seed.

   Distances are small whole numbers. Faces that wait are kept in one list for each distance ahead,
   and one list is due at a time, so that no priority queue is needed.

   Based on: Dial, "Algorithm 360: Shortest-Path Forest with Topological Ordering", 1969.

   Called from face_parts.c. */

#include "parts.h"

enum { N_SLOTS = LONGEST_STEP + 1 };

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

void flood_from(
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
