"""Charts cut by xatlas, in processes of its own; where it fails, charts cut by face normals.

xatlas compares areas and lengths with absolute thresholds. So it gets points on a grid, in a frame
that depends neither on the size nor on the position of the model, and large enough that only
degenerate faces fall below a threshold.

Where xatlas fails, a chart grows over neighbors whose normals lie in a cone about the chart's mean
normal, and is projected along the axis of that cone. No face is mirrored, and none is squashed to
less than half its area; a chart that winds around may overlap itself.

Based on: Jonathan Young, xatlas, 2018 (a fork of thekla_atlas by Ignacio Castano).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.child import Child, ChildError
from texbake.core import core, portable_math as pm
from texbake.errors import DependencyError
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cutting.parts import faces_done
from texbake.mapping.atlas.cutting.repair import NO_CHART, repair_charts
from texbake.mapping.corner_uvs import surface_areas
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.topology import opposite_half_edges
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.records import dataclass

_WORKER = "texbake.mapping.atlas.cutting.cut_worker"
_DOES_NOT_LOAD = 3  # exit code of the worker if xatlas does not load

# Longest side of the box that xatlas sees. xatlas treats areas below 1.2e-7 as zero; at this size
# that is two cells of the grid, and real meshes give the same charts as at any size from 16 to
# 1024. At a size of 1 they do not.
_WORKING_SIZE = 256.0

_SECONDS_TO_START = 60.0
_SECONDS_A_FACE = 0.01  # 30 times what 82,000 triangles in one piece take

# After this many timeouts, no further request is sent: a library that hangs often takes forever.
_MOST_TIMEOUTS = 3

_TINY = np.finfo(np.float64).tiny


def xatlas_charts(
    points: FloatArray,
    faces: IntArray,
    batches: Sequence[IntArray],
    *,
    timeout: float | None = None,
    threads: int | None = None,
    advance: Callable[[int], None] | None = None,
) -> tuple[list[tuple[IntArray, Charts]], tuple[str, ...]]:
    """Cut batches of faces into charts, each within `timeout` s; and say where xatlas failed."""
    parts = [_Part.of(points, faces, face_ids) for face_ids in batches]
    parts.sort(key=lambda part: -len(part.faces))  # small ones last, so that workers end together
    answers: list[Charts | ChildError | None] = [None] * len(parts)
    children: list[Child] = []
    own, n_timeouts = threading.local(), 0

    def cut(index: int, _: int) -> None:
        nonlocal n_timeouts
        part = parts[index]
        if n_timeouts >= _MOST_TIMEOUTS:
            answers[index] = ChildError("took too long on others")
            return
        if not hasattr(own, "child"):
            own.child = Child(_WORKER)
            children.append(own.child)
        seconds = timeout or _SECONDS_TO_START + _SECONDS_A_FACE * len(part.faces)
        try:
            answers[index] = part.read(own.child.ask(part.request(), timeout=seconds))
        except ChildError as error:
            n_timeouts += error.timed_out
            answers[index] = error
        except (ValueError, TypeError, AttributeError):
            own.child.end()
            answers[index] = ChildError("gave an invalid answer")
        except BaseException:  # an interrupt: the other threads wait for their children
            for child in children:
                child.close()
            raise

    report = faces_done([len(part.faces) for part in parts], advance)
    try:
        run_bands(cut, len(parts), band=1, threads=threads, advance=report)
    finally:
        for child in children:
            child.close()
            child.end()
    return _with_plain_charts(parts, answers)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Part:
    """Faces that are cut into charts together."""

    face_ids: IntArray  # (n,) int32; faces of the mesh, ascending
    points: FloatArray  # (m, 3) float64; points that the faces use
    faces: IntArray  # (n, 3) int32; indices into `points`

    @classmethod
    def of(cls, points: FloatArray, faces: IntArray, face_ids: IntArray) -> _Part:
        used, indices = np.unique(faces[face_ids], return_inverse=True)
        return cls(
            face_ids=face_ids, points=points[used], faces=indices.reshape(-1, 3).astype(np.int32)
        )

    def request(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
        """Points and faces as the worker takes them."""
        return (self.points * _WORKING_SIZE).astype(np.float32), self.faces.astype(np.uint32)

    def plain_charts(self) -> Charts | None:
        """Charts by normals alone; None if no face has an area."""
        faces, uvs, chart_ids = plain_charts(self.points, self.faces)
        empty = surface_areas(self.points[self.faces]) == 0.0
        chart_ids[faces[empty]] = NO_CHART
        return repair_charts(self.points[self.faces], faces, uvs, chart_ids)

    def read(self, answer: Any) -> Charts | None:
        """Read the charts of an answer and repair them; None if there are none."""
        if answer is None:
            return None
        uvs, chart_ids, faces = answer
        if not (
            [array.dtype.str for array in answer] == ["<f4", "<u4", "<u4"]
            and (uvs.shape, faces.shape) == ((len(chart_ids), 2), (len(self.faces), 3))
            and np.isfinite(uvs).all()
            and faces.max() < len(uvs)
        ):
            raise ValueError("invalid coordinates")
        of_corners = chart_ids[faces]
        if (of_corners != of_corners[:, :1]).any():
            raise ValueError("a face in two charts")
        return repair_charts(self.points[self.faces], faces, uvs, chart_ids)


def _with_plain_charts(
    parts: Sequence[_Part], answers: Sequence[Charts | ChildError | None]
) -> tuple[list[tuple[IntArray, Charts]], tuple[str, ...]]:
    """Charts of each batch, by normals where xatlas failed, and notes on the failures."""
    pieces = []
    failed: dict[str, list[int]] = {}
    for part, answer in zip(parts, answers, strict=True):
        if isinstance(answer, ChildError) and answer.code == _DOES_NOT_LOAD:
            raise DependencyError(f"xatlas: it does not load; {answer.reason}")
        charts = answer if isinstance(answer, Charts) else part.plain_charts()
        if charts is None:
            continue
        pieces.append((part.face_ids, charts))
        if not isinstance(answer, Charts):
            reason = answer.reason if isinstance(answer, ChildError) else "found no charts"
            failed.setdefault(reason, []).append(len(part.faces))
    notes = []
    for reason, sizes in failed.items():
        where = "a part" if len(sizes) == 1 else f"{len(sizes):,} parts"
        notes.append(
            f"xatlas {reason} on {where} of {sum(sizes):,} faces; "
            "they were cut by their normals instead"
        )
    return pieces, tuple(notes)


def plain_piece(
    points: FloatArray, faces: IntArray, face_ids: IntArray
) -> tuple[IntArray, Charts] | None:
    """Cut some faces of a mesh into charts by their normals; None if none of them has an area."""
    part = _Part.of(points, faces, face_ids)
    charts = part.plain_charts()
    return None if charts is None else (face_ids, charts)


def plain_charts(
    points: FloatArray, faces: IntArray
) -> tuple[IntArray, FloatArray, npt.NDArray[np.int64]]:
    """Cut a mesh into charts by normals, uvs in the unit of points; `core/normal_cones.c`."""
    corners = weld_rows(points)[faces]
    solid = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    opposite = opposite_half_edges(corners, solid=solid)
    neighbors = np.where(opposite >= 0, opposite // 3, -1).astype(np.int32).reshape(-1, 3)
    places = points[faces]
    normals = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    charts = np.full(len(faces), -1, dtype=np.int32)
    axes = np.zeros((len(faces), 3))
    n_charts = core.grow_charts(neighbors, normals, charts, axes)

    coordinates = np.stack([corners, np.repeat(charts[:, None], 3, axis=1)], axis=2)
    used, indices = np.unique(coordinates.reshape(-1, 2), axis=0, return_inverse=True)
    axes = axes[:n_charts]
    across = np.cross(np.eye(3)[np.abs(axes).argmin(axis=1)], axes)
    across /= np.maximum(pm.norm(across, axis=1, keepdims=True), _TINY)
    where, chart_ids = points[used[:, 0]], used[:, 1].astype(np.int64)
    uvs = [pm.vecdot(where, side[chart_ids]) for side in (across, np.cross(axes, across))]
    return indices.reshape(-1, 3).astype(np.int32), np.stack(uvs, axis=1), chart_ids
