"""Work on meshes alone: unwrapping and simplification."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texbake.mapping.corner_uvs import with_coordinates
from texbake.mapping.distortion import distortion
from texbake.mesh.distance import surface_distance
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.study.bench.cases import BenchCase, mesh_file
from texbake.study.bench.options import BenchOptions
from texbake.study.bench.programs import Product
from texbake.study.bench.task import BenchTask, Prepared
from texbake.study.knob import Judgment

_ATLAS_SIZE, _GAP = 1024, 2  # texels


def _prepare_unwrap(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    mesh = case.low if case.build is None else case.build(options.unwrapped_triangles)
    name = f"{case.name} to unwrap"

    def judge(product: Product) -> Judgment:
        return unwrap_error(_unwrapped(product.path))

    return Prepared(
        subject=f"{case.name}, {mesh.n_faces:,} triangles, {_GAP} texels between charts at "
        f"{_ATLAS_SIZE} x {_ATLAS_SIZE}",
        truth="exact values",
        truth_text="The stretch of every triangle and the area that the charts fill follow from "
        "the texture coordinates.",
        job={"mesh": mesh_file(mesh, folder, name), "size": _ATLAS_SIZE, "gap": _GAP},
        judge=judge,
    )


def unwrap_error(mesh: Mesh) -> Judgment:
    """Return the share of the texels that an atlas wastes, in percent; see `Distortion.wasted`."""
    found = distortion(mesh, _ATLAS_SIZE)
    stretch = found.turned_stretch  # of some atlases half the charts are mirrored
    return Judgment(
        100.0 * found.wasted,
        figures={
            "charts": float(found.n_charts),
            "filled (%)": 100.0 * found.fill,
            "L2 stretch": stretch.l2,
            "symmetric Dirichlet": stretch.symmetric_dirichlet,
            "seams (diagonals)": found.seam_length / mesh.diagonal,
            "mirrored triangles": float(found.n_mirrored),
            "overlapping triangles": float(found.n_overlapping),
            "triangles without area": float(found.n_collapsed),
        },
    )


def _unwrapped(path: Path) -> Mesh:
    if path.suffix != ".npz":
        return read_mesh(path)
    with np.load(path) as arrays:
        mesh = Mesh(
            positions=arrays["positions"].astype(np.float64),
            faces=arrays["faces"].astype(np.int32),
            name=path.stem,
        )
        return with_coordinates(mesh, arrays["corners"].astype(np.float64))


UNWRAP_TASK = BenchTask(
    name="unwrap",
    title="Unwrap",
    about="Texture coordinates for a mesh that has none, in one square without overlaps. What an "
    "atlas wastes is a single figure of its stretch and its gaps; the table has both, and the "
    "charts and seams.",
    error="texels wasted by stretch and gaps",
    unit="%",
    prepare=_prepare_unwrap,
)


def _prepare_simplify(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared | None:
    if case.high.n_faces <= min(options.counts):
        return None

    def judge(product: Product) -> Judgment:
        mesh = read_mesh(product.path)
        apart = surface_distance(case.high, mesh, n_samples=options.n_probes)
        return Judgment(
            100.0 * apart.mean_relative,
            figures={
                "triangles": float(mesh.n_faces),
                "distance, maximum (% of diagonal)": 100.0 * apart.max_relative,
            },
        )

    exact = ", whose vertices lie on the closed form" if case.surface is not None else ""
    return Prepared(
        subject=f"{case.high.name}, {case.high.n_faces:,} triangles",
        truth="high-poly mesh",
        truth_text=f"The high-poly mesh{exact}: distances between both surfaces, in both "
        "directions.",
        job={"mesh": mesh_file(case.high, folder, f"{case.name} high")},
        judge=judge,
    )


SIMPLIFY_TASK = BenchTask(
    name="simplify",
    title="Simplify",
    about="The high-poly mesh reduced to a number of triangles, from file to file. Some programs "
    "stop above that number, which makes them look more accurate than they are.",
    error="distance between the surfaces, mean",
    unit="% of diagonal",
    prepare=_prepare_simplify,
)
