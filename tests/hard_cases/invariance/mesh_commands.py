"""What the commands that make or measure meshes give, as quantities with their bounds.

Under SCALE (a power of two) every bit of every result stays, but for exponents. Under PLACE (an
exact shift) every bit stays of what does not name a place. Other changes round, or sum in another
order. Where a result is made by choices (which edge collapses next, where a chart is cut), ties
fall otherwise, and what is bounded is how good the result is.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from invariance.changes import FACES, MIRROR, PLACE, SCALE, SHIFT, TURN, VERTICES
from invariance.quantities import (
    AREA,
    CORNER,
    COUNT,
    CURVATURE,
    DIRECTION,
    EXACT,
    FACE,
    LENGTH,
    POINT,
    ROUNDING,
    SAME,
    VERTEX,
    Bounds,
    Quantity,
    Side,
    counts,
    number,
    points_made,
    within,
)

import texbake
from texbake.checks.check import CheckReport
from texbake.jobs.export.export import share_elsewhere
from texbake.mesh.normals import face_normals, smooth_normals, vertex_curvatures
from texbake.mesh.tangents import corner_tangents
from texbake.raycast.orientation import oriented

Result = Mapping[str, Quantity]
Command = Callable[[Side], Result]

# Findings about the size and place of a mesh.
OF_PLACE = {"far-from-origin", "extreme-size", "unmeasurable-size"}


def info(side: Side) -> Result:
    found = texbake.mesh_info(side.mesh)
    names = (
        "n_vertices", "n_faces", "n_components", "n_boundary_edges", "n_non_manifold_edges",
        "n_misoriented_edges", "n_degenerate_faces", "n_duplicate_faces", "n_unused_vertices",
        "n_split_vertices", "closed",
    )  # fmt: skip
    genus = -1 if found.genus is None else found.genus
    # A mesh that is turned has another box.
    diagonal = within(ROUNDING, turn=None)
    return {
        **counts(genus=genus, **{name: getattr(found, name) for name in names}),
        "diagonal": number(found.diagonal, diagonal, LENGTH, amplified=4.0),
        "area": number(found.area, within(ROUNDING), AREA, amplified=8.0),
        "bounds": Quantity(values=np.array(found.bounds), unit=POINT, bounds=EXACT),
    }


def normals(side: Side) -> Result:
    exact = {VERTICES: 0.0}
    # Curvature divides by areas, and so amplifies what positions round once more.
    curvature = {**within(1e-6), SHIFT: None, TURN: None}
    mesh = side.mesh
    return {
        "faces": Quantity(
            values=face_normals(mesh), unit=DIRECTION, per=FACE,
            bounds={**within(ROUNDING), **exact, FACES: 0.0}, amplified=8.0),
        "smooth": Quantity(
            values=smooth_normals(mesh), unit=DIRECTION, per=VERTEX,
            bounds={**within(ROUNDING), **exact}, amplified=32.0),
        "curvature": Quantity(
            values=vertex_curvatures(mesh), unit=CURVATURE, per=VERTEX, bounds=curvature),
    }  # fmt: skip


def tangents(side: Side) -> Result:
    # Directions are float32, and MikkTSpace divides by areas in the texture.
    found = corner_tangents(side.mesh)[..., :3]
    bounds = within(1e-5, mirror=None)
    return {
        "tangents": Quantity(
            values=found, unit=DIRECTION, per=CORNER, bounds=bounds, amplified=64.0)
    }  # fmt: skip


def _findings(report: CheckReport, bounds: Bounds = SAME) -> Result:
    found = sorted(
        f"{finding.mesh} {finding.kind.name} {finding.severity} {finding.count}"
        for finding in report.findings
        if finding.kind.name not in OF_PLACE
    )
    return {"findings": Quantity(values=np.array(found or [""], dtype="U120"), bounds=bounds)}


def check(side: Side) -> Result:
    return _findings(texbake.check(side.mesh, options=texbake.CheckOptions(size=64)))


def check_pair(side: Side) -> Result:
    # Centers of texels on the sides of faces change places in a mirror.
    bounds = {**SAME, MIRROR: None}
    return _findings(texbake.check(side.high, side.mesh, texbake.CheckOptions(size=64)), bounds)


def repair(side: Side) -> Result:
    mesh, report = texbake.repair(side.mesh)
    done = {name.replace(" ", "_"): count for name, count in report.counts.items()}
    return {
        **counts(n_faces=mesh.n_faces, **done),
        "faces": Quantity(values=mesh.faces, bounds=EXACT),
        "positions": Quantity(values=mesh.positions, unit=POINT, bounds=EXACT),
    }


def transform(side: Side) -> Result:
    """The normals, which the size of a mesh does not change, and neither does its order."""
    options = texbake.TransformOptions(scale=2.0, rotate=(90.0, 0.0, 30.0), flip=True)
    mesh = texbake.transform(side.mesh, options)
    bounds = {SCALE: 0.0, FACES: 0.0, VERTICES: 0.0}
    return {"normals": Quantity(values=face_normals(mesh), per=FACE, bounds=bounds)}


def converted(suffix: str) -> Command:
    """Write and read a format."""
    # STL and GLB are of float32: two of its roundings of coordinates up to 2^11 sizes away.
    float32 = dict.fromkeys(SAME, 2.0**11 * 2.0**-23)
    bounds = {**float32, SCALE: 0.0} if suffix in ("stl", "glb") else SAME

    def convert(side: Side) -> Result:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"mesh.{suffix}"
            texbake.write_mesh(side.mesh, path)
            back = texbake.read_mesh(path)
        off = back.positions[back.faces] - side.mesh.positions[side.mesh.faces]
        values = np.abs(off).max(initial=0.0, axis=2)
        return {"offsets": Quantity(values=values, unit=LENGTH, per=CORNER, bounds=bounds)}

    return convert


def _apart(one: texbake.Mesh, other: texbake.Mesh) -> float:
    return texbake.surface_distance(one, other, n_samples=300, threads=1).max


def remesh(side: Side) -> Result:
    mesh = texbake.remesh(side.mesh, texbake.RemeshOptions(resolution=16), threads=1)
    # The diagonal of a voxel: the grid lies otherwise about a mesh that is turned.
    distance = within(3.0**0.5 / 16.0, exact_shift=1e-11)
    return {
        **points_made(mesh),
        "distance": number(_apart(mesh, side.mesh), distance, LENGTH),
    }


def simplified(quality: str, error: str | None = None) -> Command:
    """Simplify to half the faces, or to an error."""

    def simplify(side: Side) -> Result:
        mesh = side.mesh
        n_faces = None if error else max(4, mesh.n_faces // 2)
        low = texbake.simplify(mesh, n_faces, error=error, quality=quality, threads=1)
        # Other edges collapse where several cost the same.
        return {
            **points_made(low),
            "n_faces": number(low.n_faces, within(0.5), COUNT),
            "distance": number(_apart(low, mesh), within(0.25, exact_shift=1e-11), LENGTH),
        }

    return simplify


def cage(side: Side) -> Result:
    found = texbake.fit_cage(side.high, side.mesh, threads=1)
    # The margin is a share of the bounding box, which turns change. Vertices move in one by one,
    # so that where each one stops depends on their order.
    bounds = within(1e-4, turn=2.5e-4, **{VERTICES: 2e-3})
    return {"distances": Quantity(values=found.distances, unit=LENGTH, per=VERTEX, bounds=bounds)}


def distances(side: Side) -> Result:
    found = texbake.surface_distance(side.high, side.mesh, n_samples=300, threads=1)
    # Samples lie elsewhere on faces in another order, or with another first corner.
    bounds = within(ROUNDING, **{"order of faces": 0.02, "order of corners": 0.02, MIRROR: 0.02})
    return {
        name: number(getattr(found, name), bounds, LENGTH, amplified=8.0)
        for name in ("max", "rms", "mean")
    }


def orientation(side: Side) -> Result:
    mesh, report = oriented(side.mesh, "auto", threads=1)
    turned = (mesh.faces != side.mesh.faces).any(axis=1)
    # The directions from which a mesh is looked at do not turn with it, and a sheet between two
    # others is seen from one side or the other.
    fixed = dict.fromkeys((*EXACT, SHIFT, FACES, VERTICES), 0.0)
    return {
        "turned": Quantity(values=turned, per=FACE, bounds=SAME),
        "n_unclear": number(report.n_unclear, fixed),
    }


def levels(side: Side) -> Result:
    n_faces = max(4, side.mesh.n_faces // 2)
    level = texbake.simplify(side.mesh, n_faces, seams="keep", threads=1)
    # Samples of the simplified mesh are rounded where it is.
    bounds = {SCALE: 0.0, PLACE: 0.01}
    share = np.nan if level.uvs is None else share_elsewhere(level, side.mesh, threads=1)
    return {"elsewhere": number(share, bounds)}


PLAIN: dict[str, Command] = {
    "info": info,
    "normals": normals,
    "check": check,
    "repair": repair,
    "transform": transform,
    **{f"convert to {suffix}": converted(suffix) for suffix in ("obj", "ply", "off", "stl", "glb")},
    "remesh": remesh,
    "simplify fast": simplified("fast"),
    "simplify best": simplified("best"),
    "simplify to an error": simplified("best", "2%"),
    "cage": cage,
    "surface distance": distances,
    "orientation": orientation,
}
TEXTURED: dict[str, Command] = {
    "check of a pair": check_pair,
    "tangents": tangents,
    "levels of detail": levels,
}
