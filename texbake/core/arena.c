/* The arena of arena.h: a list of blocks, each of one `malloc`. */

#include "arena.h"

#include <stdlib.h>
#include <string.h>

enum { ALIGNMENT = 64 };

struct block {
    struct block *older;
};

struct arena *new_arena(void)
{
    struct arena *arena = malloc(sizeof *arena);
    if (arena)
        arena->newest = NULL;
    return arena;
}

arena_mark mark_arena(const struct arena *arena)
{
    return arena->newest;
}

void reset_arena(struct arena *arena, arena_mark mark)
{
    while (arena->newest != mark) {
        struct block *block = arena->newest;
        arena->newest = block->older;
        free(block);
    }
}

void close_arena(struct arena *arena)
{
    reset_arena(arena, NULL);
    free(arena);
}

static void *take_block(struct arena *arena, int64_t count, size_t size, void *(*get)(size_t, size_t))
{
    /* The header, and what aligning may skip. */
    const size_t extra = sizeof(struct block) + ALIGNMENT;
    if (count < 0 || (uint64_t)count > (SIZE_MAX / 2 - extra) / size)
        longjmp(arena->out_of_memory, 1);
    struct block *block = get(extra + (size_t)count * size, 1);
    if (!block)
        longjmp(arena->out_of_memory, 1);
    block->older = arena->newest;
    arena->newest = block;
    const uintptr_t first = (uintptr_t)(block + 1);
    return (void *)((first + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT);
}

static void *get_memory(size_t n_bytes, size_t one)
{
    return malloc(n_bytes * one);
}

void *take(struct arena *arena, int64_t count, size_t size)
{
    return take_block(arena, count, size, get_memory);
}

void *take_zeros(struct arena *arena, int64_t count, size_t size)
{
    return take_block(arena, count, size, calloc);
}
