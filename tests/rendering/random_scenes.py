"""Random scenes over all keys.

A scene follows from its seed alone. About a third of all values are at their neutral end, such as a
strength of 0 or a black color, because these are what a plan has to recognize.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.options import MAPPING_ORDERS, RenderOptions
from texbake.rendering.scene.lights import (
    FOG_MODES,
    GATES,
    KINDS,
    Ambient,
    AmbientOcclusion,
    Environment,
    Fog,
    Light,
    Lighting,
    Shadow,
)
from texbake.rendering.scene.material import (
    ALPHA_MODES,
    BUMP_FORMS,
    DIFFERENCES,
    LIGHT_SPACES,
    SHADING_RATES,
    SHADINGS,
    BumpMap,
    Displacement,
    Material,
    NormalMap,
    Parallax,
    Reflection,
    Refraction,
    Transmission,
)
from texbake.rendering.scene.projected import ProjectedTexture, projector_matrix
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import FILTERS, ImageTexture, ProcedureTexture, VolumeTexture
from texbake.texture.image import write_image

N_IMAGES = 12
_COLORED = ("base_color", "specular", "emission", "light_map")
_PLAIN = ("exponent", "gloss", "roughness", "metalness", "occlusion", "opacity")


def write_images(folder):
    """Write the images that scenes refer to: of one, three and four channels."""
    rng = np.random.default_rng(0)
    for i in range(N_IMAGES):
        shape = (8, 16 if i % 2 else 8, (1, 3, 4)[i % 3])
        pixels = rng.integers(1, 255, shape, np.uint8)
        write_image(pixels, folder / f"{i}.png")
    np.save(folder / "volume.npy", rng.random((4, 4, 4)).astype(np.float32))


def random_scene(seed, folder):
    """Return the scene of a seed, with images of `folder`, and its render options."""
    rng = np.random.default_rng(seed)
    objects = tuple(_object(rng, folder, i) for i in range(rng.integers(1, 4)))
    scene = Scene(objects=objects, lighting=_lighting(rng, folder))
    options = RenderOptions(
        width=24, height=16, supersampling=1 + int(rng.random() < 0.2),
        view=(float(rng.uniform(0, 360)), float(rng.uniform(-30, 60)), None),
        bounces=int(rng.integers(0, 2)),
        mapping_order=_pick(rng, MAPPING_ORDERS) if rng.random() < 0.1 else "screen",
    )  # fmt: skip
    return scene, options


def with_object(scene, place, item):
    """Return a scene with another object in the place of one."""
    return replace(scene, objects=(*scene.objects[:place], item, *scene.objects[place + 1 :]))


def _object(rng, folder, place):
    mesh = _mesh(rng)
    transform = np.eye(4)
    transform[:3, :3] *= rng.uniform(0.5, 1.5)
    transform[:3, 3] = rng.uniform(-2.0, 2.0, 3)
    return SceneObject(
        mesh=mesh, material=_material(rng, folder), transform=transform, name=f"object {place}",
        casts_shadows=_often(rng), receives_shadows=_often(rng),
        visible=place == 0 or rng.random() < 0.9,
        mapping=UnwrapOptions(method="planar", rotate=30.0) if rng.random() < 0.2 else None,
    )  # fmt: skip


def _mesh(rng):
    shapes: tuple[Callable[[], Mesh], ...] = (lambda: uv_sphere(6, 8), lambda: plane(2, 2))
    mesh = shapes[rng.integers(len(shapes))]()
    if rng.random() < 0.3:
        colors = rng.random((mesh.n_vertices, int(rng.integers(3, 5)))).astype(np.float32)
        mesh = mesh.replace(colors=colors)
    return mesh


def _often(rng):
    return bool(rng.random() < 0.8)


def _pick(rng, values):
    return values[int(rng.integers(len(values)))]


def _number(rng, low, high):
    """Return a random number, and 0 every third time."""
    return 0.0 if rng.random() < 0.33 else float(rng.uniform(low, high))


def _color(rng):
    red, green, blue = (0.0, 0.0, 0.0) if rng.random() < 0.33 else rng.random(3)
    return float(red), float(green), float(blue)


def _image(rng, folder, factor=1.0):
    return ImageTexture(
        image=folder / f"{rng.integers(N_IMAGES)}.png", factor=factor,
        filter=_pick(rng, FILTERS[:5]), wrap=_pick(rng, (None, "repeat", "clamp")),
    )  # fmt: skip


def _normals(rng, folder):
    return replace(_image(rng, folder), image=folder / f"{_pick(rng, (1, 4, 7, 10))}.png")


def _procedure(rng, folder, factor=1.0):
    space = _pick(rng, ("object", "world", "uv"))
    if space != "uv" and rng.random() < 0.3:
        return VolumeTexture(volume=folder / "volume.npy", space=space, factor=factor)
    name = "checker" if space == "uv" else _pick(rng, ("turbulence", "marble"))
    return ProcedureTexture(procedure=name, space=space, factor=factor, scale=3.0)


def _texture(rng, folder, factor=1.0):
    return (_image if rng.random() < 0.7 else _procedure)(rng, folder, factor)


def _slot(rng, folder, name):
    is_colored = name in _COLORED
    factor = _color(rng) if is_colored else _number(rng, 0.1, 1.0)
    if rng.random() < 0.4:
        return factor
    texture = (_image if name == "opacity" else _texture)(rng, folder)
    # Only texels tell whether a mask leaves nothing of a surface.
    least = 0.9 if name == "opacity" else 0.1
    return replace(texture, factor=_number(rng, least, 1.0))


def _material(rng, folder):
    chosen: dict[str, Any] = {
        name: _slot(rng, folder, name) for name in (*_COLORED, *_PLAIN) if rng.random() < 0.25
    }
    makers: dict[str, Callable[[], Any]] = {
        "normal_map": lambda: NormalMap(
            texture=_normals(rng, folder), space="tangent", strength=_number(rng, 0.2, 2.0)
        ),
        "bump_map": lambda: BumpMap(
            texture=_texture(rng, folder), height=_number(rng, 0.1, 0.3),
            form=_pick(rng, BUMP_FORMS), difference=_pick(rng, DIFFERENCES),
            light_space=_pick(rng, LIGHT_SPACES),
        ),
        "displacement": lambda: Displacement(
            texture=_image(rng, folder), height=_number(rng, 0.05, 0.1), edge_px=8.0
        ),
        "parallax": lambda: Parallax(texture=_image(rng, folder), depth=_number(rng, 0.05, 0.1)),
        "reflection": lambda: Reflection(
            strength=_slot(rng, folder, "specular"), fresnel=bool(rng.random() < 0.3),
            environment=_pick(rng, ("scene", "scene", "rendered")), size=8,
        ),
        "refraction": lambda: Refraction(
            strength=_slot(rng, folder, "specular"), size=8,
            environment=_pick(rng, ("scene", "scene", "rendered")),
        ),
        "projected": lambda: tuple(_picture(rng, folder) for _ in range(rng.integers(1, 3))),
    }  # fmt: skip
    chosen |= {name: make() for name, make in makers.items() if rng.random() < 0.2}
    (own,) = rng.spawn(1)  # so that all else is drawn as without it
    if own.random() < 0.2:
        chosen["transmission"] = _transmission(own, folder)
    return Material(
        shading=_pick(rng, SHADINGS), alpha_mode=_pick(rng, ALPHA_MODES),
        shading_rate=SHADING_RATES[int(rng.random() < 0.2)],
        vertex_colors=bool(rng.random() < 0.3), occlusion_strength=_number(rng, 0.2, 1.0),
        double_sided=_pick(rng, (None, True, False)), **chosen,
    )  # fmt: skip


def _transmission(rng, folder):
    return Transmission(
        strength=_slot(rng, folder, "roughness"),
        thickness=_pick(rng, (0.0, _slot(rng, folder, "roughness"))),
        attenuation_color=tuple(rng.uniform(0.0, 1.0, 3).tolist()),
        attenuation_distance=_pick(rng, (None, float(rng.uniform(0.1, 2.0)))),
    )


def _picture(rng, folder):
    place = rng.normal(size=3)
    place *= 6.0 / np.linalg.norm(place)
    target = rng.uniform(-4.0, 4.0, 3)
    matrix = projector_matrix(
        position=tuple(place), target=tuple(target), up=(0.0, 1.0, 0.0),
        fov=float(rng.uniform(10.0, 60.0)), aspect=1.0,
    )  # fmt: skip
    return ProjectedTexture(
        texture=_image(rng, folder), matrix=matrix, strength=_number(rng, 0.2, 1.0),
        facing=bool(rng.random() < 0.5), occlusion=bool(rng.random() < 0.5),
    )  # fmt: skip


def _light(rng, folder, place):
    at = rng.normal(size=3)
    at *= 5.0 / np.linalg.norm(at)
    toward = rng.uniform(-3.0, 3.0, 3) - at
    return Light(
        name=f"light {place}", kind=_pick(rng, KINDS), color=_color(rng),
        intensity=_number(rng, 0.2, 3.0), position=tuple(map(float, at)),
        direction=tuple(map(float, toward)), angle=float(rng.uniform(10.0, 60.0)),
        gate=_pick(rng, GATES), decay=_number(rng, 0.5, 2.0),
        shadow=Shadow(size=16) if rng.random() < 0.5 else None,
        profile=_image(rng, folder) if rng.random() < 0.4 else None,
        follows_camera=bool(rng.random() < 0.2),
    )  # fmt: skip


def _lighting(rng, folder):
    environment = None
    if rng.random() < 0.4:
        image = folder / f"{_pick(rng, (1, 7))}.png" if rng.random() < 0.5 else None
        environment = Environment(
            image=image, color=_color(rng), intensity=_number(rng, 0.2, 1.0),
            lighting=bool(rng.random() < 0.6), background=bool(rng.random() < 0.5), size=8,
        )  # fmt: skip
    fog = Fog(
        mode=_pick(rng, FOG_MODES), density=_number(rng, 0.02, 0.1), color=(0.4, 0.5, 0.6),
        end=40.0,
    )  # fmt: skip
    occlusion = AmbientOcclusion(samples=4, strength=_number(rng, 0.2, 1.0))
    return Lighting(
        lights=tuple(_light(rng, folder, i) for i in range(rng.integers(0, 3))),
        ambient=Ambient(color=_color(rng), ground=_pick(rng, (None, _color(rng)))),
        environment=environment,
        fog=fog if rng.random() < 0.2 else None,
        occlusion=occlusion if rng.random() < 0.3 else None,
    )
