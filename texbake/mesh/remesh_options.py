"""Every option of `remesh`, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from texbake.errors import OptionError
from texbake.mesh.options import length_of
from texbake.mesh.simplify_options import MIN_FACES, SimplifyOptions
from texbake.schema import CheckedOptions, Option, option

MIN_RESOLUTION: Final = 8
MAX_RESOLUTION: Final = 1024

ALL, LARGEST = "all", "largest"
AUTO, CLOSED, OPEN = "auto", "closed", "open"

REMESH_CHOICES: Final = ("auto", "always", "never")
DEFAULT_REMESH: Final = "auto"

REMESH_OPTION = Option(
    "Make the low-poly mesh from a closed surface around the high-poly mesh: always, never, or "
    "where that has an inside or is torn, and is not an open surface (auto).",
    choices=REMESH_CHOICES,
)


@dataclass(frozen=True, kw_only=True)
class RemeshOptions(CheckedOptions):
    """How finely a mesh is wrapped, and which gaps are closed."""

    surface: Annotated[
        str,
        Option(
            "Make a closed surface, with all holes filled (closed); an open surface of one sheet, "
            "which keeps its boundary (open); or the one that fits the mesh (auto).",
            choices=(AUTO, CLOSED, OPEN),
        ),
    ] = AUTO

    resolution: Annotated[
        int,
        Option(
            "Voxels along the longest side of the mesh.",
            metavar="N",
            low=MIN_RESOLUTION,
            high=MAX_RESOLUTION,
        ),
    ] = 256
    close: Annotated[
        str | float,
        Option(
            "Close gaps up to this width: 0.02 (model units) or 1% (of the diagonal). Gaps of less "
            "than two voxels are closed in any case. Holes of an open surface up to this width are "
            "filled.",
            metavar="D",
        ),
    ] = "1%"
    keep_interior: Annotated[
        bool,
        Option(
            "Keep cavities that are wider than the gaps that are closed, instead of filling them. "
            "The faces of the mesh must agree about which side is out."
        ),
    ] = False
    sharp_edges: Annotated[
        bool,
        Option(
            "Keep corners and edges sharp where the faces of the mesh meet at more than 30 "
            "degrees. Without it, they are rounded by up to a voxel."
        ),
    ] = False
    components: Annotated[
        int | str,
        Option(
            "Which separate parts of the result to keep: all, the largest, or the N largest by "
            "volume.",
            choices=(ALL, LARGEST),
            metavar="N",
            low=1,
        ),
    ] = ALL
    n_faces: Annotated[
        int | None,
        Option(
            "Number of triangles to simplify the result to.",
            metavar="N",
            low=MIN_FACES,
            flag="--faces",
            default="not simplified",
        ),
    ] = None
    quality: Annotated[str, option(SimplifyOptions, "quality")] = SimplifyOptions.quality

    def __post_init__(self) -> None:
        super().__post_init__()
        self.gap(1.0)
        if self.surface == OPEN and self.keep_interior:
            raise OptionError("keep_interior: an open surface has no interior; leave it out")

    def gap(self, diagonal: float) -> float:
        """Return the width of the gaps to close, in the units of the diagonal.

        Examples
        --------
        >>> RemeshOptions(close="2%").gap(50.0)
        1.0
        """
        return length_of("close", "a width", self.close, diagonal)

    @property
    def n_components(self) -> int | None:
        """How many of the largest parts are kept; None for all."""
        if isinstance(self.components, int):
            return self.components
        return 1 if self.components == LARGEST else None
