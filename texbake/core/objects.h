/* Objects of a world, whose triangles stand in one list, object after object. */

#ifndef TEXBAKE_OBJECTS_H
#define TEXBAKE_OBJECTS_H

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

#endif
