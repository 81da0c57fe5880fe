"""Quality of an atlas, and the padding about its charts."""

from __future__ import annotations

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.mapping.distortion import distortion
from texbake.mapping.seams import seam_edges
from texbake.mapping.unwrap import unwrap
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import FloatImage, crop
from texbake.study.truth.probes import angles_deg
from texbake.texture.lookup import lookup
from texbake.texture.mipmaps import mip_chain

_LEVELS = (0, 2, 4)
# Points along each seam edge.
_ALONG = (np.arange(4) + 0.5) / 4.0


def _prepare(case: Case) -> Bench:
    # Only the surface counts: own normals with hard edges would be seams of their own.
    mesh = case.pair.low.replace(
        uvs=None, uv_faces=None, normals=None, normal_faces=None, tangents=None
    )
    size = case.choose(1024, 128)
    values = [("fast", 4), ("good", 4)]
    values += [] if case.quick else [("best", 4), ("good", 1), ("good", 16)]

    def work(value: tuple[str, int]) -> Mesh:
        quality, padding = value
        return unwrap(mesh, quality=quality, padding=padding, size=size, threads=case.threads)

    def judge(value: tuple[str, int], mapped: Mesh) -> Outcome:
        measured = distortion(mapped)
        seams = _seam_errors(mapped, size, value[1], case.threads)
        return Outcome(
            error=100.0 * (measured.stretch.l2 - 1.0),
            picture=_layout(mapped, case.threads),
            figures={
                "charts": float(measured.n_charts),
                "seams (diagonals)": measured.seam_length / mapped.diagonal,
                "texture filled (%)": 100.0 * measured.fill,
                **{f"seam error, mip level {k} (°)": seams[k] for k in seams},
                "stretch, worst direction (Linf)": measured.stretch.linf,
            },
        )

    return Bench(
        subject=f"{mesh.name}, {mesh.n_faces:,} triangles, at {size} x {size}",
        truth="closed form",
        truth_text="A map without stretch has an L2 stretch of 1 (Sander et al. 2001). Across a "
        "seam a smooth surface has one normal; what is read on either side is off by the seam "
        "error.",
        settings=tuple(
            Setting(f"{quality}, padding {padding}", (quality, padding), f"padding {padding}")
            for quality, padding in values
        ),
        work=work,
        judge=judge,
    )


def _seam_errors(mesh: Mesh, size: int, padding: int, threads: int | None) -> dict[int, float]:
    """Mean angle to the surface's normal of what is read along seams, on some mip levels."""
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
    """Points along both sides of seams: (n, 2) coordinates, and (n, 3) normals of the surface."""
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
    lengths = np.linalg.norm(truth, axis=1)
    kept = lengths > 0.0
    return places[kept], truth[kept] / lengths[kept, None]


def _layout(mesh: Mesh, threads: int | None) -> FloatImage:
    """Charts in texture space, colored by the normals of the surface."""
    options = BakeOptions(size=400, space="object", padding=0, threads=threads)
    normals = bake(mesh, mesh, options).maps["normal"].values
    shown = np.where(np.any(normals != 0.0, axis=2, keepdims=True), 0.5 * normals + 0.5, 0.02)
    return crop(shown.reshape(200, 2, 200, 2, 3).mean(axis=(1, 3)).astype(np.float32))


KNOB = Knob(
    name="atlas-quality",
    title="Atlas quality",
    about="How long charts are cut, flattened and packed, and how many texels lie around each. "
    "Stretch makes texels unequal; the best quality allows more of it for fewer charts. Padding "
    "keeps neighbors out of the smaller mip levels.",
    error="L2 stretch above that of a map without any",
    unit="%",
    kind="stretch",
    needs="pair",
    prepare=_prepare,
)
