"""A mesh with its faces turned outwards, and a sentence that says what was turned."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.mesh.compose import turned_over
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.raycast.outside import find_orientation, share_seen_from_behind
from texbake.raycast.scene import RayScene


@dataclass(frozen=True, kw_only=True)
class OrientationReport:
    """What `oriented` did.

    Attributes
    ----------
    mesh : str
        Name of the mesh.
    n_parts, n_faces : int
        Parts that faced inwards as a whole, and faces that were flipped.
    n_unclear : int
        Parts that are seen alike from both sides, and were left as they are.
    """

    mesh: str
    n_parts: int = 0
    n_faces: int = 0
    n_unclear: int = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        notes = []
        if self.n_faces:
            notes.append(
                f"{self.mesh}: flipped {self.n_faces:,} triangles, which faced inwards; "
                "`orientation` keep leaves them as they are"
            )
        if self.n_unclear:
            notes.append(
                f"{self.mesh}: which side is outside is not clear for {self.n_unclear:,} of its "
                "parts, which are left as they are; look at them, and flip them if need be"
            )
        return tuple(notes)


def oriented(
    mesh: Mesh, orientation: str, *, keep_open: bool = False, threads: int | None = None
) -> tuple[Mesh, OrientationReport]:
    """Flip the parts of a mesh that face inwards.

    A mesh of which nothing is seen from behind is returned as it is.
    """
    if orientation == "keep" or mesh.n_faces == 0 or not mesh.diagonal > 0.0:
        return mesh, OrientationReport(mesh=mesh.name)
    scene = RayScene.build(mesh, LocalFrame.around(mesh), threads=threads)
    if share_seen_from_behind(scene) == 0.0:
        return mesh, OrientationReport(mesh=mesh.name)
    return oriented_in(mesh, scene, keep_open=keep_open)


def oriented_in(
    mesh: Mesh, scene: RayScene, *, keep_open: bool = False
) -> tuple[Mesh, OrientationReport]:
    """Flip the parts of a mesh that face inwards, using a scene of it that was built before."""
    found = find_orientation(mesh, scene, keep_open=keep_open)
    report = OrientationReport(
        mesh=mesh.name,
        n_parts=found.n_turned,
        n_faces=found.n_faces,
        n_unclear=len(found.unclear),
    )
    return turned_over(mesh, found.turned), report
