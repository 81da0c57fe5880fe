import math
from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.conftest import pixel_rays
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Environment, Light, Lighting
from texbake.rendering.scene.material import Material, Reflection, Refraction
from texbake.rendering.scene.scene import Scene, SceneObject, transform_matrix

COLORS = np.array([(1, 0, 0), (0, 1, 1), (0, 1, 0), (1, 0, 1), (0, 0, 1), (1, 1, 0)], np.float32)
SIX = Environment(faces=tuple(np.broadcast_to(c, (4, 4, 3)).copy() for c in COLORS))
MIRROR = Material(shading="unlit", base_color=(0.0, 0.0, 0.0), reflection=Reflection())


def flat(color, **fields):
    return Material(shading="unlit", base_color=color, **fields)


def facing(directions, margin=0.15):
    """Face of a cube of each direction, and whether it lies well within it."""
    largest = np.abs(directions).argmax(axis=-1)
    sign = np.take_along_axis(directions, largest[..., None], -1)[..., 0] < 0
    ordered = np.sort(np.abs(directions), axis=-1)
    return 2 * largest + sign, ordered[..., 2] - ordered[..., 1] > margin


@pytest.mark.parametrize("strength", [0.25, 1.0, (0.5, 0.0, 1.0)])
def test_strength_is_the_share_of_the_mirror(wall, strength):
    base, sky = np.array((0.8, 0.2, 0.4)), np.array((0.3, 0.6, 0.9))
    material = flat(tuple(base), reflection=Reflection(strength=strength))
    found = wall.light(material, Lighting(environment=Environment(color=tuple(sky))))
    expected = base + np.asarray(strength) * (sky - base)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-6)


def test_fresnel_grows_to_all_toward_grazing_angles(wall):
    material = flat((0.0,) * 3, reflection=Reflection(strength=0.04, fresnel=True))
    found = wall.light(material, Lighting(environment=Environment(color=(1.0,) * 3)))[..., 0]
    expected = 0.04 + 0.96 * (1 - wall.to_eye[..., 2]) ** 5
    np.testing.assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize("rotate", [0.0, 90.0])
def test_a_mirror_sphere_sees_six_colored_faces_in_their_places(rotate):
    options = RenderOptions(width=120, height=120, supersampling=1, background=None)
    camera = Camera.looking_at((1.5, 2.0, 3.0), (0, 0, 0), fov=0.65, near=0.01)
    sky = replace(SIX, rotate=rotate, background=False)
    scene = Scene(
        objects=(SceneObject(mesh=icosphere(5), material=MIRROR),),
        lighting=Lighting(environment=sky),
    )
    frame = draw(prepare(scene, options), camera, keep=("normals",))
    rays = pixel_rays(camera, 120, 120)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    half = rays @ camera.eye
    root = half**2 - (camera.eye @ camera.eye - 1)
    normals = camera.eye + (-half - np.sqrt(np.maximum(root, 0)))[..., None] * rays
    mirrored = rays - 2 * np.einsum("ijk,ijk->ij", rays, normals)[..., None] * normals
    # The image turns counter-clockwise seen from above.
    sine, cosine = math.sin(math.radians(rotate)), math.cos(math.radians(rotate))
    turned = mirrored @ np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    faces, sure = facing(turned, 0.3)
    sure &= (root > 0.05) & (frame.coverage == 1)
    assert sure.sum() > 3000 and len(set(faces[sure])) == 6
    np.testing.assert_allclose(frame.color[..., :3][sure], COLORS[faces[sure]], atol=1e-4)


def test_glass_bends_by_snell_and_mirrors_what_it_keeps_inside(wall):
    # From outside: sin t = sin i / n. The color tells the face that the bent ray meets.
    for index in 1.0, 1.5, 2.4:
        material = flat((0.0,) * 3, refraction=Refraction(ior=index))
        found = wall.light(material, Lighting(environment=SIX))
        across = -wall.to_eye[..., :2] / index
        bent = np.concatenate([across, -np.sqrt(1 - (across**2).sum(-1, keepdims=True))], -1)
        faces, sure = facing(bent, 0.3)
        assert sure.sum() > 100
        np.testing.assert_allclose(found[sure], COLORS[faces[sure]], atol=1e-4)


def test_total_reflection_from_inside():
    # The eye inside a sphere of glass, off its middle: steep rays leave, flat ones are kept.
    index = 1.5
    options = RenderOptions(width=100, height=100, supersampling=1, back_faces="show")
    eye = np.array((0.0, 0.0, 0.9))
    camera = Camera.looking_at(eye, (1, 0, 0.9), fov=math.radians(120), near=1e-3)
    material = flat((0.0,) * 3, refraction=Refraction(ior=index))
    scene = Scene(
        objects=(SceneObject(mesh=icosphere(6), material=material),),
        lighting=Lighting(environment=replace(SIX, background=False)),
    )
    frame = draw(prepare(scene, options), camera)
    assert (frame.coverage == 1).all()
    rays = pixel_rays(camera, 100, 100)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    half = rays @ eye
    normals = eye + (-half + np.sqrt(half**2 - (eye @ eye - 1)))[..., None] * rays
    cosine = np.einsum("ijk,ijk->ij", rays, normals)[..., None]  # outward, along the ray
    across = index * (rays - cosine * normals)
    inside = 1 - (across**2).sum(-1, keepdims=True)
    out = np.where(
        inside < 0, rays - 2 * cosine * normals, across + np.sqrt(np.maximum(inside, 0)) * normals
    )
    kept = inside[..., 0] < 0
    faces, sure = facing(out, 0.2)
    sure &= np.abs(inside[..., 0]) > 0.1  # where it turns over, a small error is a large one
    assert (kept & sure).sum() > 200 and (~kept & sure).sum() > 200
    np.testing.assert_allclose(frame.color[..., :3][sure], COLORS[faces[sure]], atol=1e-3)


def ball(position, color, size=0.4):
    return SceneObject(
        mesh=uv_sphere(16, 32), material=flat(color),
        transform=transform_matrix(translate=position, scale=size), name=f"ball {color}",
    )  # fmt: skip


def rendered_mirror(mesh, **fields):
    material = replace(MIRROR, reflection=Reflection(environment="rendered", size=128))
    return SceneObject(mesh=mesh, material=material, name="mirror", **fields)


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (30.0, -20.0, 10.0)])
def test_a_rendered_environment_shows_objects_where_they_are(shift):
    # A ball of its own color on each axis; the mirror ball shows each where a ray would meet it.
    places = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1.0)]) * 40
    balls = [
        ball(p + shift, tuple(map(float, c)), 8.0) for p, c in zip(places, COLORS, strict=True)
    ]
    mirror = rendered_mirror(icosphere(5), transform=transform_matrix(translate=shift))
    options = RenderOptions(width=160, height=160, supersampling=1, background=(0.0,) * 3)
    camera = Camera.looking_at(np.add((1.2, 1.6, 2.4), shift), shift, fov=0.8, near=0.01)
    scene = Scene(objects=(mirror, *balls))
    frame = draw(prepare(scene, options), camera, keep=("normals",))
    on_mirror = frame.face_ids < mirror.mesh.n_faces
    on_mirror &= frame.face_ids >= 0
    rays = pixel_rays(camera, 160, 160)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    n = frame.normals
    mirrored = rays - 2 * np.einsum("ijk,ijk->ij", rays, n)[..., None] * n
    cosines = mirrored @ (places / 40).T
    edge = math.cos(math.asin(8 / 40))
    found = frame.color[..., :3]
    for k, color in enumerate(COLORS):
        inside = on_mirror & (cosines[..., k] > edge + 0.005)
        assert inside.sum() > 20, k
        np.testing.assert_allclose(
            found[inside], np.broadcast_to(color, found[inside].shape), atol=1e-3
        )
    nothing = on_mirror & (cosines.max(axis=-1) < edge - 0.01)
    assert nothing.sum() > 1000 and not found[nothing].any()


def test_an_invisible_object_is_seen_in_mirrors():
    # As the scene has it: the camera does not see it, reflections do.
    red = replace(ball((0, 0, 3.0), (1.0, 0.0, 0.0), 1.5), visible=False)
    options = RenderOptions(width=32, height=32, supersampling=1, background=(0.0,) * 3)
    camera = Camera.looking_at((0, 0, 6.0), (0, 0, 0), fov=0.4, near=0.01)
    frame = draw(prepare(Scene(objects=(rendered_mirror(icosphere(3)), red)), options), camera)
    np.testing.assert_allclose(frame.color[16, 16, :3], (1, 0, 0), atol=1e-3)
    assert frame.depths[16, 16] == pytest.approx(5.0, abs=0.02)


def facing_mirrors(bounces):
    """Two mirrors face each other; a red lamp stands on the rim of one of them."""
    glow = 0.5
    tinted = Material(
        shading="unlit", base_color=(0.0,) * 3, emission=(glow, 0.0, 0.0),
        reflection=Reflection(strength=0.5, environment="rendered", size=16),
    )  # fmt: skip
    back = SceneObject(
        mesh=plane(), material=tinted, name="back",
        transform=transform_matrix(translate=(-0.5, -0.5, 0.0)),
    )  # fmt: skip
    front = SceneObject(
        mesh=plane(), material=tinted, name="front",
        transform=transform_matrix(rotate=(0, 180, 0), translate=(0.5, -0.5, 0.2)),
    )  # fmt: skip
    options = RenderOptions(
        width=16, height=16, supersampling=1, background=(0.0,) * 3, bounces=bounces
    )
    camera = Camera.looking_at((0, 0, 0.1), (0, 0, -1.0), fov=0.5, near=1e-3)
    frame = draw(prepare(Scene(objects=(back, front)), options), camera)
    assert np.isfinite(frame.color).all()
    return frame.color[8, 8, 0]


@pytest.mark.parametrize("bounces", [0, 1, 2])
def test_two_mirrors_show_each_other_as_often_as_asked(bounces):
    # Unlit black and half a mirror: L_0 = (emission + ...) is 0 without a mirror beyond. A picture
    # within a picture is one more term of the series.
    found = facing_mirrors(bounces)
    # Emission is added after the reflection: L = 0.5 L' + 0.5, L' the same one picture deeper;
    # the last one reflects nothing.
    expected = 0.5
    for _ in range(bounces + 1):
        expected = 0.5 * expected + 0.5
    assert found == pytest.approx(expected, abs=1e-4)


def test_lights_that_follow_the_camera_stay_where_they_are_in_its_mirrors():
    # A headlight shines on the side of a cube that faces the camera; the mirror behind the cube
    # sees the dark one.
    lamp = Light(direction=(0.0, 0.0, -1.0), follows_camera=True)
    box = SceneObject(
        mesh=cube(), material=Material(shading="lambert", base_color=(1.0,) * 3),
        transform=transform_matrix(translate=(0.0, 0.0, 0.0)),
    )  # fmt: skip
    mirror = rendered_mirror(plane(), transform=transform_matrix(scale=6, translate=(-3, -3, -2)))
    options = RenderOptions(width=33, height=33, supersampling=1, background=(0.0,) * 3)
    scene = Scene(objects=(box, mirror), lighting=Lighting(lights=(lamp,)))
    prepared = prepare(scene, options)
    front = Camera.looking_at((0, 0, 6.0), (0, 0, 0), fov=1.0, near=0.01)
    frame = draw(prepared, front)
    assert frame.color[16, 16, 0] == pytest.approx(1.0, rel=1e-5)
    of_mirror = frame.color[..., 0][frame.face_ids >= 12]
    assert len(of_mirror) > 100 and of_mirror.max() < 1e-6
    # From the side the lamp stands elsewhere, and the mirror shows that.
    side = Camera.looking_at((4.0, 0, 3.0), (0, 0, -2.0), fov=1.0, near=0.01)
    again, fresh = draw(prepared, side), draw(prepare(scene, options), side)
    np.testing.assert_array_equal(again.color, fresh.color)


def test_an_environment_that_is_not_to_be_seen_is_seen_in_mirrors():
    sky = Environment(color=(0.1, 0.5, 0.2), background=False)
    options = RenderOptions(width=32, height=32, supersampling=1, background=(0.0,) * 3)
    camera = Camera.looking_at((0, 0, 6.0), (0, 0, 0), fov=0.6, near=0.01)
    objects = (rendered_mirror(icosphere(3)), ball((0, 30.0, 0), (1.0, 0.0, 0.0)))
    scene = Scene(objects=objects, lighting=Lighting(environment=sky))
    frame = draw(prepare(scene, options), camera)
    np.testing.assert_allclose(frame.color[16, 16, :3], (0.1, 0.5, 0.2), atol=1e-5)
    np.testing.assert_array_equal(frame.color[0, 0, :3], 0.0)
