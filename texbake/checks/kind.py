"""What one kind of finding is."""

from __future__ import annotations

from dataclasses import dataclass

FACES = ("face", "faces")
EDGES = ("edge", "edges")
VERTICES = ("vertex", "vertices")
CHARTS = ("chart", "charts")
MESHES = ("mesh", "meshes")


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of finding.

    Attributes
    ----------
    name : str
        For scripts.
    title : str
        For people.
    unit : (str, str)
        What is counted: one of it, and several.
    light, dense : str or None
        Severity in a light mesh and in a dense one; None where it is not looked for.
    problem : str
        What goes wrong. Figures in braces are filled in by the check.
    remedy : str
        What to do.
    """

    name: str
    title: str
    unit: tuple[str, str] = FACES
    light: str | None = None
    dense: str | None = None
    problem: str
    remedy: str

    def counted(self, count: int) -> str:
        """Write a count with its unit, as in `2 faces`."""
        return f"{count:,} {self.unit[count != 1]}"
