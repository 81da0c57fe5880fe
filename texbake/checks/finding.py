"""One thing that was found in a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.checks.kind import Kind
from texbake.checks.kinds import KINDS
from texbake.mesh.mesh import IntArray

N_WORST = 10  # faces named


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """What will go wrong, how much of it there is, and where.

    Attributes
    ----------
    kind : Kind
    severity : str
        `error`, `warning` or `note`.
    mesh : str
        `light` or `dense`: the mesh that it is found in.
    count : int
        In units of the kind.
    faces : (n,) int32
        Faces of that mesh where it is, each once, the worst first; empty where it is nowhere in
        particular.
    problem, remedy : str
        What goes wrong, and what to do.
    """

    kind: Kind
    severity: str
    mesh: str
    count: int
    faces: IntArray
    problem: str
    remedy: str

    @property
    def name(self) -> str:
        """Name of its kind."""
        return self.kind.name

    @property
    def counted(self) -> str:
        """The count with its unit."""
        return self.kind.counted(self.count)

    @property
    def worst_faces(self) -> list[int]:
        """The worst ten of its faces."""
        worst: list[int] = self.faces[:N_WORST].tolist()
        return worst

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return {
            "name": self.name,
            "title": self.kind.title,
            "severity": self.severity,
            "mesh": self.mesh,
            "count": self.count,
            "unit": self.kind.unit[1],
            "n_faces": len(self.faces),
            "worst_faces": self.worst_faces,
            "problem": self.problem,
            "remedy": self.remedy,
        }


def found(
    name: str,
    mesh: str,
    count: int,
    faces: npt.NDArray[Any] | None = None,
    badness: npt.NDArray[Any] | None = None,
    **figures: Any,
) -> Finding | None:
    """Make a finding, or None where nothing was counted.

    Parameters
    ----------
    name
        In `KINDS`.
    mesh
        `light` or `dense`.
    count
        In units of the kind.
    faces : (n,) int, optional
        Those concerned, in any order, maybe repeated.
    badness : (n,) float, optional
        Of each of them, greater where it is worse; None where all are alike.
    figures
        Fill the braces of the kind's sentences.
    """
    if not count:
        return None
    kind = KINDS[name]
    severity = kind.light if mesh == "light" else kind.dense
    assert severity is not None, f"{name} is not looked for in a {mesh} mesh"
    return Finding(
        kind=kind,
        severity=severity,
        mesh=mesh,
        count=int(count),
        faces=_worst_first(faces, badness),
        problem=kind.problem.format(**figures),
        remedy=kind.remedy.format(**figures),
    )


def _worst_first(faces: npt.NDArray[Any] | None, badness: npt.NDArray[Any] | None) -> IntArray:
    if faces is None:
        return np.zeros(0, dtype=np.int32)
    if badness is None:
        return np.unique(faces).astype(np.int32)
    # A face stands where it is worst; among equals the lower number comes first.
    ordered = faces[np.lexsort((faces, -badness))]
    _, firsts = np.unique(ordered, return_index=True)
    return np.asarray(ordered[np.sort(firsts)], dtype=np.int32)
