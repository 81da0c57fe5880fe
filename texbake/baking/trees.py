"""The ray trees of a bake: over the dense mesh, and over what hides it where that is more.

A trace opens and closes them itself, unless they are lent to it because others go on to use them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.raycast.scene import RayScene

if TYPE_CHECKING:
    from texbake.baking.distances import Reach


@dataclass(eq=False)
class Trees:
    """Trees that are open, in one frame.

    Attributes
    ----------
    frame : LocalFrame
    caster : RayScene
        Over the dense mesh.
    occluders : Mesh, optional
        What secondary rays meet in place of the dense mesh, all of it in the frame.
    around : RayScene, optional
        Over the occluders.
    """

    frame: LocalFrame
    caster: RayScene
    occluders: Mesh | None = None
    around: RayScene | None = None
    _reaches: dict[tuple[str, ...], Reach] = field(default_factory=dict)

    def reach(self, high: Mesh, low: Mesh, kinds: Sequence[str], threads: int | None) -> Reach:
        """Distances of rays of some kinds, the greatest; measured once for all that are lent to."""
        from texbake.baking.distances import Reach, measure_reach

        key = tuple(kinds)
        if key not in self._reaches:
            found = [
                measure_reach(high, low, self.frame, self.caster, kind, threads) for kind in kinds
            ]
            self._reaches[key] = Reach(
                max(reach.front for reach in found), max(reach.back for reach in found)
            )
        return self._reaches[key]

    def close(self) -> None:
        """Free the tree over the dense mesh; that over the occluders is its owner's."""
        self.caster.close()
