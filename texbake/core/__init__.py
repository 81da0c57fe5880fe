"""The kernels: compiled loops in C17, in a library without any Python in it.

One file holds one algorithm or a few that belong together, and names their sources and the Python
modules that call it. Functions that are marked EXPORT are methods of `core`:

    from texbake.core import core

    n_components = core.number_components(n_vertices, faces, components)

Every array is checked against the C declaration first, so that a wrong call raises an error instead
of reading foreign memory. The functions run without the GIL, so that `run_bands` can run them on
several threads.
"""

from texbake.core.library import core

__all__ = ["core"]
