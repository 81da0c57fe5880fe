"""All effects, in the order in which they are computed.

To add an effect, write its functions and one `Effect` (`texbake.rendering.effect`) in the module of
its subject here, or in a new one. `EFFECTS` finds it there, and puts it `after` the one it names.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules

from texbake.rendering.effect import Effect


def in_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return effects, each behind the one that it names, those of one `after` by name."""
    followers: dict[str, list[Effect]] = {}
    for effect in sorted(effects, key=lambda each: each.name, reverse=True):
        followers.setdefault(effect.after, []).append(effect)
    ordered: list[Effect] = []
    waiting = followers.pop("")
    while waiting:
        ordered.append(waiting.pop())
        waiting += followers.pop(ordered[-1].name, [])
    assert not followers, f"no effect is named {', '.join(followers)}"
    return tuple(ordered)


_MODULES = [import_module(f"{__name__}.{item.name}") for item in iter_modules(__path__)]
EFFECTS = in_order(
    thing for module in _MODULES for thing in vars(module).values() if isinstance(thing, Effect)
)
