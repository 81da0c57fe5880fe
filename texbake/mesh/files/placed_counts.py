"""How much a file places whose nodes place other nodes, counted before any of them is placed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

Node = TypeVar("Node", int, str)

# Counts stop here: each level of nodes could add digits, up to gigabytes of them.
_COUNTLESS = 10**12


class Placed(NamedTuple):
    """What nodes place, each as often as it is placed, up to 10^12 by each of them.

    Attributes
    ----------
    levels : int
        From a root to the last of those below it; 10^12 or more in a circle.
    """

    nodes: int
    triangles: int
    levels: int


def about(number: int) -> str:
    """Return a count in words, where it may have stopped at 10^12."""
    return f"{number:,}" if number < _COUNTLESS else f"at least {_COUNTLESS:,}"


def count_placed(
    roots: Sequence[Node], below: Callable[[Node], list[Node]], own: Callable[[Node], int]
) -> Placed:
    """Count what nodes place, in time that grows with the number of nodes and their links."""
    totals: dict[Node, Placed] = {}
    open_nodes: set[Node] = set()
    waiting = list(roots)
    while waiting:
        node = waiting[-1]
        if node in totals:  # many nodes may place it
            waiting.pop()
            continue
        placed = below(node)
        later = [other for other in placed if other not in totals and other not in open_nodes]
        if node not in open_nodes and later:
            open_nodes.add(node)
            waiting += later
            continue
        waiting.pop()
        open_nodes.discard(node)
        circle = Placed(0, 0, _COUNTLESS)  # a node that is open still is around this one
        known = [totals.get(other, circle) for other in placed]
        totals[node] = Placed(
            min(1 + sum(each.nodes for each in known), _COUNTLESS),
            min(own(node) + sum(each.triangles for each in known), _COUNTLESS),
            1 + max((each.levels for each in known), default=0),
        )
    found = [totals[node] for node in roots]
    return Placed(
        sum(each.nodes for each in found),
        sum(each.triangles for each in found),
        max((each.levels for each in found), default=0),
    )
