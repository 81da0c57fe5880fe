"""Tasks of the bench: what a task is, and the maps that programs bake.

Bakes get the same meshes, distances of rays and padding. Maps are judged as they are used: sampled
bilinearly at points spread over the low-poly mesh, normals transformed from tangent space as a
renderer does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray
from texbake.records import dataclass
from texbake.study.bench.cases import BenchCase, pair_files
from texbake.study.bench.programs import Product
from texbake.study.knob import Evaluation
from texbake.study.options import BenchOptions
from texbake.study.truth.probes import angles_deg
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


MISSED = "missed texels (%)"
_PADDING = 16
_CONVERGED_RAYS = 1024


def _job(case: BenchCase, folder: Path) -> dict[str, Any]:
    return {**pair_files(case, folder), "distance": case.reach, "padding": _PADDING}


# Codes of 0 with 8 and 16 bits, rounded down and up, and as floats.
_FLAT = np.array([127 / 255, 128 / 255, 32767 / 65535, 32768 / 65535, 0.5], np.float32)


def _map_at(product: Product, uvs: FloatArray) -> tuple[Float32Array, BoolArray]:
    """Return a map, and for each point whether the nearest texel is black, transparent or flat."""
    pixels = read_image(product.path, color=False).pixels
    height, width = pixels.shape[:2]
    columns = np.clip((uvs[:, 0] * width).astype(np.int64), 0, width - 1)
    rows = np.clip(((1.0 - uvs[:, 1]) * height).astype(np.int64), 0, height - 1)
    nearest = pixels[rows, columns]
    is_empty = (nearest[:, :3] == 0.0).all(axis=1)
    if nearest.shape[1] == 4:
        is_empty |= nearest[:, 3] == 0.0
    if product.form == "tangent":
        is_empty |= np.isin(nearest[:, :2], _FLAT).all(axis=1)
    return np.ascontiguousarray(pixels[..., :3]), is_empty


def _judged_by_rays(
    case: BenchCase, folder: Path, judge: Callable[[Product], Evaluation]
) -> Prepared:
    """Prepare a task whose truth is what rays of the case hit."""
    points = "From points spread evenly over the low-poly mesh, rays are followed "
    if case.surface is None:
        truth = "rays"
        about = (
            f"{points}to the high-poly mesh; their hits are the truth, without a texture between."
        )
    else:
        truth = "closed form"
        about = (
            f"{points}to the formula that the high-poly mesh was made from, and to no mesh; the "
            "normal and the height there are the truth. Points are left out if their ray meets "
            "nothing."
        )
    return Prepared(case.subject, truth, about, _job(case, folder), judge)


# Normals


# A normal that is farther off than this is wrong, whatever the size of the map.
_WRONG_DEG = 30.0
# A texel that has the value of an empty one counts as missed if it is this far off.
_MISSED_DEG = 2.0
_MISSED_HEIGHT = 0.1  # % of diagonal


def _prepare_normals(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    probes = case.probes(options.amounts.n_probes)

    def judge(product: Product) -> Evaluation:
        codes, is_empty = _map_at(product, probes.uvs)
        if product.form == "object":
            read = lookup(2.0 * codes - 1.0, probes.uvs).astype(np.float64)
            angles = angles_deg(read, probes.normals)
        else:
            angles = probes.normal_errors(decode_normals(codes))
        return Evaluation(
            float(angles.mean()),
            figures={
                "angle, median (°)": float(np.median(angles)),
                "angle, 99th percentile (°)": float(np.quantile(angles, 0.99)),
                f"over {_WRONG_DEG:g}° (%)": 100.0 * float((angles > _WRONG_DEG).mean()),
                MISSED: 100.0 * float((is_empty & (angles > _MISSED_DEG)).mean()),
            },
        )

    return _judged_by_rays(case, folder, judge)


NORMALS_TASK = BenchTask(
    name="bake-normals",
    title="Bake normals",
    about="A normal map of the high-poly mesh for the low-poly one, from mesh files to a PNG file "
    "with 16 texels of padding: 16 bits and tangent space, in pymeshlab 8 bits and object space. "
    "Further samples of Blender shade the same hit again and cast no more rays; 16 of them cost it "
    "0.4 to 0.7 s and do not lower its error. Compare programs at equal error, not equal samples.",
    error="angle of the normal, mean",
    unit="°",
    prepare=_prepare_normals,
)


# Heights


def _prepare_displacement(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    probes = case.probes(options.amounts.n_probes)

    def judge(product: Product) -> Evaluation:
        values, is_empty = _map_at(product, probes.uvs)
        read = lookup(values, probes.uvs).astype(np.float64)
        heights = read[:, 0]
        if product.form == "positions":
            heights = pm.vecdot(read - probes.points, probes.outward)
        errors = 100.0 * np.abs(heights - probes.heights) / case.low.diagonal
        return Evaluation(
            float(errors.mean()),
            figures={
                "height, median (% of diagonal)": float(np.median(errors)),
                "height, 99th percentile (% of diagonal)": float(np.quantile(errors, 0.99)),
                MISSED: 100.0 * float((is_empty & (errors > _MISSED_HEIGHT)).mean()),
            },
        )

    return _judged_by_rays(case, folder, judge)


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
    probes = case.probes(options.amounts.n_probes)
    where = np.ones(len(probes.faces), dtype=np.bool_)
    if case.openness is not None:
        where = probes.faces < case.floor
        truth = case.openness(probes.points[where])
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
        found = lookup(_map_at(product, probes.uvs)[0], probes.uvs)[where, 0].astype(np.float64)
        errors = 100.0 * np.abs(found - truth)
        return Evaluation(
            float(np.sqrt(np.square(errors).mean())),
            figures={"error, 99th percentile (%)": float(np.quantile(errors, 0.99))},
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
