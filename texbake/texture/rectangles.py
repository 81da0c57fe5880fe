"""Rectangles placed in a larger one without overlap, upright and at whole texels.

Charts of atlases are placed by `texbake.mapping.atlas.packing`, which turns them and rounds their
places to cells; images that are to be copied texel by texel need neither.

Based on: Huang, Korf, "Optimal rectangle packing: an absolute placement approach", 2013, for trying
several sizes of the bin; Jylänki, "A thousand ways to pack the bin", 2010, for the maximal free
rectangles and the rule of the best short side.
"""

from __future__ import annotations

from collections.abc import Sequence

Size = tuple[int, int]
# Left, top, right and bottom.
_Free = tuple[int, int, int, int]


def place_rectangles(sizes: Sequence[Size], width: int, height: int) -> list[Size] | None:
    """Place rectangles, large ones first, each where it fits a free rectangle best.

    Parameters
    ----------
    sizes : sequence of (width, height)
    width, height
        Of what they are placed in.

    Returns
    -------
    list of (left, top), or None
        In the order of `sizes`; None if there is no room in some order that was tried.

    Examples
    --------
    >>> place_rectangles([(2, 1), (2, 3), (1, 1)], 4, 3)
    [(2, 0), (0, 0), (2, 1)]
    """
    if sum(w * h for w, h in sizes) > width * height:
        return None
    keys = (
        lambda i: (-max(sizes[i]), -min(sizes[i]), i),
        lambda i: (-sizes[i][1], -sizes[i][0], i),
        lambda i: (-sizes[i][0], -sizes[i][1], i),
        lambda i: (-sizes[i][0] * sizes[i][1], i),
    )
    for key in keys:
        places = _placed_in_order(sizes, sorted(range(len(sizes)), key=key), width, height)
        if places is not None:
            return places
    return None


def _placed_in_order(
    sizes: Sequence[Size], order: Sequence[int], width: int, height: int
) -> list[Size] | None:
    free: list[_Free] = [(0, 0, width, height)]
    places: list[Size] = [(0, 0)] * len(sizes)
    for i in order:
        w, h = sizes[i]
        fits = [
            (min(right - left - w, bottom - top - h), top, left)
            for left, top, right, bottom in free
            if right - left >= w and bottom - top >= h
        ]
        if not fits:
            return None
        _, top, left = min(fits)
        places[i] = left, top
        free = _without(free, (left, top, left + w, top + h))
    return places


def _without(free: list[_Free], taken: _Free) -> list[_Free]:
    """Return the maximal free rectangles that are left when one is taken."""
    left, top, right, bottom = taken
    rest: list[_Free] = []
    for one in free:
        if left >= one[2] or right <= one[0] or top >= one[3] or bottom <= one[1]:
            rest.append(one)
            continue
        parts = (
            (one[0], one[1], left, one[3]),
            (right, one[1], one[2], one[3]),
            (one[0], one[1], one[2], top),
            (one[0], bottom, one[2], one[3]),
        )
        rest += [part for part in parts if part[0] < part[2] and part[1] < part[3]]
    rest = list(dict.fromkeys(rest))
    return [one for one in rest if not any(_holds(other, one) for other in rest if other != one)]


def _holds(outer: _Free, inner: _Free) -> bool:
    return (
        outer[0] <= inner[0]
        and outer[1] <= inner[1]
        and outer[2] >= inner[2]
        and outer[3] >= inner[3]
    )
