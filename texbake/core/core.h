/* What every kernel that Python calls needs.

   A function that is marked EXPORT can be called from Python as a method of `core`. The compiled
   library carries the list of their declarations (`compile_core.py` collects it), and
   `binding.py` checks every array by them: its type, its dimensions, that it is contiguous and
   aligned, that sizes of the same name agree, and that what is written to is writable. An array
   that is only read is `const`.

   A size stands before the arrays that have it. Where an array's dimension is the size alone, or
   the size plus or minus a constant, Python does not pass it: it comes from the shape. An array that
   may be left out (None in Python, NULL here) is OPTIONAL, and its sizes are then 0.

   A function that needs memory of its own takes it from an arena (arena.h) and returns int64_t,
   OUT_OF_MEMORY if there is none; Python then raises MemoryError. */

#pragma once

#include <stdbool.h>
#include <stdint.h>

#define EXPORT __attribute__((visibility("default")))
#define OPTIONAL
#define OUT_OF_MEMORY INT64_MIN
