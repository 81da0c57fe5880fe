"""Scenes that are hard: what projection, depth, lights, mirrors and lenses do at their ends."""

import numpy as np
from catalog.case import Case
from catalog.geometry import mesh_of, moved

from texbake import (
    Ambient,
    CameraView,
    ImageTexture,
    Light,
    Lighting,
    Material,
    RenderOptions,
    Scene,
    SceneObject,
)
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.rendering.scene.lights import Environment, Fog, Shadow
from texbake.rendering.scene.material import BumpMap, NormalMap, Reflection, Refraction
from texbake.rendering.scene.textures import ProcedureTexture

SMALL = RenderOptions(width=48, height=32)
SUN = Light(direction=(-1.0, -2.0, -1.5), shadow=Shadow(size=64))


def scene(*objects, lights=(SUN,), view=None, **options):
    """Scene of objects under a few lights and a little ambient light."""
    lighting = Lighting(lights=lights, ambient=Ambient(color=(0.1, 0.1, 0.1)), **options)
    return Scene(objects=objects, lighting=lighting, view=view)


def floor(size=2.0, height=0.0):
    """Square in the plane y = height, facing up, about the axis."""
    flat = plane(2, 2)
    x, y = (flat.positions[:, :2] - 0.5).T * size
    return flat.replace(positions=np.column_stack([x, np.full(len(x), height), -y]))


def looking(position, target):
    """View from one point to another."""
    return CameraView(position=position, target=target)


def checker(**fields):
    """Checker of 8 x 8 cells as an image."""
    cells = (np.indices((64, 64)) // 8).sum(axis=0) % 2
    return ImageTexture(image=np.repeat(cells[..., None], 3, axis=2).astype(np.float32), **fields)


def _grazing(image_filter):
    ground = SceneObject(
        mesh=floor(1e6),
        material=Material(base_color=checker(filter=image_filter, scale=(1e5, 1e5))),
    )
    return scene(ground, view=looking((0.0, 1.0, 0.0), (0.0, 1.0, -1.0)))


def _layers(n):
    """Squares one behind the other, the farthest first, so that each sample is drawn n times."""
    flat = plane(1, 1)
    points = [flat.positions - [0.5, 0.5, 1.0 - i / n] for i in range(n)]
    return mesh_of(np.concatenate(points), np.concatenate([flat.faces + 4 * i for i in range(n)]))


def _ball(**material):
    return SceneObject(mesh=uv_sphere(12, 24), material=Material(**material))


def _sky():
    sky = np.random.default_rng(2).random((16, 32, 3)).astype(np.float32)
    return Environment(image=sky, lighting=True, size=16)


def _inside_glass(index):
    def make():
        glass = _ball(refraction=Refraction(ior=index), double_sided=True)
        return scene(glass, environment=_sky(), view=looking((0.0, 0.0, 0.9), (0.0, 0.2, 0.0)))

    return make


def _light_at(position, kind="point"):
    def make():
        light = Light(kind=kind, position=position, direction=(1.0, 0, 0), shadow=Shadow(size=32))
        return scene(SceneObject(mesh=floor()), lights=(light,))

    return make


def _materials_at_their_ends():
    ends = (
        Material(shading="blinn-phong", exponent=0.0),
        Material(shading="blinn-phong", exponent=1e9),
        Material(roughness=0.0, metalness=1.0), Material(roughness=1.0, ior=1.0),
        Material(roughness=0.0, metalness=0.0, ior=1e6), Material(shading="unlit"),
    )  # fmt: skip
    balls = tuple(
        SceneObject(mesh=moved(uv_sphere(6, 12), 0.4, (i - 2.5, 0.0, 0.0)), material=material)
        for i, material in enumerate(ends)
    )
    return scene(*balls, environment=_sky())


def _with_normal_map(value):
    def make():
        vectors = np.zeros((8, 8, 3), np.float32)
        vectors[..., 2] = 1.0
        vectors[::3] = value
        return scene(_ball(normal_map=NormalMap(texture=ImageTexture(image=vectors, color=False))))

    return make


SCENES: tuple[Case[Scene], ...] = (
    Case(name="w through 0",
         wrong="a corner behind the camera is divided by a negative w and appears in front",
         make=lambda: scene(
             SceneObject(mesh=floor(1e3)), view=looking((0.0, 1.0, 0.0), (0.0, 1.0, -1.0)))),
    Case(name="eye in the plane of a face", wrong="w and the area are both 0",
         make=lambda: scene(SceneObject(mesh=floor()),
                            view=looking((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)))),
    Case(name="eye at a vertex", wrong="w is 0 at that vertex", make=lambda: scene(
             SceneObject(mesh=cube()), view=looking((0.5, 0.5, 0.5), (0.0, 0.0, 0.0)))),
    Case(name="everything behind the eye", wrong="the picture shows it, upside down",
         make=lambda: scene(_ball(), view=looking((0.0, 0.0, 5.0), (0.0, 0.0, 9.0))),
         traits=frozenset({"empty"})),
    *(Case(name=f"checker to the horizon, {name}",
           wrong="derivatives grow to infinity, and the mip level with them",
           make=lambda name=name: _grazing(name))
      for name in ("nearest", "bilinear", "trilinear", "ewa")),
    Case(name="far over near of 1e9", wrong="all distant depths round to one float32",
         make=lambda: scene(
             SceneObject(mesh=moved(uv_sphere(8, 16), 1e5, (0.0, 0.0, -1e6))),
             SceneObject(mesh=moved(uv_sphere(8, 16), 1e-3, (0.0, 0.0, -5e-3))),
             view=CameraView(position=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), near=1e-3))),
    Case(name="coplanar faces", wrong="the visible face changes from pixel to pixel",
         make=lambda: scene(
             SceneObject(mesh=floor(), material=Material(shading="unlit", base_color=(1, 0, 0))),
             SceneObject(mesh=floor(), material=Material(shading="unlit", base_color=(0, 1, 0)))),
         traits=frozenset({"coplanar"})),
    Case(name="a million overdraws", wrong="every hidden fragment is shaded too",
         make=lambda: scene(
             SceneObject(mesh=_layers(700)), view=looking((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)))),
    Case(name="mirror at 90 degrees",
         wrong="the reflected ray lies in the surface, and Fresnel divides by 0",
         make=lambda: scene(
             SceneObject(mesh=floor(50.0), material=Material(
                 reflection=Reflection(fresnel=True), roughness=0.0)),
             environment=_sky(), view=looking((0.0, 1e-3, 3.0), (0.0, 1e-3, 0.0)))),
    Case(name="refraction past the critical angle", wrong="the square root of a negative number",
         make=_inside_glass(1.5)),
    Case(name="refraction of index below 1", wrong="the same, from outside the glass",
         make=_inside_glass(0.5)),
    Case(name="point light in the plane of a face",
         wrong="n · l is pure rounding, and the shadow shrinks to a line",
         make=_light_at((0.5, 0.0, 0.25))),
    Case(name="point light at a vertex", wrong="the direction is 0 / 0, and 1 / d² is infinite",
         make=_light_at((0.0, 0.0, 0.0))),
    Case(name="spot light in the plane of a face", wrong="the shadow map has no depth",
         make=_light_at((-2.0, 0.0, 0.0), "spot")),
    Case(name="sun along the surface",
         wrong="every texel of the shadow map falls on the same place",
         make=lambda: scene(SceneObject(mesh=floor()), lights=(
             Light(direction=(1.0, 0.0, 0.0), shadow=Shadow(size=64)),))),
    Case(name="materials at their ends", wrong="0^0, 1 / roughness², and an exponent of 1e9",
         make=_materials_at_their_ends),
    Case(name="normal map with NaN", wrong="one pixel is NaN, and filtering spreads it",
         make=_with_normal_map(np.nan)),
    Case(name="normal map of zeros", wrong="a vector of length 0 is normalized",
         make=_with_normal_map(0.0)),
    Case(name="normal map that points inwards", wrong="the surface is lit from below its horizon",
         make=_with_normal_map(-1.0)),
    Case(name="bump without coordinates", wrong="the derivative of coordinates that do not exist",
         make=lambda: scene(SceneObject(
             mesh=cube(), material=Material(bump_map=BumpMap(
                 texture=ProcedureTexture(procedure="noise", scale=1e6), height=10.0))))),
    Case(name="thick fog", wrong="the exponential of -1e300, or of its square", make=lambda: scene(
             _ball(), fog=Fog(mode="exp2", density=1e200))),
    Case(name="nearly singular transform", wrong="normals are divided by a determinant of 1e-12",
         make=lambda: scene(SceneObject(
             mesh=uv_sphere(8, 16), transform=np.diag([1.0, 1e-12, 1.0, 1.0])))),
    Case(name="faces without area", wrong="their normals are NaN, and yet they cover pixels",
         make=lambda: scene(SceneObject(mesh=mesh_of(
             [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 0, 1], [0, 1, 3]])))),
    Case(name="size 1e-12, far away", wrong="a fixed near plane of 0.01 cuts the whole object off",
         make=lambda: scene(SceneObject(mesh=moved(uv_sphere(8, 16), 1e-6, (1.0, 1.0, 1.0))))),
)  # fmt: skip
