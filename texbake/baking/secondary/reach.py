"""How far the rays of fans go, in the local frame."""

from __future__ import annotations

from typing import NamedTuple


class Reach(NamedTuple):
    """Lengths in local units.

    Attributes
    ----------
    offset : float
        Rays start so far above or below the surface.
    outer, inner : float
        Length of the rays that go out, which may be infinite, and in; 0: none are cast.
    """

    offset: float
    outer: float
    inner: float
