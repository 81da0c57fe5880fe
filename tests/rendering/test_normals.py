import math

import numpy as np
import pytest

from texbake import ImageTexture, Light, Lighting, Material, RenderOptions, Scene, SceneObject
from texbake.mesh.shapes import cube, plane
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.scene.material import NormalMap
from texbake.rendering.scene.scene import transform_matrix

LIT = Lighting(lights=(Light(direction=(-0.2, -0.3, -1.0)),))


def kept(wall, material, **fields):
    scene = Scene(objects=(SceneObject(mesh=wall.mesh(**fields), material=material),), lighting=LIT)
    return draw(prepare(scene, wall.options), wall.camera, keep=("normals",)).normals


def test_normals_of_vertices_are_interpolated_and_made_unit(wall):
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(4, 3)) * 0.3 + (0, 0, 1)
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    found = kept(wall, Material(), normals=corners, normal_faces=faces)
    u, v = wall.uvs[..., 0], wall.uvs[..., 1]
    # Corner weights of the triangle under or over the diagonal u = v.
    below = np.stack([1 - u, u - v, v, 0 * u], -1)
    above = np.stack([1 - v, 0 * u, u, v - u], -1)
    expected = np.where((u >= v)[..., None], below, above) @ corners
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_normals_without_length_are_those_of_their_faces(wall):
    fields = {"normals": np.zeros((1, 3)), "normal_faces": np.zeros((2, 3), np.int32)}
    found = kept(wall, Material(), **fields)
    np.testing.assert_array_equal(found, np.broadcast_to([0, 0, 1], found.shape))


@pytest.mark.parametrize(("scale", "rotate", "strength", "expected"), [
    ((1.0, 1.0), 0.0, 1.0, (0.36, 0.48, 0.8)),
    ((3.0, 3.0), 0.0, 1.0, (0.36, 0.48, 0.8)),
    # Coordinates turned counterclockwise turn the image, and its relief, clockwise.
    ((1.0, 1.0), 90.0, 1.0, (0.48, -0.36, 0.8)),
    ((2.0, 2.0), 180.0, 1.0, (-0.36, -0.48, 0.8)),
    ((-1.0, 1.0), 0.0, 1.0, (-0.36, 0.48, 0.8)),
    ((1.0, 1.0), 0.0, 0.0, (0.0, 0.0, 1.0)),
    ((1.0, 1.0), 0.0, 0.5, (0.18, 0.24, 0.8)),
    ((1.0, 1.0), 0.0, 2.0, (0.72, 0.96, 0.8)),
])  # fmt: skip
def test_relief_turns_with_the_image_and_its_strength_scales_x_and_y(
    wall, scale, rotate, strength, expected
):
    texels = np.tile(np.array((0.36, 0.48, 0.8), np.float32), (2, 2, 1))
    image = ImageTexture(image=texels, scale=scale, rotate=rotate, wrap="repeat")
    found = kept(wall, Material(normal_map=NormalMap(texture=image, strength=strength)))
    expected = np.array(expected) / np.linalg.norm(expected)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-6)


@pytest.mark.parametrize(
    "transform",
    [
        transform_matrix(rotate=(20, 30, 40), translate=(0.1, 0.2, 0.3)),
        transform_matrix(rotate=(20, 30, 40), scale=(1.0, 2.0, 0.5)),
        transform_matrix(rotate=(20, 30, 40), scale=(-1.0, 1.0, 1.5)),
    ],
    ids=["rigid", "stretched", "mirrored"],
)
def test_normals_in_object_space_turn_with_the_object(transform):
    # Covectors: the inverse transposed takes them to the world; a mirror leaves outside outside.
    texel = np.array((0.36, 0.48, 0.8), np.float32)
    image = ImageTexture(image=np.broadcast_to(texel, (2, 2, 3)).copy(), filter="nearest")
    mesh = cube()
    mesh = mesh.replace(uvs=np.zeros((1, 2)), uv_faces=np.zeros((12, 3), np.int32))
    options = RenderOptions(width=48, height=48, supersampling=1)
    camera = Camera.looking_at((2, 3, 5), (0, 0, 0), fov=0.7, near=0.01)

    def normals(material):
        item = SceneObject(mesh=mesh, material=material, transform=transform)
        scene = Scene(objects=(item,), lighting=LIT)
        frame = draw(prepare(scene, options), camera, keep=("normals",))
        return frame.normals[frame.coverage == 1.0]

    found = normals(Material(normal_map=NormalMap(texture=image, space="object")))
    expected = np.linalg.inv(transform[:3, :3]).T @ texel
    expected /= np.linalg.norm(expected)
    assert len(found) > 150
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-6)
    # And in world space not at all.
    still = normals(Material(normal_map=NormalMap(texture=image, space="world")))
    np.testing.assert_allclose(still, np.broadcast_to(texel, still.shape), atol=1e-6)


@pytest.mark.parametrize("rotate", [(20, 30, 40), (-70, 50, 10)])
def test_relief_turns_with_the_object(rotate):
    texel = np.array((0.36, 0.48, 0.8), np.float32)
    image = ImageTexture(image=np.broadcast_to(texel, (2, 2, 3)).copy())
    turn = transform_matrix(rotate=rotate)
    material = Material(normal_map=NormalMap(texture=image))
    item = SceneObject(mesh=plane(), material=material, transform=turn)
    eye, target = (turn[:3, :3] @ point for point in ((0.3, 0.7, 2.0), (0.5, 0.5, 0.0)))
    camera = Camera.looking_at(tuple(eye), tuple(target), fov=0.7, near=0.01)
    scene = Scene(objects=(item,), lighting=LIT)
    options = RenderOptions(width=32, height=32, supersampling=1)
    frame = draw(prepare(scene, options), camera, keep=("normals",))
    found = frame.normals[frame.coverage == 1.0]
    assert len(found) > 150
    expected = np.broadcast_to(turn[:3, :3] @ texel, found.shape)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_an_object_and_its_mirror_image_are_lit_as_mirror_images():
    # With a tangent-space map, whose relief must stay on the same side of the surface.
    mesh = plane(2, 2)
    rng = np.random.default_rng(5)
    texels = rng.normal(size=(8, 8, 3)) * (0.5, 0.5, 0) + (0, 0, 1)
    texels = (texels / np.linalg.norm(texels, axis=-1, keepdims=True)).astype(np.float32)
    material = Material(normal_map=NormalMap(texture=ImageTexture(image=texels)))
    options = RenderOptions(width=40, height=40, supersampling=1, background=None)

    def seen(mirror):
        sign = -1.0 if mirror else 1.0
        item = SceneObject(
            mesh=mesh,
            material=material,
            transform=transform_matrix(scale=(sign, 1, 1), translate=(-0.5 * sign, -0.5, 0)),
        )
        light = Light(direction=(-0.7 * sign, -0.3, -1.0))
        camera = Camera.looking_at((0, 0, 2), (0, 0, 0), fov=math.radians(40), near=0.01)
        scene = Scene(objects=(item,), lighting=Lighting(lights=(light,)))
        return draw(prepare(scene, options), camera).color

    plain, mirrored = seen(False), seen(True)[:, ::-1]
    both = (plain[..., 3] == 1.0) & (mirrored[..., 3] == 1.0)
    assert both.sum() > 700 and (plain[..., 3] != mirrored[..., 3]).sum() <= 2 * 40
    np.testing.assert_allclose(plain[both], mirrored[both], atol=1e-5)
    assert np.ptp(plain[both][:, 0]) > 0.1
