"""Maps that a page shows of any bake, made along with those that were asked for."""

from __future__ import annotations

from dataclasses import replace

from texbake.baking.options import BakeOptions
from texbake.baking.result import BakeResult

# What a page shows of any bake: the view needs normals, the histogram needs heights.
PAGE_MAPS = ("normal", "displacement")


def page_options(options: BakeOptions) -> BakeOptions:
    """Return options of a bake that makes what a page shows as well, and changes no byte else.

    Where samples follow errors or a time, another map would move them, and none is added.
    """
    if options.is_adaptive or options.time_budget is not None:
        return options
    return replace(options, maps=tuple(dict.fromkeys((*options.maps, *PAGE_MAPS))))


def as_asked(baked: BakeResult, options: BakeOptions) -> BakeResult:
    """Return what a bake with `page_options(options)` gave as if it were one with `options`."""
    maps = {name: made for name, made in baked.maps.items() if name in options.maps}
    return replace(baked, maps=maps, report=replace(baked.report, options=options))
