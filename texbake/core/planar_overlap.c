/* Triangles in the plane that overlap others.

   Two triangles do not overlap if the line through an edge of one of them separates them. Which
   pairs to test comes from a tree of bounding boxes.

   Based on: Gottschalk, Lin, Manocha, "OBBTree: A Hierarchical Structure for Rapid Interference
   Detection", 1996 (the separating axis theorem); Kamel, Faloutsos, "On Packing R-trees", 1993.

   Called from texbake/mapping/overlap.py. */

#include "arena.h"
#include "core.h"

/* Children of a box; Python has the same number. 64 levels are more than any mesh has. */
enum { FAN_OUT = 8, STACK_SIZE = FAN_OUT * 64 };

struct layout {
    const double (*corners)[3][2];
    const double (*lines)[3][3];
    double depth;
};

/* Whether the line through an edge of `one` has `other` on its outer side. */
static inline bool is_parted_by(const struct layout *layout, int64_t one, int64_t other)
{
    const double (*corner)[2] = layout->corners[other];
    for (int edge = 0; edge < 3; edge++) {
        const double *line = layout->lines[one][edge];
        const double a = line[0], b = line[1], c = line[2];
        if (a * corner[0][0] + b * corner[0][1] + c <= layout->depth
            && a * corner[1][0] + b * corner[1][1] + c <= layout->depth
            && a * corner[2][0] + b * corner[2][1] + c <= layout->depth)
            return true;
    }
    return false;
}

/* A box: least s, t and chart, then the greatest. */
static inline bool boxes_meet(const double box[6], const double window[6])
{
    return box[0] < window[3] && box[3] > window[0] && box[1] < window[4] && box[4] > window[1]
        && box[2] <= window[2] && box[5] >= window[2];
}

/* Find the faces that overlap others, for the faces at some places of the order.

   Without `layers`, one overlap is enough. With it, every overlapping face of a lower number is
   found, and the face takes the lowest layer that those leave free. A face that was compared with
   `most` others, none of which overlaps it, is `unsure`. The rows of `boxes` are those of the faces
   in order, then those around `children`, up to the box of everything. */
int64_t find_planar_overlaps(
    int64_t n_faces, int64_t n_solid, int64_t n_boxes, int64_t n_places,
    const double corners[n_faces][3][2], const double lines[n_faces][3][3],
    const int64_t order[n_solid], const double boxes[n_boxes][6],
    const int64_t children[n_boxes][2], double depth, int64_t most,
    const int64_t places[n_places], bool found[n_faces], bool unsure[n_faces],
    OPTIONAL int32_t layers[n_faces])
{
    OPEN_ARENA(arena);
    const struct layout layout = {corners, lines, depth};
    int64_t stack[STACK_SIZE];
    /* For each layer, the last face that found it taken. */
    int64_t *taken = TAKE(arena, int64_t, layers ? n_faces + 1 : 0);
    for (int64_t layer = 0; layers && layer <= n_faces; layer++)
        taken[layer] = -1;
    for (int64_t at = 0; at < n_places; at++) {
        const int64_t place = places[at], face = order[place];
        const double *box = boxes[place];
        const double window[6] = {
            box[0] + depth, box[1] + depth, box[2], box[3] - depth, box[4] - depth, box[2]};
        int64_t n_waiting = 1, n_pairs = 0;
        stack[0] = n_boxes - 1;
        while (n_waiting > 0) {
            const int64_t row = stack[--n_waiting];
            for (int64_t child = children[row][0]; child < children[row][1]; child++)
                if (boxes_meet(boxes[child], window))
                    stack[n_waiting++] = child;
            if (row >= n_solid || row == place || (layers && order[row] > face))
                continue;
            if (n_pairs++ == most) {
                unsure[face] = true;
                break;
            }
            if (is_parted_by(&layout, face, order[row]) || is_parted_by(&layout, order[row], face))
                continue;
            found[face] = true;
            if (!layers)
                break;
            taken[layers[order[row]]] = face;
        }
        while (layers && taken[layers[face]] == face)
            layers[face]++;
    }
    close_arena(arena);
    return 0;
}
