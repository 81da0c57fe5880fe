/* Which object a face of the world belongs to: for the rasterizers and what reads their buffers. */

#ifndef TEXBAKE_OBJECT_OF_FACE_H
#define TEXBAKE_OBJECT_OF_FACE_H

#include <stdint.h>

/* Faces of object k are at starts[k] to starts[k + 1]; objects may have none. */
static inline int64_t object_of_face(int64_t face, int64_t n_objects, const int64_t *starts)
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
