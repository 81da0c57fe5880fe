"""The kernels: compiled loops in C17, in a library without any Python in it.

One file holds one algorithm, and names its source and the Python module that calls it. `core.h` is
the table of all functions, and says what each may be given. Python calls them as methods of `core`:

    from texbake.core import core

    core.solve_blocks(row_starts, columns, blocks, target, uvs, regions, solution, 1e-9, 1000)

Every array is checked against the table first, so that a wrong call raises an error instead of
reading foreign memory. The functions run without the GIL, so that `run_bands` can run them on
several threads.
"""

from texbake.core.library import core

__all__ = ["core"]
