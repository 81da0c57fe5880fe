"""Degenerate scenes: every picture is defined and free of NaN."""

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import (
    Ambient,
    AmbientOcclusion,
    Environment,
    Fog,
    Light,
    Lighting,
    Shadow,
)
from texbake.rendering.scene.material import Material, NormalMap, Reflection, Refraction
from texbake.rendering.scene.scene import Scene, SceneObject, transform_matrix
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture

SMALL = RenderOptions(width=32, height=24, supersampling=2)
EVERYTHING = Lighting(
    lights=(
        Light(direction=(-1, -2, -3), shadow=Shadow(size=64)),
        Light(kind="point", position=(1.0, 2.0, 2.0), shadow=Shadow(size=32)),
        Light(kind="spot", position=(2.0, 2, 2), direction=(-1, -1, -1), shadow=Shadow(size=64)),
    ),
    ambient=Ambient(color=(0.1, 0.1, 0.1), ground=(0.2, 0.1, 0.0)),
    environment=Environment(color=(0.5, 0.6, 0.7), lighting=True, size=8),
    occlusion=AmbientOcclusion(samples=4),
    fog=Fog(density=0.01),
)
TEXELS = np.random.default_rng(1).random((8, 8, 3)).astype(np.float32)
MATERIALS = (
    Material(roughness=0.0, metalness=1.0),
    Material(shading="blinn-phong", base_color=ImageTexture(image=TEXELS)),
    Material(shading="lambert", opacity=0.5, double_sided=True),
    Material(reflection=Reflection(fresnel=True), refraction=Refraction(strength=0.5)),
)


def finite_picture(scene, camera=None, options=SMALL, keep=("normals",)):
    camera = camera or Camera.framing(*(i.mesh for i in scene.objects), options=options)
    frame = draw(prepare(scene, options), camera, keep=keep)
    for values in frame.color, frame.coverage, *((frame.normals,) if keep else ()):
        assert np.isfinite(values).all()
    assert not np.isnan(frame.depths).any()
    return frame


def all_materials(mesh, **fields):
    for material in MATERIALS:
        yield Scene(
            objects=(SceneObject(mesh=mesh, material=material, **fields),), lighting=EVERYTHING
        )


IMAGES = {
    "one pixel": np.array([[[0.25, 0.5, 0.75]]], np.float32),
    "one row": np.array([[[0.25] * 3, [0.5] * 3, [0.75] * 3]], np.float32),
    "one channel": np.full((4, 4, 1), 0.5, np.float32),
    "flat": np.full((4, 4), 0.5, np.float32),
    "two channels": np.full((4, 4, 2), 0.5, np.float32),
    "nan": np.where(np.arange(16).reshape(4, 4, 1) % 3 == 0, np.nan, np.ones((4, 4, 3))),
    "infinite": np.full((4, 4, 3), np.inf, np.float32),
    "float64": np.full((4, 4, 3), 0.5),
    "bytes": np.full((4, 4, 3), 1, np.uint8),
}


@pytest.mark.parametrize("filter_name", ["nearest", "ewa"])
@pytest.mark.parametrize("name", IMAGES)
def test_images_of_odd_shapes_and_values(name, filter_name):
    image = ImageTexture(image=IMAGES[name], filter=filter_name)
    material = Material(base_color=image, roughness=image, emission=image, opacity=image)
    scene = Scene(
        objects=(SceneObject(mesh=plane(), material=material),),
        lighting=Lighting(lights=(Light(),)),
    )
    frame = finite_picture(scene)
    unlit = Scene(
        objects=(SceneObject(mesh=plane(), material=Material(shading="unlit", base_color=image)),)
    )
    seen = finite_picture(unlit, keep=())
    assert (seen.coverage == 1.0).sum() > 100 and frame.plan.has("images")
    if name in ("one pixel", "one channel", "flat", "float64", "two channels"):
        first = np.asarray(IMAGES[name], float).reshape(-1)[: 3 if name == "one pixel" else 1]
        inside = seen.color[seen.coverage == 1.0][:, :3]
        if name != "two channels":  # whose second is opacity
            np.testing.assert_allclose(inside, np.broadcast_to(first, inside.shape), rtol=1e-5)


@pytest.mark.parametrize("size", [1e9, 1e-9, 1e30])
def test_coordinates_of_a_billion(size):
    matrix = transform_matrix(scale=size, translate=(size, -3 * size, 2 * size))
    mesh = uv_sphere(12, 24)
    options = RenderOptions(width=32, height=24)
    reference = Mesh(
        positions=mesh.positions * size + size * np.array((1, -3, 2.0)), faces=mesh.faces
    )
    camera = Camera.framing(reference, options=options)
    plain_camera = Camera.framing(mesh, options=options)
    for scene, plain in zip(
        all_materials(mesh, transform=matrix), all_materials(mesh), strict=True
    ):
        frame = finite_picture(scene, camera, options)
        assert (
            (frame.coverage > 0) != (finite_picture(plain, plain_camera, options).coverage > 0)
        ).mean() < 0.01
    # Far from the origin: a unit at 1e9 has 1e-7 left of it.
    far = transform_matrix(translate=(1e9, 1e9, 1e9))
    moved = Mesh(positions=mesh.positions + 1e9, faces=mesh.faces)
    for scene in all_materials(mesh, transform=far):
        finite_picture(scene, Camera.framing(moved, options=options), options)


@pytest.mark.parametrize("make", [
    lambda bad: Material(base_color=(bad, 0.0, 0.0)),
    lambda bad: Material(roughness=bad),
    lambda bad: Material(shading="blinn-phong", exponent=bad),
    lambda bad: Material(opacity=bad),
    lambda bad: Material(emission=(0.0, bad, 0.0)),
    lambda bad: Reflection(strength=bad),
    lambda bad: Refraction(ior=bad),
    lambda bad: NormalMap(texture=ImageTexture(image=TEXELS), strength=bad),
    lambda bad: ImageTexture(image=TEXELS, factor=bad),
    lambda bad: ImageTexture(image=TEXELS, scale=(1.0, bad)),
    lambda bad: ProcedureTexture(procedure="noise", scale=bad),
    lambda bad: ProcedureTexture(procedure="noise", colors=((bad, 0.0, 0.0),)),
    lambda bad: Ambient(color=(bad, 0.0, 0.0)),
    lambda bad: Ambient(ground=(bad, 0.0, 0.0)),
    lambda bad: Environment(color=(0.0, 0.0, bad)),
    lambda bad: Fog(color=(0.0, bad, 0.0)),
])  # fmt: skip
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused_where_they_enter(make, bad):
    with pytest.raises(OptionError):
        make(bad)


@pytest.mark.parametrize("brightness", [1e20, 1e38, 1e300])
@pytest.mark.parametrize("shading", ["lambert", "blinn-phong", "metallic-roughness"])
def test_light_that_float32_does_not_hold_is_bounded(shading, brightness):
    color = (brightness, 1.0, 0.0)
    material = Material(
        shading=shading, base_color=color, specular=color, emission=color, opacity=0.5,
        reflection=Reflection(strength=brightness), double_sided=True,
    )  # fmt: skip
    lights = tuple(
        Light(kind="point", position=(0.0, 0.0, z), intensity=brightness, shadow=Shadow(size=16))
        for z in (1.0 + 1e-4, 3.0)
    )
    lighting = Lighting(lights=lights, environment=Environment(color=color, size=8, lighting=True))
    scene = Scene(objects=(SceneObject(mesh=uv_sphere(), material=material),), lighting=lighting)
    assert finite_picture(scene).color.max() > 1.0  # bright, and bounded all the same
