"""What is wrong with texture coordinates, whatever the size of the texture."""

from __future__ import annotations

import numpy as np

from texbake.checks.finding import Finding, found
from texbake.checks.subject import BoolArray, Subject

# What float32 files leave of coordinates on the border of the tile; the same as in a bake.
_ROUNDING = 1e-6


def outside_tile(subject: Subject) -> Finding | None:
    """Find faces that reach outside the unit square; the farthest are the worst."""
    faces = np.flatnonzero(outside(subject))
    ways = np.abs(subject.uvs[faces] - 0.5).max(axis=(1, 2))
    return found("outside-tile", subject.role, len(faces), faces, ways)


def overlapping_coordinates(subject: Subject) -> Finding | None:
    """Find faces that share a part of the texture with another; the largest are the worst."""
    overlaps = subject.overlaps
    faces = np.flatnonzero(overlaps.overlapping & ~subject.shares_texture)
    n_unsure = int(overlaps.unsure.sum())
    unsure = ""
    if n_unsure:
        unsure = f" Of {n_unsure:,} more faces it was not told, for the many faces near them."
    return found(
        "overlapping-coordinates",
        subject.role,
        len(faces),
        faces,
        np.abs(subject.uv_areas[faces]),
        unsure=unsure,
    )


def shared_coordinates(subject: Subject) -> Finding | None:
    """Find faces that share a part of the texture with other groups alone; the largest first."""
    faces = np.flatnonzero(subject.shares_texture)
    areas = np.abs(subject.uv_areas[faces])
    return found("shared-coordinates", subject.role, len(faces), faces, areas)


def mirrored_coordinates(subject: Subject) -> Finding | None:
    """Find faces that run clockwise in the texture; the largest are the worst."""
    faces = np.flatnonzero((subject.uv_areas < 0.0) & subject.has_area)
    return found("mirrored-coordinates", subject.role, len(faces), faces, -subject.uv_areas[faces])


def collapsed_coordinates(subject: Subject) -> Finding | None:
    """Find faces with area in space and none in the texture; the largest are the worst."""
    faces = np.flatnonzero(collapsed(subject))
    return found("collapsed-coordinates", subject.role, len(faces), faces, subject.areas[faces])


def collapsed(subject: Subject) -> BoolArray:
    """(F,) bool: faces with area in space and none in the texture."""
    return np.asarray((subject.uv_areas == 0.0) & subject.has_area)


def outside(subject: Subject) -> BoolArray:
    """(F,) bool: faces that reach outside the unit square."""
    return np.asarray((np.abs(subject.uvs - 0.5) > 0.5 + _ROUNDING).any(axis=(1, 2)))


CHECKS = (
    outside_tile,
    overlapping_coordinates,
    shared_coordinates,
    mirrored_coordinates,
    collapsed_coordinates,
)
