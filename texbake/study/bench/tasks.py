"""The tasks of the bench: the same job for every program, and how wrong its products are.

Bakes get the same meshes, distances of rays and padding. Maps are judged as they are used: sampled
bilinearly at points spread over the low-poly mesh, normals transformed from tangent space as a
renderer does. Pictures show a white diffuse surface under one lamp, without shadows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.core import portable_math as pm
from texbake.mapping.corner_uvs import with_coordinates
from texbake.mapping.distortion import distortion
from texbake.mesh.distance import surface_distance
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import picture_error
from texbake.study.bench.cases import BenchCase, mesh_file, pair_files
from texbake.study.bench.programs import Product
from texbake.study.knob import Evaluation
from texbake.study.options import BenchOptions
from texbake.study.truth.pictures import RAYS_PER_SIDE, lambert_picture
from texbake.study.truth.probes import Probes, angles_deg, probe, truth_of
from texbake.texture.encoding import decode_normals
from texbake.texture.image import read_image
from texbake.texture.lookup import lookup


@dataclass(frozen=True, eq=False)
class Prepared:
    """A task prepared for a case."""

    subject: str  # what is worked on, in words
    truth: str  # one of `texbake.study.knob.TRUTHS`
    truth_text: str  # the same in a sentence
    job: Mapping[str, Any]  # what all programs are given: files and common settings
    judge: Callable[[Product], Evaluation]  # from a product to how wrong it is


@dataclass(frozen=True, eq=False)
class BenchTask:
    """Something that several programs can do."""

    name: str
    title: str
    about: str  # what is done, in a sentence or two
    # error, unit: what its error is, for the axes of plots.
    error: str
    unit: str
    # Writes the files into a folder; None if the task cannot be done, or judged, on the case.
    prepare: Callable[[BenchCase, BenchOptions, Path], Prepared | None]


_PADDING = 16
_CONVERGED_RAYS = 1024


def _job(case: BenchCase, folder: Path) -> dict[str, Any]:
    return {**pair_files(case, folder), "distance": case.reach, "padding": _PADDING}


def _pixels(product: Product) -> npt.NDArray[np.float32]:
    return np.ascontiguousarray(read_image(product.path, color=False).pixels[..., :3])


# Normals


def _prepare_normals(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    probes = probe(case.pair, options.amounts.n_probes)

    def judge(product: Product) -> Evaluation:
        codes = _pixels(product)
        if product.form == "tangent":
            angles = probes.normal_errors(decode_normals(codes))
        else:
            read = lookup(2.0 * codes - 1.0, probes.uvs).astype(np.float64)
            angles = angles_deg(read, probes.normals)
        return Evaluation(
            float(angles.mean()),
            figures={"angle, 95th percentile (°)": float(np.quantile(angles, 0.95))},
        )

    truth, words = truth_of(case.pair, probes)
    return Prepared(case.subject, truth, words, _job(case, folder), judge)


NORMALS_TASK = BenchTask(
    name="bake-normals",
    title="Bake normals",
    about="A normal map of the high-poly mesh for the low-poly one, from mesh files to a PNG file "
    "with 16 texels of padding: 16 bits and tangent space, in pymeshlab 8 bits and object space.",
    error="angle of the normal, mean",
    unit="°",
    prepare=_prepare_normals,
)


# Heights


def _prepare_displacement(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    probes = probe(case.pair, options.amounts.n_probes)
    points, normals = _points(case, probes), _directions(case, probes)

    def judge(product: Product) -> Evaluation:
        read = lookup(_pixels(product), probes.uvs).astype(np.float64)
        heights = read[:, 0]
        if product.form == "positions":
            heights = pm.vecdot(read - points, normals)
        errors = 100.0 * np.abs(heights - probes.heights) / case.low.diagonal
        return Evaluation(
            float(errors.mean()),
            figures={"height, 95th percentile (% of diagonal)": float(np.quantile(errors, 0.95))},
        )

    truth, words = truth_of(case.pair, probes)
    return Prepared(case.subject, truth, words, _job(case, folder), judge)


def _points(case: BenchCase, probes: Probes) -> FloatArray:
    corners = case.low.positions[case.low.faces[probes.faces]]
    return np.asarray(pm.vecmat(probes.barycentrics, corners))


def _directions(case: BenchCase, probes: Probes) -> FloatArray:
    corners = smooth_normals(case.low)[case.low.faces[probes.faces]]
    found = pm.vecmat(probes.barycentrics, corners)
    lengths = np.sqrt(pm.vecdot(found, found))
    return np.asarray(found / np.where(lengths > 0.0, lengths, 1.0)[:, None])


DISPLACEMENT_TASK = BenchTask(
    name="bake-displacement",
    title="Bake displacement",
    about="Heights of the high-poly mesh over the low-poly one, as 32-bit EXR. Blender bakes no "
    "heights between two meshes; it bakes the positions of the hits, from which they follow.",
    error="height, mean",
    unit="% of diagonal",
    prepare=_prepare_displacement,
)


# Ambient occlusion


def _prepare_ao(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared | None:
    if case.surface is not None and case.openness is None:
        return None
    probes = probe(case.pair, options.amounts.n_probes)
    where = np.ones(len(probes.faces), dtype=np.bool_)
    if case.openness is not None:
        where = probes.faces < case.floor
        truth = case.openness(_points(case, probes)[where])
        kind = "closed form"
        words = (
            "The share of the sky that a ball hides from each point of the floor below it, "
            "weighted by the cosine, has a closed form. Only the floor is compared."
        )
    else:
        truth = _converged(case, options, folder)(probes.uvs)
        kind = "converged"
        words = f"texbake's own map of the same size with {_CONVERGED_RAYS:,} rays per texel."

    def judge(product: Product) -> Evaluation:
        found = lookup(_pixels(product), probes.uvs)[where, 0].astype(np.float64)
        errors = 100.0 * np.abs(found - truth)
        return Evaluation(
            float(np.sqrt(np.square(errors).mean())),
            figures={"error, 95th percentile (%)": float(np.quantile(errors, 0.95))},
        )

    size = options.one_size
    return Prepared(f"{case.subject}, at {size} x {size}", kind, words, _job(case, folder), judge)


def _converged(
    case: BenchCase, options: BenchOptions, folder: Path
) -> Callable[[FloatArray], FloatArray]:
    made = BakeOptions(
        size=options.one_size, maps=("ao",), secondary_rays=_CONVERGED_RAYS, front=case.reach,
        back=case.reach, padding=_PADDING,
    )  # fmt: skip
    values = bake(case.high, case.low, made).maps["ao"].values
    return lambda uvs: lookup(values, uvs)[:, 0].astype(np.float64)


AO_TASK = BenchTask(
    name="bake-ao",
    title="Bake ambient occlusion",
    about="Ambient occlusion of the high-poly mesh for the low-poly one, as EXR: rays spread over "
    "the hemisphere by the cosine, as far as the mesh is wide.",
    error="ambient light, root mean square",
    unit="%",
    prepare=_prepare_ao,
)


_ATLAS_SIZE, _GAP = 1024, 2  # texels


def _prepare_unwrap(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    mesh = case.low if case.build is None else case.build(options.amounts.unwrapped_triangles)
    name = f"{case.name} to unwrap"

    def judge(product: Product) -> Evaluation:
        return unwrap_error(_unwrapped(product.path))

    return Prepared(
        subject=f"{case.name}, {mesh.n_faces:,} triangles, {_GAP} texels between charts at "
        f"{_ATLAS_SIZE} x {_ATLAS_SIZE}",
        truth="exact values",
        truth_text="The stretch of every triangle and the area that the charts fill follow from "
        "the texture coordinates.",
        job={
            "mesh": mesh_file(mesh, folder, name),
            "size": _ATLAS_SIZE,
            "gap": _GAP,
            "padding": _GAP // 2,
        },
        judge=judge,
    )


def unwrap_error(mesh: Mesh) -> Evaluation:
    """Return the share of the texels that an atlas wastes, in percent; see `Distortion.wasted`."""
    found = distortion(mesh, _ATLAS_SIZE)
    stretch = found.turned_stretch  # of some atlases half the charts are mirrored
    return Evaluation(
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
    if case.high.n_faces <= min(options.amounts.counts):
        return None

    def judge(product: Product) -> Evaluation:
        mesh = read_mesh(product.path)
        apart = surface_distance(case.high, mesh, n_samples=options.amounts.n_probes)
        return Evaluation(
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


_LIGHT = (-0.4, 0.5, -0.77)  # the direction in which it shines, as seen from the camera
_SCENE = """\
[render]
width = {size}
height = {size}
background = [0, 0, 0]

[camera]
position = {eye}
target = {target}
up = {up}
fov = {fov}

[[lights]]
kind = "directional"
direction = {light}

[[objects]]
mesh = "{mesh}"
material = {{base_color = [1, 1, 1], shading = "lambert"}}
"""


def _prepare_preview(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    size = options.amounts.picture_size
    camera = Camera.framing(case.high, options=RenderOptions(width=size, height=size))
    light = pm.matmul(np.array(_LIGHT), camera.axes)
    truth = lambert_picture(case.high, case.surface, camera, size, -light / pm.norm(light))
    mesh = mesh_file(case.high, folder, f"{case.name} high")
    scene = folder / f"{case.name}.toml"
    numbers = {
        "eye": camera.eye.tolist(),
        "target": (camera.eye - camera.axes[2]).tolist(),
        "up": camera.axes[1].tolist(),
        "fov": math.degrees(camera.fov),
        "light": light.tolist(),
    }
    scene.write_text(_SCENE.format(size=size, mesh=Path(mesh).name, **numbers), encoding="utf-8")

    def judge(product: Product) -> Evaluation:
        picture = read_image(product.path, color=False).pixels[..., :3]
        return Evaluation(picture_error(np.maximum(picture, 0.0), truth), picture=picture)

    exact = "the closed form" if case.surface is not None else "the mesh's own normals"
    return Prepared(
        subject=f"{case.high.name}, {case.high.n_faces:,} triangles, {size} x {size} pixels",
        truth="closed form" if case.surface is not None else "rays",
        truth_text=f"{RAYS_PER_SIDE**2} rays per pixel, shaded with the normals of {exact}.",
        job={
            "mesh": mesh,
            "scene": str(scene),
            "size": size,
            "axes": camera.axes.tolist(),
            **{key: numbers[key] for key in ("eye", "fov", "light")},
        },
        judge=judge,
    )


PREVIEW_TASK = BenchTask(
    name="preview",
    title="Preview",
    about="A picture of the high-poly mesh as EXR, white and diffuse under one lamp infinitely far "
    "away, without shadows and bounces. Blender draws with Cycles.",
    error="picture, root mean square",
    unit="of 255",
    prepare=_prepare_preview,
)


TASKS = {
    task.name: task
    for task in (
        NORMALS_TASK, DISPLACEMENT_TASK, AO_TASK, UNWRAP_TASK, SIMPLIFY_TASK, PREVIEW_TASK,
    )
}  # fmt: skip
