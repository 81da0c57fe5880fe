"""Bakes from the high-poly mesh onto the low-poly one: normals, heights and ambient occlusion.

Every program gets the same meshes, the same distances of its rays and the same padding. Maps are
judged as they are used: sampled bilinearly at points spread over the low-poly mesh, normals turned
from tangent space as a renderer does.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray
from texbake.mesh.normals import smooth_normals
from texbake.study.bench.cases import BenchCase, pair_files
from texbake.study.bench.options import BenchOptions
from texbake.study.bench.programs import Product
from texbake.study.bench.task import BenchTask, Prepared
from texbake.study.knob import Judgment
from texbake.study.truth.probes import Probes, angles_deg, probe, truth_of
from texbake.texture.encoding import decode_normals
from texbake.texture.image import read_image
from texbake.texture.lookup import lookup

_PADDING = 16
_CONVERGED_RAYS = 1024


def _job(case: BenchCase, folder: Path) -> dict[str, Any]:
    return {**pair_files(case, folder), "distance": case.reach, "padding": _PADDING}


def _pixels(product: Product) -> npt.NDArray[np.float32]:
    return np.ascontiguousarray(read_image(product.path, color=False).pixels[..., :3])


# Normals


def _prepare_normals(case: BenchCase, options: BenchOptions, folder: Path) -> Prepared:
    probes = probe(case.pair, options.n_probes)

    def judge(product: Product) -> Judgment:
        codes = _pixels(product)
        if product.form == "tangent":
            angles = probes.normal_errors(decode_normals(codes))
        else:
            read = lookup(2.0 * codes - 1.0, probes.uvs).astype(np.float64)
            angles = angles_deg(read, probes.normals)
        return Judgment(
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
    probes = probe(case.pair, options.n_probes)
    points, normals = _points(case, probes), _directions(case, probes)

    def judge(product: Product) -> Judgment:
        read = lookup(_pixels(product), probes.uvs).astype(np.float64)
        heights = read[:, 0]
        if product.form == "positions":
            heights = pm.vecdot(read - points, normals)
        errors = 100.0 * np.abs(heights - probes.heights) / case.low.diagonal
        return Judgment(
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
    probes = probe(case.pair, options.n_probes)
    where = np.ones(len(probes.faces), dtype=np.bool_)
    if case.openness is not None:
        where = probes.faces < case.floor
        truth = case.openness(_points(case, probes)[where])
        kind, words = (
            "closed form",
            (
                "The share of the sky that a ball hides from each point of the floor below it, "
                "weighted by the cosine, has a closed form. Only the floor is compared."
            ),
        )
    else:
        truth = _converged(case, options, folder)(probes.uvs)
        kind, words = (
            "converged",
            (f"texbake's own map of the same size with {_CONVERGED_RAYS:,} rays per texel."),
        )

    def judge(product: Product) -> Judgment:
        found = lookup(_pixels(product), probes.uvs)[where, 0].astype(np.float64)
        errors = 100.0 * np.abs(found - truth)
        return Judgment(
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
