"""Unwrap meshes, bake normal and displacement maps, and preview them.

>>> import texbake
>>> high = texbake.read_mesh("high.ply")  # doctest: +SKIP
>>> low = texbake.unwrap(texbake.simplify(high, 500))  # doctest: +SKIP
>>> texbake.bake(high, low).write("maps/")  # doctest: +SKIP

`__init__.pyi` lists the public names and the modules they come from. Each is loaded when it is
first used, so importing the package costs almost nothing.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
