/* Every function that Python calls, and the one table of what each may be given.

   `texbake/core/declarations.py` reads these prototypes when a function is first called, and
   `binding.py` checks every array against them: its type, its dimensions, that it is contiguous and
   aligned, that sizes of the same name agree, and that what is written to is writable. An array
   that is only read is `const`.

   A size stands before the arrays that have it. Where an array's dimension is the size alone, or
   the size plus or minus a constant, Python does not pass it: it comes from the shape. An array that
   may be left out (None in Python, NULL here) is OPTIONAL, and its sizes are then 0.

   A function that needs memory of its own takes it from an arena (arena.h) and returns int64_t,
   OUT_OF_MEMORY if there is none; Python then raises MemoryError. */

#ifndef TEXBAKE_CORE_H
#define TEXBAKE_CORE_H

#include <stdbool.h>
#include <stdint.h>

#define OPTIONAL
#define OUT_OF_MEMORY INT64_MIN

#pragma GCC visibility push(default)

/* processor.c */
bool has_x86_64_v3(void);

/* conjugate_gradient.c */
int64_t solve_blocks(
    int64_t n, int64_t n_entries,
    const int64_t row_starts[n + 1], const int32_t columns[n_entries],
    const double blocks[n_entries][4], const double target[n][2], const double uvs[n][2],
    const int32_t regions[n], double solution[n][2], double tolerance, int64_t n_iterations);

#pragma GCC visibility pop

#endif
