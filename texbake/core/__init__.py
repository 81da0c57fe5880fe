"""The kernels: compiled loops in C17, in a library without any Python in it.

One file holds one algorithm, and names its source and the Python module that calls it. Functions
that are marked EXPORT are methods of `core`:

    from texbake.core import core

    core.solve_blocks(row_starts, columns, blocks, target, uvs, regions, solution, 1e-9, 1000)

Every array is checked against the C declaration first, so that a wrong call raises an error instead
of reading foreign memory. The functions run without the GIL, so that `run_bands` can run them on
several threads.
"""

from texbake.core.library import core

__all__ = ["core"]
