"""The report of a check: its findings for a reader, a script and a build."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.checks.finding import Finding
from texbake.checks.kinds import SEVERITIES, CheckOptions
from texbake.errors import OptionError
from texbake.mapping.corner_uvs import has_measurable_uvs
from texbake.mesh.mesh import Mesh
from texbake.progress import StageRecord


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckReport:
    """Everything that a check found."""

    low: Mesh | None  # the meshes that were checked
    high: Mesh | None
    options: CheckOptions
    findings: tuple[Finding, ...]  # the most severe first, then those that are allowed
    stages: list[StageRecord]

    def count(self, severity: str) -> int:
        """Return how many findings have a severity and are not allowed."""
        return sum(
            finding.severity == severity and not finding.allowed for finding in self.findings
        )

    @property
    def n_allowed(self) -> int:
        """How many findings the options accept."""
        return sum(finding.allowed for finding in self.findings)

    def fails(self, severity: str = "error") -> bool:
        """Whether any finding that is not allowed is as severe as this, or more severe."""
        if severity not in SEVERITIES:
            raise OptionError(f"severity: {severity} is not one of {', '.join(SEVERITIES)}")
        return any(self.count(known) for known in SEVERITIES[: SEVERITIES.index(severity) + 1])

    def finding(self, name: str) -> Finding | None:
        """Return the first finding of a kind, or None."""
        return next((finding for finding in self.findings if finding.name == name), None)

    @property
    def has_layout(self) -> bool:
        """Whether the low-poly mesh has texture coordinates that can be drawn."""
        low = self.low
        return low is not None and low.uvs is not None and has_measurable_uvs(low)

    @property
    def seconds(self) -> float:
        """Time that all stages took."""
        return sum(stage.seconds for stage in self.stages)

    def to_json(self) -> dict[str, Any]:
        """Return all of it as plain values, for `json.dump`."""
        return {
            **{
                role: None if mesh is None else {"name": mesh.name, "n_faces": mesh.n_faces}
                for role, mesh in (("low", self.low), ("high", self.high))
            },
            "options": asdict(self.options),
            "n_errors": self.count("error"),
            "n_warnings": self.count("warning"),
            "n_notes": self.count("note"),
            "n_allowed": self.n_allowed,
            "findings": [finding.to_json() for finding in self.findings],
            "stages": [asdict(stage) for stage in self.stages],
        }

    def picture(self, size: int = 640) -> npt.NDArray[np.float32]:
        """Draw where in the texture the findings are: one UV layout for each.

        `size`: pixels along the longer side of one layout. Returns (H, W, 3) float32, linear. Faces
        are colored by severity, red, amber or blue; the worst have a ring.
        """
        from texbake.checks.picture import draw_findings

        return draw_findings(self, size)
