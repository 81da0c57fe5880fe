"""How coordinates are interpolated over a triangle in the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.floor import Floor
from texbake.study.truth.pictures import crop
from texbake.texture.checker import checker_image
from texbake.texture.encoding import encode_srgb

_TEXELS = 1024
_PARTS = (1, 2, 4, 8, 16, 32)
_QUICK_PARTS = (1, 2, 4)
_EXACT = ("perspective", "scanline")


def _prepare(case: Case) -> Bench:
    floor = Floor(width=case.choose(640, 96), height=case.choose(480, 72))
    truth = floor.uvs()
    inside = ((truth > 0.0) & (truth < 1.0)).all(axis=1).reshape(floor.height, floor.width)
    options = RenderOptions(width=floor.width, height=floor.height, supersampling=1)
    values = [("affine", n) for n in case.choose(_PARTS, _QUICK_PARTS)]
    values += [(name, 1) for name in _EXACT]
    material = Material(
        shading="unlit",
        base_color=ImageTexture(image=checker_image(256, 8), filter="trilinear"),
    )
    scenes = {
        n: Scene(objects=(SceneObject(mesh=_tile(n), material=material),))
        for n in {n for _, n in values}
    }

    def drawn(value: tuple[str, int], buffer: str | None) -> npt.NDArray[np.float32]:
        name, n = value
        choices = replace(options, interpolation=name, buffer=buffer)
        return draw(prepare(scenes[n], choices, threads=case.threads), floor.camera).color

    def work(value: tuple[str, int]) -> npt.NDArray[np.float32]:
        return drawn(value, "uv")

    def judge(value: tuple[str, int], image: npt.NDArray[np.float32]) -> Outcome:
        uvs = encode_srgb(image[..., :2]).astype(np.float64)[inside]
        off = _TEXELS * np.linalg.norm(uvs - truth.reshape(*inside.shape, 2)[inside], axis=-1)
        return Outcome(
            error=float(off.mean()),
            picture=crop(drawn(value, None), (0.65, 0.75)),
            figures={"maximum (texels)": float(off.max())},
        )

    return Bench(
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
    """Square of n x n parts on the floor, from its coordinates (0, 0) to (1, 1)."""
    flat = plane(n, n)
    x, y, _ = flat.positions.T
    return flat.replace(positions=np.stack([x, np.zeros_like(x), -y], axis=1))


KNOB = Knob(
    name="interpolation",
    title="Interpolation of coordinates",
    about="Linear on the screen (affine) is wrong in perspective; cutting the square into more "
    "triangles makes it less so. Dividing by w, or doing so step by step along scanlines, is right "
    "at once.",
    error="place on the texture, mean",
    unit="texels",
    kind="texels",
    needs="nothing",
    prepare=_prepare,
)
