"""Knobs of the low-poly mesh: its triangles, its charts, and the rays that leave it."""

from __future__ import annotations

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.baking.result import BakeResult
from texbake.core import portable_math as pm
from texbake.mapping.distortion import distortion
from texbake.mapping.seams import seam_edges
from texbake.mapping.unwrap import unwrap
from texbake.mesh.distance import surface_distance
from texbake.mesh.mesh import Float32Array, FloatArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.mesh.simplify import simplify
from texbake.rendering.compare import compare
from texbake.rendering.options import RenderOptions
from texbake.study.knob import Case, Evaluation, Experiment, Knob, NotApplicable, Setting, StudyPair
from texbake.study.truth.pictures import close_up, crop
from texbake.study.truth.probes import angles_deg, probe
from texbake.texture.lookup import lookup
from texbake.texture.mipmaps import mip_chain

_COUNTS = (100, 500, 2_000, 10_000, 50_000)
_QUICK_COUNTS = (50, 200)
_QUALITIES = ("fast", "best")
# With more triangles unwrapping takes longer than all the rest, and no angle is measured.
_MOST_UNWRAPPED = 10_000


def _prepare_low_poly(case: Case) -> Experiment | NotApplicable:
    pair = case.pair
    size = case.choose(1024, 64)
    counts = [n for n in case.choose(_COUNTS, _QUICK_COUNTS) if n < pair.high.n_faces]
    if not counts:
        return NotApplicable(
            f"{pair.high.name} has {pair.high.n_faces} triangles, too few to be simplified to any "
            "of the counts that are tried"
        )

    def work(value: tuple[int, str]) -> Mesh:
        count, quality = value
        return simplify(pair.high, count, quality=quality, threads=case.threads)

    def judge(value: tuple[int, str], low: Mesh) -> Evaluation:
        samples = case.choose(50_000, 2_000)
        distance = surface_distance(pair.high, low, n_samples=samples, threads=case.threads)
        figures = {
            "triangles": float(low.n_faces),
            "distance, maximum (% of diagonal)": 100.0 * distance.max_relative,
        }
        if low.n_faces > _MOST_UNWRAPPED:
            return Evaluation(
                100.0 * distance.mean_relative, close_up(low, zoom=1.0), figures=figures
            )
        mapped = unwrap(low, quality="fast", size=size, threads=case.threads)
        baked = bake(pair.high, mapped, BakeOptions(size=size, threads=case.threads))
        normals = baked.maps["normal"].values
        probes = probe(
            StudyPair(pair.high, mapped, "", pair.surface), case.choose(50_000, 2_000),
            threads=case.threads,
        )  # fmt: skip
        figures["angle after the bake, mean (°)"] = float(np.mean(probes.normal_errors(normals)))
        picture = close_up(mapped, normal_map=normals, zoom=1.0, threads=case.threads)
        return Evaluation(100.0 * distance.mean_relative, picture, figures)

    return Experiment(
        subject=f"{pair.high.name}, {pair.high.n_faces:,} triangles",
        truth="high-poly mesh",
        truth_text="The high-poly mesh itself: distances between both surfaces, in both "
        f"directions. Angles are those of a {size} x {size} map baked onto the low-poly mesh, for "
        f"up to {_MOST_UNWRAPPED:,} triangles.",
        settings=tuple(
            Setting(f"{n:,} {quality}", (n, quality), quality)
            for n in counts
            for quality in _QUALITIES
        ),
        work=work,
        judge=judge,
    )


LOW_POLY_KNOB = Knob(
    name="low-poly",
    title="Low-poly mesh",
    about="How many triangles the high-poly mesh is simplified to, and by which method. The normal "
    "map restores what the triangles leave out in the shading, but not in the silhouette.",
    error="distance between the surfaces, mean",
    unit="% of diagonal",
    kind="length",
    prepare=_prepare_low_poly,
)


_LEVELS = (0, 2, 4)
# Points along each seam edge.
_ALONG = (np.arange(4) + 0.5) / 4.0


def _prepare_atlas_quality(case: Case) -> Experiment:
    # Only the surface counts: normals with hard edges would be additional seams.
    mesh = case.pair.low.replace(
        uvs=None, uv_faces=None, normals=None, normal_faces=None, tangents=None
    )
    size = case.choose(1024, 128)
    values = [("fast", 4), ("good", 4)]
    values += [] if case.quick else [("best", 4), ("good", 1), ("good", 16)]

    def work(value: tuple[str, int]) -> Mesh:
        quality, padding = value
        return unwrap(mesh, quality=quality, padding=padding, size=size, threads=case.threads)

    def judge(value: tuple[str, int], mapped: Mesh) -> Evaluation:
        measured = distortion(mapped)
        seams = _seam_errors(mapped, size, value[1], case.threads)
        return Evaluation(
            error=100.0 * measured.wasted,
            picture=_layout(mapped, case.threads),
            figures={
                "charts": float(measured.n_charts),
                "seams (diagonals)": measured.seam_length / mapped.diagonal,
                "texture filled (%)": 100.0 * measured.fill,
                "stretch (L2)": measured.stretch.l2,
                **{f"seam error, mip level {k} (°)": seams[k] for k in seams},
                "stretch, worst direction (Linf)": measured.stretch.linf,
            },
        )

    return Experiment(
        subject=f"{mesh.name}, {mesh.n_faces:,} triangles, at {size} x {size}",
        truth="closed form",
        truth_text="A mapping without stretch that fills the square wastes no texels: an L2 "
        "stretch of 1 (Sander et al. 2001). A smooth surface has one normal across a seam; what is "
        "read on either side is off by the seam error.",
        settings=tuple(
            Setting(f"{quality}, padding {padding}", (quality, padding), f"padding {padding}")
            for quality, padding in values
        ),
        work=work,
        judge=judge,
    )


def _seam_errors(mesh: Mesh, size: int, padding: int, threads: int | None) -> dict[int, float]:
    """Return the mean angles between normals read along seams and the true ones, by mip level."""
    options = BakeOptions(
        size=size, space="object", padding=padding, fill="push-pull", threads=threads
    )
    normals = bake(mesh, mesh, options).maps["normal"].values
    chain = mip_chain(normals, kind="normal", wrap="clamp", threads=threads)
    uvs, truth = _seam_points(mesh)
    if len(uvs) == 0:
        return dict.fromkeys(_LEVELS, 0.0)
    errors = {}
    for level in _LEVELS:
        read = lookup(chain.level(level), uvs, wrap="clamp", threads=threads)
        errors[level] = float(angles_deg(read.astype(np.float64), truth).mean())
    return errors


def _seam_points(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Return (n, 2) coordinates of points along both sides of seams, and their (n, 3) normals."""
    faces, corners = np.nonzero(seam_edges(mesh))
    after = (corners + 1) % 3
    normals, uvs = smooth_normals(mesh)[mesh.faces], mesh.corner_uvs()
    points = [
        (
            (1.0 - share) * uvs[faces, corners] + share * uvs[faces, after],
            (1.0 - share) * normals[faces, corners] + share * normals[faces, after],
        )
        for share in _ALONG
    ]
    places = np.concatenate([place for place, _ in points])
    truth = np.concatenate([normal for _, normal in points])
    lengths = pm.norm(truth, axis=1)
    kept = lengths > 0.0
    return places[kept], truth[kept] / lengths[kept, None]


def _layout(mesh: Mesh, threads: int | None) -> Float32Array:
    """Draw the charts in texture space, colored by the normals of the surface."""
    options = BakeOptions(size=400, space="object", padding=0, threads=threads)
    normals = bake(mesh, mesh, options).maps["normal"].values
    shown = np.where(np.any(normals != 0.0, axis=2, keepdims=True), 0.5 * normals + 0.5, 0.02)
    return crop(shown.reshape(200, 2, 200, 2, 3).mean(axis=(1, 3)).astype(np.float32))


ATLAS_QUALITY_KNOB = Knob(
    name="atlas-quality",
    title="Atlas quality",
    about="How much time goes into cutting, flattening and packing charts, and how many texels lie "
    "around each. Stretch makes texels unequal; the best quality allows more of it for fewer "
    "charts. Padding keeps neighboring charts out of the smaller mip levels.",
    error="texels wasted by stretch and gaps",
    unit="%",
    kind="wasted texels",
    prepare=_prepare_atlas_quality,
)


_DIRECTIONS = ("face", "vertex", "smooth", "cage")
_VIEWS = ((30.0, 20.0), (150.0, -20.0), (270.0, 20.0))


def _prepare_ray_direction(case: Case) -> Experiment:
    pair = case.pair
    size = case.choose(1024, 64)
    cage, back = _cage(pair.high, pair.low, case.threads)
    pixels = case.choose(480, 64)
    options = RenderOptions(width=pixels, height=pixels, supersampling=1)

    def work(direction: str) -> BakeResult:
        if direction == "cage":
            bakes = BakeOptions(size=size, back=back, threads=case.threads)
            return bake(pair.high, pair.low, bakes, cage=cage)
        bakes = BakeOptions(size=size, rays=direction, threads=case.threads)
        return bake(pair.high, pair.low, bakes)

    def judge(direction: str, result: BakeResult) -> Evaluation:
        normals = result.maps["normal"].values
        seen = compare(
            pair.high,
            pair.low,
            normal_map=normals,
            options=options,
            views=_VIEWS[: case.choose(3, 1)],
            threads=case.threads,
        ).mapped
        report = result.report
        return Evaluation(
            error=seen.mean_deg,
            picture=close_up(pair.low, normal_map=normals, threads=case.threads),
            figures={
                "angle, 95th percentile (°)": seen.p95_deg,
                "texels missed (%)": 100.0 * report.texels_missed / report.texels_covered,
            },
        )

    return Experiment(
        subject=f"{pair.subject}, at {size} x {size}",
        truth="high-poly mesh",
        truth_text="Pictures of the high-poly mesh itself, pixel by pixel: no direction of rays is "
        "assumed to be the right one.",
        settings=tuple(Setting(name, name) for name in _DIRECTIONS),
        work=work,
        judge=judge,
    )


def _cage(high: Mesh, low: Mesh, threads: int | None) -> tuple[Mesh, float]:
    """Return the low-poly mesh moved out by the front distance of a bake, and its back distance."""
    measured = bake(high, low, BakeOptions(size=32, threads=threads)).report
    moved = low.positions + (measured.front or 0.0) * smooth_normals(low)
    return low.replace(positions=moved, name="cage"), measured.back


RAY_DIRECTION_KNOB = Knob(
    name="ray-direction",
    title="Ray direction",
    about="The direction in which the ray of a texel is cast. Rays along face normals leave gaps "
    "or overlap between neighboring faces; the normals of the low-poly mesh split at hard edges; "
    "smooth normals and cages leave no gaps. All of them cost the same.",
    error="angle between shading normals in pictures, mean",
    unit="°",
    kind="angle",
    prepare=_prepare_ray_direction,
)
