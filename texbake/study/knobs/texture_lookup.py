"""Filter of texture lookups."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene.view import camera_of
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.floor import Floor
from texbake.study.truth.pictures import crop, picture_error
from texbake.study.truth.scenes import has_image, with_width
from texbake.texture.checker import checker_image
from texbake.texture.mipmaps import mip_chain, single_level
from texbake.texture.sample import sample

_PER_SIDE = 16  # lookups of the truth, along each side of a pixel
_PLAIN = ("nearest", "bilinear", "bicubic", "trilinear")
_ANISOTROPIES = (2, 4, 8, 16)
_SCENE_FILTERS = (*_PLAIN, "ewa")


def _prepare(case: Case) -> Bench:
    if case.scene is not None and has_image(case.scene):
        return _on_scene(case.scene, case)
    floor = Floor(width=case.choose(640, 96), height=case.choose(360, 64))
    chain = mip_chain(checker_image(case.choose(1024, 128), 8), threads=case.threads)
    finest = single_level(chain.level(0))
    uvs, changes = floor.uvs(), floor.changes()

    def picture(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        return values.reshape(floor.height, floor.width, -1)

    def work(value: tuple[str, float]) -> npt.NDArray[np.float32]:
        name, most = value
        return picture(
            sample(chain, uvs, changes, filter=name, max_anisotropy=most, threads=case.threads)
        )

    total = np.zeros((len(uvs), chain.n_channels))
    for right, down in _within_pixel(_PER_SIDE):
        there = floor.uvs(right, down)
        total += sample(finest, there, filter="bilinear", threads=case.threads)
    truth = picture((total / _PER_SIDE**2).astype(np.float32))

    def judge(value: tuple[str, float], image: npt.NDArray[np.float32]) -> Outcome:
        return Outcome(picture_error(image, truth), crop(image, (0.5, 0.0)))

    values = [(name, 16.0) for name in _PLAIN] + [("ewa", float(n)) for n in _ANISOTROPIES]
    return Bench(
        subject=f"a checkered floor to the horizon, {floor.width} x {floor.height} pixels",
        truth="converged",
        truth_text=f"{_PER_SIDE**2} lookups in each pixel at exact coordinates, in the finest "
        "level alone, averaged.",
        settings=tuple(
            Setting(f"EWA {most:.0f}" if name == "ewa" else name, (name, most), name)
            for name, most in values
        ),
        work=work,
        judge=judge,
    )


def _within_pixel(n: int) -> list[tuple[float, float]]:
    """Places within a pixel, from its middle, on a grid."""
    steps = ((np.arange(n) + 0.5) / n - 0.5).tolist()
    return [(right, down) for down in steps for right in steps]


def _on_scene(scene: Scene, case: Case) -> Bench:
    options = with_width(scene.options(supersampling=4, buffer=None), case.choose(480, 64))
    camera = camera_of(scene, options)
    finest = replace(options, supersampling=case.choose(16, 4), edges="supersample")

    def drawn(name: str, choices: RenderOptions = options) -> npt.NDArray[np.float32]:
        chosen = replace(choices, filter=name)
        return render_scene(scene, chosen, camera=camera, threads=case.threads).color

    truth = drawn("bilinear", finest)

    def judge(name: str, image: npt.NDArray[np.float32]) -> Outcome:
        return Outcome(picture_error(image, truth), crop(image))

    return Bench(
        subject=f"{scene.name}, {options.width} x {options.height} pixels",
        truth="converged",
        truth_text=f"{finest.supersampling**2} samples in each pixel, shaded one by one. The "
        "settings shade a pixel inside a triangle once, and edges with 16 samples.",
        settings=tuple(Setting(name, name, name) for name in _SCENE_FILTERS),
        work=drawn,
        judge=judge,
    )


KNOB = Knob(
    name="texture-lookup",
    title="Texture lookup",
    about="What stands for a pixel's share of a texture: one texel, four, mip levels, or an "
    "ellipse of up to 16 times its width (EWA).",
    error="picture, root mean square",
    unit="of 255",
    kind="picture",
    needs="scene",
    prepare=_prepare,
)
