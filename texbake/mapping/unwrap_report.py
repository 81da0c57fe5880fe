"""What an unwrap did, and how good its coordinates are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from texbake.mapping.distortion import Distortion
from texbake.mapping.options import METHOD_OPTIONS, UnwrapOptions
from texbake.mapping.options.transform import TransformOptions
from texbake.progress import StageRecord


@dataclass(frozen=True, kw_only=True)
class UnwrapReport:
    """Figures of one unwrap.

    Attributes
    ----------
    mesh : str
        Its name.
    n_faces : int
    options : UnwrapOptions
        As asked for.
    tallies : dict of str to int
        What was met on the way, by its name, as in "faces at a pole": how many.
    notes : tuple of str
        Steps that failed and what was done instead; charts that miss a bound, and why.
    distortion : Distortion or None
        None where the coordinates leave no face any area.
    stages : list of StageRecord
    """

    mesh: str
    n_faces: int
    options: UnwrapOptions
    tallies: Mapping[str, int]
    notes: tuple[str, ...]
    distortion: Distortion | None
    stages: list[StageRecord]

    @property
    def n_charts(self) -> int:
        """Pieces of the surface that the texture shows."""
        return 0 if self.distortion is None else self.distortion.n_charts

    @property
    def fill(self) -> float:
        """Share of the tiles in use that faces cover; what is covered twice counts twice."""
        return 0.0 if self.distortion is None else self.distortion.packing_efficiency

    @property
    def seconds(self) -> float:
        """Time of all stages."""
        return sum(stage.seconds for stage in self.stages)

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain dicts, lists, numbers and strings."""
        return {
            "mesh": self.mesh,
            "faces": self.n_faces,
            "options": _options_in_use(self.options),
            "charts": self.n_charts,
            "tiles": 0 if self.distortion is None else self.distortion.n_tiles,
            "fill": self.fill,
            "tallies": dict(self.tallies),
            "notes": list(self.notes),
            "distortion": None if self.distortion is None else self.distortion.to_json(),
            "seconds": self.seconds,
            "stages": [asdict(stage) for stage in self.stages],
        }


def _options_in_use(options: UnwrapOptions) -> dict[str, Any]:
    """Fields that the method reads; a function by its name."""
    shared = ("method", "size", "only", *TransformOptions.__dataclass_fields__)
    names = [*shared, *METHOD_OPTIONS[options.method]]
    values = {name: getattr(options, name) for name in names}
    if callable(options.warp):
        values["warp"] = getattr(options.warp, "__name__", "a function")
    return values
