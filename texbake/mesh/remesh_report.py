"""What a run of `remesh` did, and what the user should know about it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from texbake.mesh.distance import OneSidedDistance

_AREA_KEPT = 0.02  # change of a sheet's area that is not worth a note


@dataclass(frozen=True, kw_only=True)
class RemeshReport:
    """Figures of a run of `remesh`."""

    n_faces_before: int
    n_faces: int
    n_vertices: int
    n_components: int  # separate parts of the result, and those that `components` left out
    n_dropped: int
    n_crumbs: int  # separate parts smaller than a voxel, which are left out
    n_cut_off: int  # small parts that were cut off at thin places of the mesh, which are left out
    # walls of cavities in the result; closed rooms of several voxels in the solid, wider than the
    # gaps that are closed
    n_cavities_kept: int
    n_cavities_filled: int
    # Such rooms that were too small and too many to test whether they are cavities. They count as
    # solid.
    n_rooms_untested: int
    voxel: float  # side of a voxel, in model units
    gap: float  # gaps up to this width are closed, in model units
    surface: str  # what the result is, `closed` or `open`
    reason: str  # why it is that, as the end of a sentence
    # loops of the mesh's boundary that were filled, and loops of the boundary of an open result
    n_holes_filled: int
    n_boundaries: int
    # handles of a closed result that the mesh, if it is one part, does not have
    n_handles_made: int
    # area of an open result, as a share of that of the mesh and what fills its holes
    area_ratio: float
    # share of the wrap's vertices, before it is simplified, that lie around sheets
    thin_share: float
    # From the result to the given mesh. It includes the surfaces that close gaps.
    distance: OneSidedDistance
    diagonal: float  # of the given mesh
    seconds: float  # without measuring the distance

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user."""
        notes = []
        if self.n_crumbs:
            notes.append(
                f"separate parts smaller than a voxel are left out: {self.n_crumbs:,}; a greater "
                "`resolution` keeps more"
            )
        if self.n_cut_off:
            notes.append(
                "small parts that were cut off at thin places of the mesh are left out: "
                f"{self.n_cut_off:,}; another `resolution` may keep them"
            )
        if self.n_dropped:
            notes.append(
                f"{self.n_dropped:,} smaller separate parts were dropped; `components` keeps them"
            )
        if self.n_rooms_untested:
            notes.append(
                "the smallest rooms inside were not tested for being cavities, and count as "
                f"solid: {self.n_rooms_untested:,}; a lower `resolution` leaves fewer"
            )
        if self.n_handles_made:
            notes.append(
                "closing gaps made handles that the mesh does not have: "
                f"{self.n_handles_made:,}; a smaller `close` or a greater `resolution` makes fewer"
            )
        if abs(self.area_ratio - 1.0) > _AREA_KEPT:
            notes.append(
                f"the sheet has {100.0 * self.area_ratio:.0f} % of the mesh's area; a greater "
                "`resolution` keeps more of its detail"
            )
        return (*notes, *self.distance.notes)

    def to_json(self) -> dict[str, Any]:
        """Return every figure as plain values, for `json.dump`."""
        return asdict(self)
