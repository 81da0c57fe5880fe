"""Knobs of textures: how they are filtered, where a pixel looks them up, and noise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray, Mesh
from texbake.mesh.shapes import plane
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.resolve import picture_error
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene, SceneObject, camera_of
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.knob import Case, Evaluation, Experiment, Knob, Setting
from texbake.study.truth.pictures import Floor, crop, has_image, with_width
from texbake.texture.checker import checker_image
from texbake.texture.encoding import encode_srgb
from texbake.texture.mipmaps import mip_chain, single_level
from texbake.texture.procedures.noise import fractal_sum
from texbake.texture.sample import sample

_PER_SIDE = 16  # lookups of the truth along each side of a pixel
_PLAIN = ("nearest", "bilinear", "bicubic", "trilinear")
_ANISOTROPIES = (2, 4, 8, 16)
_SCENE_FILTERS = (*_PLAIN, "ewa")


def _prepare_texture_lookup(case: Case) -> Experiment:
    if case.scene is not None and has_image(case.scene):
        return _on_scene(case.scene, case)
    floor = Floor(width=case.choose(640, 96), height=case.choose(360, 64))
    chain = mip_chain(checker_image(case.choose(1024, 128), 8), threads=case.threads)
    finest = single_level(chain.level(0))
    uvs, changes = floor.uvs(), floor.changes()

    def picture(values: Float32Array) -> Float32Array:
        return values.reshape(floor.height, floor.width, -1)

    def work(value: tuple[str, float]) -> Float32Array:
        name, most = value
        return picture(
            sample(chain, uvs, changes, filter=name, max_anisotropy=most, threads=case.threads)
        )

    total = np.zeros((len(uvs), chain.n_channels))
    for right, down in _within_pixel(_PER_SIDE):
        total += sample(finest, floor.uvs(right, down), filter="bilinear", threads=case.threads)
    truth = picture((total / _PER_SIDE**2).astype(np.float32))

    def judge(value: tuple[str, float], image: Float32Array) -> Evaluation:
        return Evaluation(picture_error(image, truth), crop(image, (0.5, 0.0)))

    values = [(name, 16.0) for name in _PLAIN] + [("ewa", float(n)) for n in _ANISOTROPIES]
    return Experiment(
        subject=f"a checkered floor to the horizon, {floor.width} x {floor.height} pixels",
        truth="converged",
        truth_text=f"The mean of {_PER_SIDE**2} lookups in each pixel at exact coordinates, in "
        "the finest level only.",
        settings=tuple(
            Setting(f"EWA {most:.0f}" if name == "ewa" else name, (name, most), name)
            for name, most in values
        ),
        work=work,
        judge=judge,
    )


def _within_pixel(n: int) -> list[tuple[float, float]]:
    """Return places within a pixel on a grid, relative to its middle."""
    steps = ((np.arange(n) + 0.5) / n - 0.5).tolist()
    return [(right, down) for down in steps for right in steps]


def _on_scene(scene: Scene, case: Case) -> Experiment:
    options = with_width(scene.options(supersampling=4, buffer=None), case.choose(480, 64))
    camera = camera_of(scene, options)
    finest = replace(options, supersampling=case.choose(16, 4), edges="supersample")

    def drawn(name: str, choices: RenderOptions = options) -> Float32Array:
        chosen = replace(choices, filter=name)
        return render_scene(scene, chosen, camera=camera, threads=case.threads).color

    truth = drawn("bilinear", finest)

    def judge(name: str, image: Float32Array) -> Evaluation:
        return Evaluation(picture_error(image, truth), crop(image))

    return Experiment(
        subject=f"{scene.name}, {options.width} x {options.height} pixels",
        truth="converged",
        truth_text=f"{finest.supersampling**2} samples in each pixel, shaded one by one. The "
        "settings shade a pixel inside a triangle once, and edges with 16 samples.",
        settings=tuple(Setting(name, name, name) for name in _SCENE_FILTERS),
        work=drawn,
        judge=judge,
    )


TEXTURE_LOOKUP_KNOB = Knob(
    name="texture-lookup",
    title="Texture lookup",
    about="How the part of a texture that a pixel covers is averaged: one texel, four, mip levels, "
    "or an ellipse up to 16 times as long as wide (EWA).",
    error="picture, root mean square",
    unit="of 255",
    kind="picture",
    prepare=_prepare_texture_lookup,
)


_TEXELS = 1024
_PARTS = (1, 2, 4, 8, 16, 32)
_QUICK_PARTS = (1, 2, 4)
_EXACT = ("perspective", "scanline")


def _prepare_interpolation(case: Case) -> Experiment:
    floor = Floor(width=case.choose(640, 96), height=case.choose(480, 72))
    truth = floor.uvs()
    inside = ((truth > 0.0) & (truth < 1.0)).all(axis=1).reshape(floor.height, floor.width)
    options = RenderOptions(width=floor.width, height=floor.height, supersampling=1)
    values = [("affine", n) for n in case.choose(_PARTS, _QUICK_PARTS)]
    values += [(name, 1) for name in _EXACT]
    material = Material(
        shading="unlit", base_color=ImageTexture(image=checker_image(256, 8), filter="trilinear")
    )
    scenes = {
        n: Scene(objects=(SceneObject(mesh=_tile(n), material=material),))
        for n in {n for _, n in values}
    }

    def drawn(value: tuple[str, int], buffer: str | None) -> Float32Array:
        name, n = value
        choices = replace(options, interpolation=name, buffer=buffer)
        return draw(prepare(scenes[n], choices, threads=case.threads), floor.camera).color

    def work(value: tuple[str, int]) -> Float32Array:
        return drawn(value, "uv")

    def judge(value: tuple[str, int], image: Float32Array) -> Evaluation:
        uvs = encode_srgb(image[..., :2]).astype(np.float64)[inside]
        off = _TEXELS * pm.norm(uvs - truth.reshape(*inside.shape, 2)[inside], axis=-1)
        return Evaluation(
            error=float(off.mean()),
            picture=crop(drawn(value, None), (0.65, 0.75)),
            figures={"maximum (texels)": float(off.max())},
        )

    return Experiment(
        subject=f"a square tile of a floor, {floor.width} x {floor.height} pixels",
        truth="closed form",
        truth_text="Where each pixel's ray meets the floor. Coordinates are read from a picture of "
        f"them, which is exact to about a thousandth of a texel of {_TEXELS} x {_TEXELS}.",
        settings=tuple(
            Setting(f"{name}, {n} x {n}" if name == "affine" else name, (name, n), name)
            for name, n in values
        ),
        work=work,
        judge=judge,
    )


def _tile(n: int) -> Mesh:
    """Return a square of n x n parts on the floor, between coordinates (0, 0) and (1, 1)."""
    flat = plane(n, n)
    x, y, _ = flat.positions.T
    return flat.replace(positions=np.stack([x, np.zeros_like(x), -y], axis=1))


INTERPOLATION_KNOB = Knob(
    name="interpolation",
    title="Interpolation of coordinates",
    about="Interpolation that is linear on the screen (affine) is wrong in perspective; dividing "
    "the square into more triangles reduces the error. Dividing by w, or doing so step by step "
    "along scanlines, is exact at once.",
    error="place on the texture, mean",
    unit="texels",
    kind="texels",
    prepare=_prepare_interpolation,
)


_TRUTH_OCTAVES = 16
_OCTAVES = (1, 2, 3, 4, 6, 8, 10, 12)
_QUICK_OCTAVES = (1, 3, 6)
# Distance in cells from the origin, as in a scene that was modeled far away from it.
_AWAY = 10_000.0
_CELLS = 6.0  # along one side of the picture
_TYPES = {"float64": np.float64, "float32": np.float32}


def _prepare_noise(case: Case) -> Experiment:
    side = case.choose(512, 64)
    steps = (np.arange(side) + 0.5) * (_CELLS / side) + _AWAY
    x, y = np.meshgrid(steps, steps)
    points = np.stack([x.ravel(), y.ravel(), np.full(side * side, 0.37)], axis=1)
    stored = {name: np.ascontiguousarray(points, kind) for name, kind in _TYPES.items()}

    def values(name: str, octaves: int) -> FloatArray:
        return fractal_sum(stored[name], octaves=octaves, threads=case.threads)

    truth = values("float64", _TRUTH_OCTAVES)

    def judge(value: tuple[str, int], sums: FloatArray) -> Evaluation:
        off = sums - truth
        picture = np.repeat((0.5 + 0.6 * sums).reshape(side, side, 1), 3, axis=2)
        return Evaluation(
            error=float(np.sqrt(np.square(off).mean())),
            picture=crop(np.clip(picture, 0.0, 1.0).astype(np.float32)),
            figures={
                "maximum": float(np.abs(off).max()),
                "coordinates (MB)": stored[value[0]].nbytes / 1e6,
            },
        )

    def work(value: tuple[str, int]) -> Any:
        return values(*value)

    return Experiment(
        subject=f"fractal noise at {side * side:,} points, {_AWAY:,.0f} cells from the origin",
        truth="converged",
        truth_text=f"The sum of {_TRUTH_OCTAVES} octaves in float64; it leaves out 2^-"
        f"{_TRUTH_OCTAVES} of the first octave.",
        settings=tuple(
            Setting(f"{octaves}, {name}", (name, octaves), name)
            for octaves in case.choose(_OCTAVES, _QUICK_OCTAVES)
            for name in _TYPES
        ),
        work=work,
        judge=judge,
    )


NOISE_KNOB = Knob(
    name="noise",
    title="Octaves of noise; float32 and float64",
    about="Each octave halves what is still missing and costs as much as the first. Coordinates in "
    "float32 take half the memory, but far from the origin their last bits are as coarse as the "
    "finest octaves, so that more octaves gain nothing. Sums are computed in float64 either way.",
    error="value, root mean square, in heights of the first octave",
    unit="",
    kind="value",
    prepare=_prepare_noise,
)
