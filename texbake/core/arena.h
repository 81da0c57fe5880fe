/* Memory of a kernel: taken piece by piece, and given back all at once.

   A function that Python calls opens an arena, takes arrays from it, and closes it. If memory runs
   out, `take` does not return: the function returns OUT_OF_MEMORY, and everything taken is given
   back. So a kernel needs no test after each array.

       int64_t sort_something(int64_t n, double values[n])
       {
           OPEN_ARENA(arena);
           double *copies = TAKE(arena, double, n);
           ...
           close_arena(arena);
           return 0;
       } */

#pragma once

#include <setjmp.h>
#include <stddef.h>
#include <stdint.h>

struct arena {
    struct block *newest;
    jmp_buf out_of_memory;
};

/* A point in an arena to go back to. Memory taken after it is then given back. */
typedef struct block *arena_mark;

struct arena *new_arena(void);
void close_arena(struct arena *arena);

/* Memory for `count` items of `size` bytes, aligned to 64 bytes; never NULL, even for 0 items. The
   second is filled with zeros. */
void *take(struct arena *arena, int64_t count, size_t size);
void *take_zeros(struct arena *arena, int64_t count, size_t size);

arena_mark mark_arena(const struct arena *arena);
void reset_arena(struct arena *arena, arena_mark mark);

#define TAKE(arena, type, count) ((type *)take(arena, count, sizeof(type)))
#define TAKE_ZEROS(arena, type, count) ((type *)take_zeros(arena, count, sizeof(type)))

/* Declares `arena`; variables changed after this line must not be read once memory has run out. */
#define OPEN_ARENA(arena)                     \
    struct arena *const arena = new_arena();  \
    if (!arena)                               \
        return OUT_OF_MEMORY;                 \
    if (setjmp(arena->out_of_memory)) {       \
        close_arena(arena);                   \
        return OUT_OF_MEMORY;                 \
    }
