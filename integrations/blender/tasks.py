# SPDX-License-Identifier: GPL-3.0-or-later
"""The tasks of the worker, from arrays of Blender's meshes to arrays and images in a folder.

All lengths are those of the space of an object. A task ends with a line that says what is done.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from worker import tell

from texbake.baking.bake import bake as baked_maps
from texbake.baking.options import BakeOptions
from texbake.checks.check import check as checked
from texbake.checks.kinds import CheckOptions
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.unwrap import unwrap_together
from texbake.mesh.compose import join_parts, transformed
from texbake.mesh.hard_edges import inner_edges, normals_jump
from texbake.mesh.mesh import Mesh, UvSet
from texbake.mesh.options import RemeshOptions
from texbake.mesh.remesh import remesh_with_report
from texbake.mesh.simplify import simplify_with_report
from texbake.mesh.topology import edge_keys
from texbake.mesh.weld import unique_rows
from texbake.metadata import DISPLACEMENT_MID, DISPLACEMENT_SCALE
from texbake.raycast.orientation import oriented
from texbake.targets import PROGRAMS

AnyArray = npt.NDArray[Any]
Arrays = dict[str, AnyArray]  # of one object, from `gather.object_arrays`
Options = dict[str, Any]

_HEIGHT = DISPLACEMENT_MID, DISPLACEMENT_SCALE
_MOST_TRIES = 4  # of an unwrap that keeps polygons whole


class Told:
    """Reports the progress of stages, each at most ten times per second."""

    def __init__(self) -> None:
        self._stage, self._last = "", 0.0

    def __call__(self, stage: str, share: float | None) -> None:
        """Report how much of a stage is done."""
        now = time.monotonic()
        if stage != self._stage or now - self._last > 0.1:
            self._stage, self._last = stage, now
            tell(stage=stage, fraction=share or None)


def mesh_of(arrays: Arrays, *, groups: bool = False) -> Mesh:
    """Return a texbake mesh in the object's own space; `groups`: of its materials."""
    name, triangles = str(arrays["name"]), arrays["triangles"]
    faces, positions = arrays["vertices"][triangles], arrays["positions"]
    fields: dict[str, Any] = {}
    colors = arrays.get("colors")
    if "corner_colors" in arrays:  # a vertex for each color of a vertex
        colors = arrays["corner_colors"]
        rows = np.column_stack([arrays["vertices"], colors.view(np.int32)])
        firsts, ids = unique_rows(rows)
        order = np.lexsort(rows[firsts].T[::-1])
        firsts, faces = firsts[order], np.argsort(order)[ids][triangles]
        positions, colors = positions[arrays["vertices"][firsts]], colors[firsts]
    if colors is not None:
        fields["colors"] = np.clip(colors, 0.0, 1.0)
    if "uv0" in arrays:
        further = enumerate(arrays["uv_names"][1:].tolist(), start=1)
        fields |= {
            "uvs": arrays["uv0"],
            "uv_faces": triangles,
            "uv_sets": {title: UvSet(arrays[f"uv{n}"], triangles) for n, title in further},
        }
    if groups and "materials" in arrays:
        materials = arrays["materials"][arrays["polygon_of"]]
        fields["face_groups"] = materials
        fields["group_names"] = tuple(map(str, range(int(materials.max()) + 1)))
    return Mesh(
        positions=positions,
        faces=faces,
        normals=arrays["normals"],
        normal_faces=triangles,
        polygon_of=arrays["polygon_of"],
        name=name,
        **fields,
    )


def joined(meshes: list[Mesh]) -> Mesh:
    """Put meshes into one, each as an object of its own."""
    named = [
        mesh.replace(face_groups=mesh.faces[:, 0] * 0, group_names=(mesh.name,), uv_sets={})
        for mesh in meshes
    ]
    return named[0] if len(named) == 1 else join_parts(named, f"{len(named)} objects")


def in_space_of(every: Sequence[Arrays], matrix: AnyArray) -> list[Mesh]:
    """Return the meshes of objects in the space of another object."""
    moved = []
    for arrays in every:
        mesh = mesh_of(arrays)
        if not (arrays["matrix"] == matrix).all():
            mesh = transformed(mesh, np.linalg.solve(matrix, arrays["matrix"]))
        moved.append(mesh)
    return moved


def bake(
    folder: Path,
    options: Options,
    high: list[Arrays],
    low: list[Arrays],
    cage: Sequence[Arrays] = (),
) -> None:
    """Bake maps, and write them as images."""
    program = PROGRAMS[options.pop("target")]
    matrix = low[0]["matrix"]
    chosen = BakeOptions(
        **{**options, "maps": tuple(options["maps"])}, convention=program.convention
    )
    cages = in_space_of(cage, matrix)
    result = baked_maps(
        joined(in_space_of(high, matrix)), mesh_of(low[0]), chosen,
        cage=cages[0] if cages else None, progress=Told(),
    )  # fmt: skip
    tell(stage="write")
    maps = []
    for name, baked in result.maps.items():
        bits = None  # as many as PNG has
        if program is not PROGRAMS["blender"] and baked.kind.coding not in ("height", "vector"):
            bits = program.normal_bits if baked.kind.coding == "normal" else 8
        metadata = baked.write(folder / f"{name}.png", bits=bits).metadata
        maps.append({
            "name": name, "file": f"{name}.png", "coding": baked.kind.coding,
            "title": program.map_stem(str(low[0]["name"]), name),
            "convention": program.convention,
            "height": [float(metadata[key]) for key in _HEIGHT if key in metadata],
        })  # fmt: skip
    report = result.report
    tell(
        warnings=list(report.warnings),
        done={"maps": maps, "miss_percent": report.miss_percent, "uv": str(low[0]["uv_names"][0])},
    )


def marked_edges(arrays: Arrays, mesh: Mesh, kinds: list[str]) -> AnyArray | None:
    """Return the marked edges of some kinds that faces use, (n, 2); None where there are none."""
    edges = np.concatenate([np.empty((0, 2), np.int32), *(arrays[kind] for kind in kinds)])
    used = edge_keys(mesh.faces, np.roll(mesh.faces, -1, axis=1))
    return edges[np.isin(edge_keys(*edges.T), used)] if len(edges) else None


def split_polygons(mesh: Mesh, corners: AnyArray) -> AnyArray:
    """Return which polygons have corners with several texture coordinates, unlike Blender's.

    `corners` (n, 2): a coordinate of each of Blender's corners, which `mesh.normal_faces` index.
    """
    differ = (corners[mesh.normal_faces] != mesh.corner_uvs()).any(axis=(1, 2))
    return np.asarray(mesh.polygon_numbers[differ])


def detached(mesh: Mesh, polygons: AnyArray) -> Mesh:
    """Return a mesh with some polygons moved away a little, so that nothing is joined to them."""
    chosen = np.isin(mesh.polygon_numbers, polygons)
    owners = np.repeat(mesh.polygon_numbers[chosen], 3)
    pairs = np.stack([owners, mesh.faces[chosen].ravel()], axis=1)
    pairs, numbers = np.unique(pairs, axis=0, return_inverse=True)
    faces = mesh.faces.copy()
    faces[chosen] = mesh.n_vertices + numbers.reshape(-1, 3)
    # Far enough for the grid of 2^20 cells that charts are cut on.
    steps = 1 + np.searchsorted(np.unique(owners), pairs[:, :1]) % 7
    points = mesh.positions[pairs[:, 1]] + steps * np.ptp(mesh.bounds, axis=0).max() * 2.0**-18
    return mesh.replace(
        positions=np.concatenate([mesh.positions, points]), faces=faces,
        polygon_of=mesh.polygon_of, uv_sets=mesh.uv_sets, colors=None,
    )  # fmt: skip


def unwrap(folder: Path, options: Options, mesh: list[Arrays]) -> None:
    """Write texture coordinates by corner."""
    kinds, meshes = options.pop("kinds"), [mesh_of(arrays) for arrays in mesh]
    for _ in range(_MOST_TRIES):
        results = unwrap_together(
            meshes, UnwrapOptions(**options), progress=Told(),
            seams=[marked_edges(*pair, kinds) for pair in zip(mesh, meshes, strict=True)],
        )  # fmt: skip
        corners = [np.zeros((len(arrays["vertices"]), 2)) for arrays in mesh]
        for uvs, (result, _) in zip(corners, results, strict=True):
            uvs[result.normal_faces] = result.corner_uvs()
        split = [split_polygons(r, uvs) for uvs, (r, _) in zip(corners, results, strict=True)]
        if not any(map(len, split)):
            break
        meshes = [
            detached(given, polygons) if len(polygons) else given
            for given, polygons in zip(meshes, split, strict=True)
        ]
    notes = [f"{result.name}: {note}" for result, report in results for note in report.notes]
    for number, (uvs, polygons) in enumerate(zip(corners, split, strict=True)):
        np.savez(folder / f"out{number}.npz", uvs=uvs.astype(np.float32))
        if len(polygons):
            notes.append(
                f"{meshes[number].name}: faces to triangulate, since they cannot be laid flat and "
                f"overlap others in the texture: {len(np.unique(polygons))}"
            )
    tell(warnings=notes, done={"charts": sum(report.n_charts for _, report in results)})


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write the arrays from which Blender makes a mesh."""
    arrays: dict[str, Any] = {
        "positions": mesh.positions.astype(np.float32), "faces": mesh.faces,
    }  # fmt: skip
    if mesh.uvs is not None:
        arrays["uvs"] = mesh.corner_uvs().reshape(-1, 2).astype(np.float32)
    if mesh.face_groups is not None and all(name.isdigit() for name in mesh.group_names):
        arrays["materials"] = np.array(mesh.group_names, np.int32)[mesh.face_groups]
    if mesh.colors is not None:
        colors = np.ones((mesh.n_vertices, 4), np.float32)
        colors[:, : mesh.colors.shape[1]] = mesh.colors
        arrays["colors"] = colors
    if mesh.normals is not None:
        one, other = inner_edges(mesh)
        sharp = one[normals_jump(mesh, one, other)]
        faces = mesh.faces.ravel()
        arrays["sharp"] = np.stack([faces[sharp], faces[sharp + 1 - 3 * (sharp % 3 == 2)]], axis=1)
    np.savez(path, **arrays)


def _reduce(
    folder: Path, every: list[Arrays], reduced: Callable[[Mesh], tuple[Mesh, list[str]]]
) -> None:
    """Write what a function makes of each mesh, which has the scale of its object if uneven."""
    notes, counts = [], []
    for number, arrays in enumerate(every):
        mesh, matrix = mesh_of(arrays, groups=True), np.eye(4)
        if not arrays["is_even"]:
            matrix[:3, :3] = arrays["matrix"][:3, :3]
            mesh = transformed(mesh, matrix)
        result, found = reduced(mesh)
        counts.append([mesh.n_faces, result.n_faces])
        notes += [f"{mesh.name}: {note}" for note in found]
        if not arrays["is_even"]:
            result = transformed(result, np.linalg.inv(matrix))
        write_mesh(folder / f"out{number}.npz", result)
    tell(warnings=notes, done={"faces": counts})


def simplify(folder: Path, options: Options, mesh: list[Arrays]) -> None:
    """Write meshes with fewer triangles."""
    ratio = options.pop("ratio")

    def simplified(given: Mesh) -> tuple[Mesh, list[str]]:
        given, turned = oriented(given, "auto")
        if ratio is not None:
            options["n_faces"] = max(4, round(ratio * given.n_faces))
        result, report = simplify_with_report(given, progress=Told(), **options)
        notes = [*turned.notes, *report.notes]
        if not report.reached:
            notes.append(f"it has {result.n_faces:,} triangles, more than requested")
        return result, notes

    _reduce(folder, mesh, simplified)


def remesh(folder: Path, options: Options, mesh: list[Arrays]) -> None:
    """Write meshes of the wrapped surfaces."""

    def remeshed(given: Mesh) -> tuple[Mesh, list[str]]:
        result, report = remesh_with_report(given, RemeshOptions(**options), progress=Told())
        return result, list(report.notes)

    _reduce(folder, mesh, remeshed)


def lighten(folder: Path, options: Options) -> None:
    """Make a glTF file of the scene lighter."""
    from texbake.jobs.lighten import lighten as lightened
    from texbake.jobs.lighten_options import LightenOptions

    # Quantized positions need a node of their own, which Blender would show as a child object.
    chosen = LightenOptions(images="png", views=0, quantize=False, **options)
    done = lightened(folder / "in.glb", folder / "out.glb", chosen, None, "", Told())
    report = done.report
    tell(warnings=list(done.warnings), done={"faces": [[report.n_faces_before, report.n_faces]]})


def check(folder: Path, options: Options, mesh: list[Arrays], high: Sequence[Arrays] = ()) -> None:
    """Write the findings, and the polygons that they name."""
    low = mesh_of(mesh[0])
    others = in_space_of(high, mesh[0]["matrix"])
    chosen = CheckOptions(**options)
    report = checked(
        joined(others) if others else low, low if others else None, chosen, progress=Told()
    )
    arrays: dict[str, Any] = {}
    findings = []
    for number, finding in enumerate(report.findings):
        arrays[f"faces{number}"] = np.asarray(finding.polygons, np.int32)
        findings.append({
            "name": finding.name, "title": finding.kind.title, "severity": finding.severity,
            "counted": finding.counted, "text": f"{finding.problem} {finding.remedy}",
            "in_high": finding.mesh == "high" and bool(others),
        })  # fmt: skip
    np.savez(folder / "out.npz", **arrays)
    tell(done={"findings": findings})


TASKS: dict[str, Callable[..., None]] = {
    "bake": bake, "unwrap": unwrap, "simplify": simplify, "remesh": remesh, "lighten": lighten,
    "check": check,
}  # fmt: skip
