/* Objects of a world, whose triangles stand in one list, object after object. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

/* Index of the object that a face belongs to; its faces are at starts[k] to starts[k + 1]. */
static inline int64_t object_of(int64_t face, int64_t n_objects, const int64_t *starts)
{
    int64_t low = 0, high = n_objects;
    while (high - low > 1) {
        const int64_t middle = (low + high) / 2;
        if (starts[middle] <= face)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* The same, with a guess: faces that follow each other mostly belong to one object. */
static inline int64_t object_near(
    int64_t guess, int64_t face, int64_t n_objects, const int64_t *starts)
{
    const bool is_right = starts[guess] <= face && face < starts[guess + 1];
    return is_right ? guess : object_of(face, n_objects, starts);
}
