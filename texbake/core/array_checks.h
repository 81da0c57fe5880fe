/* How the memory of NumPy's arrays is laid out, and the checks of an array before a kernel gets it.

   The layout is part of NumPy's interface for C (`PyArrayObject_fields` in `ndarraytypes.h`), which
   compiled extensions rely on; no header and no function of Python or NumPy is used. How long the
   head of an object is, and the addresses and numbers of types, come from Python when the core is
   loaded (`texbake/core/binding.py`).

   Called from the functions that `texbake/core/checks.py` writes, `checked_<name>` for each function
   of `core.h`. They hold no lock; the arrays are kept alive by the call. */

#ifndef TEXBAKE_ARRAY_CHECKS_H
#define TEXBAKE_ARRAY_CHECKS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What a checked function returns instead of calling the kernel. */
#define REFUSED (INT64_MIN + 1)

/* In the order of `DTYPES` in `texbake/core/declarations.py`. */
enum dtype {
    BOOL, UINT8, INT8, UINT16, INT16, UINT32, INT32, UINT64, INT64, UINTP, FLOAT32, FLOAT64, N_DTYPES
};

struct layout {
    int64_t head;           /* bytes of an object's head, which ends with the address of its type */
    const void *array_type; /* of arrays themselves, not of what is derived from them */
    const void *none;
    int32_t type_numbers[N_DTYPES];
};

struct type_fields {
    const void *type_object;
    char kind, type, byte_order, flags;
    int type_number;
};

struct array_fields {
    void *data;
    int rank;
    const intptr_t *shape, *strides;
    const void *base;
    const char *type; /* an object: a head, then `type_fields` */
    int flags;
};

enum { CONTIGUOUS = 0x1, ALIGNED = 0x100, WRITEABLE = 0x400 }; /* NPY_ARRAY_... */

static struct layout layout;

static inline const struct array_fields *fields_of(const void *object)
{
    return (const struct array_fields *)((const char *)object + layout.head);
}

/* Whether an object is an array of a type and rank, contiguous and aligned, and writable if it must
   be. */
static bool is_array(const void *object, enum dtype dtype, int rank, bool written)
{
    if (((const void *const *)fields_of(object))[-1] != layout.array_type)
        return false;
    const struct array_fields *array = fields_of(object);
    const struct type_fields *type = (const struct type_fields *)(array->type + layout.head);
    const int wanted = CONTIGUOUS | ALIGNED | (written ? WRITEABLE : 0);
    return array->rank == rank && (array->flags & wanted) == wanted
           && type->type_number == layout.type_numbers[dtype]
           && (type->byte_order == '=' || type->byte_order == '|');
}

/* What the checked functions call; in capitals, which no parameter of a kernel has. */
#define IS_NONE(object) ((object) == layout.none)
#define IS_ARRAY(object, dtype, rank, written) is_array(object, dtype, rank, written)
#define LENGTH(object, axis) (fields_of(object)->shape[axis])
#define DATA(object) (fields_of(object)->data)
/* Sizes are multiplied in more bits than they have, so that no product of two overflows. */
#define WIDE (__int128)

#endif
