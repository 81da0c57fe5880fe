"""What a check reports: the kinds of findings, and one finding in one mesh.

`kinds.KINDS` lists every kind there is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from texbake.mesh.mesh import IntArray

FACES = ("face", "faces")
EDGES = ("edge", "edges")
VERTICES = ("vertex", "vertices")
CHARTS = ("chart", "charts")
MESHES = ("mesh", "meshes")


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of problem that a check can find."""

    name: str  # its identifier, for scripts
    title: str  # what a reader sees
    unit: tuple[str, str] = FACES  # what is counted, in the singular and the plural
    severity: str  # `error`, `warning` or `note`
    in_high: str | None = None  # severity in a high-poly mesh, where it is another
    # What goes wrong. The check fills in the figures in braces.
    problem: str
    remedy: str  # what to do

    def counted(self, count: int) -> str:
        """Return a count with its unit, such as `2 faces`."""
        return f"{count:,} {self.unit[count != 1]}"


N_WORST = 10  # faces that a report names


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """A problem in one mesh: what it is, how often it occurs, and where."""

    kind: Kind
    severity: str  # `error`, `warning` or `note`
    mesh: str  # `low` or `high`: the mesh that has it
    count: int  # how often it occurs, in the unit of the kind
    # (n,) int32: triangles of that mesh that have it, each once, the worst first; empty where the
    # problem concerns the mesh as a whole
    faces: IntArray
    polygons: IntArray  # (n,) int32: polygons of these, each once, the worst first
    problem: str  # what goes wrong, and what to do about it
    remedy: str
    # whether the options accept its kind, so that it counts and fails nothing
    allowed: bool = False

    @property
    def name(self) -> str:
        """Identifier of its kind."""
        return self.kind.name

    @property
    def counted(self) -> str:
        """The count with its unit."""
        return self.kind.counted(self.count)

    @property
    def worst_faces(self) -> list[int]:
        """Its ten worst faces, counted as in the file."""
        worst: list[int] = self.polygons[:N_WORST].tolist()
        return worst

    def to_json(self) -> dict[str, Any]:
        """Return all of it as plain values."""
        return {
            "name": self.name,
            "title": self.kind.title,
            "severity": self.severity,
            "allowed": self.allowed,
            "mesh": self.mesh,
            "count": self.count,
            "unit": self.kind.unit[1],
            "n_faces": len(self.polygons),
            "worst_faces": self.worst_faces,
            "problem": self.problem,
            "remedy": self.remedy,
        }
