"""Crossing surfaces against rays: each sample's layers sorted by depth and laid over in numpy."""

import math

import numpy as np
import pytest

from tests.rendering.conftest import pixel_rays
from texbake import ImageTexture, Material, Mesh, RenderOptions, Scene, SceneObject
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.effects.transparency import MAX_LAYERS
from texbake.rendering.scene.scene import transform_matrix

CAMERA = Camera.looking_at((0.3, 0.2, 4.0), (0.0, 0.1, 0.0), fov=math.radians(40), near=0.1)
SIZE = 40.0
BEHIND = np.array((1.0, 1.0, 1.0))  # white is white in sRGB too


def quad(material, transform):
    """The square |x|, |y| <= 20 in z = 0, (u, v) = (x, y) / 40 + 1/2, put somewhere."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = Mesh(
        positions=np.concatenate([SIZE * (corners - 0.5), np.zeros((4, 1))], axis=1),
        faces=faces, uvs=corners, uv_faces=faces,
    )  # fmt: skip
    return SceneObject(mesh=mesh, material=material, transform=transform)


def glass(color, opacity, **fields):
    return Material(shading="unlit", base_color=color, opacity=opacity, double_sided=True, **fields)


TURNS = (
    transform_matrix(rotate=(0, 35, 0), translate=(0, 0, 0.3)),
    transform_matrix(rotate=(0, -40, 10), translate=(0.2, 0, 0)),
    transform_matrix(rotate=(50, 5, 0), translate=(0, 0.1, -0.2)),
)


def met(item, width, height):
    """Depth along each ray (inf for none), and (u, v) where it meets the object's plane."""
    rays = pixel_rays(CAMERA, width, height)
    inverse = np.linalg.inv(item.transform)
    eye, turned = inverse[:3, :3] @ CAMERA.eye + inverse[:3, 3], rays @ inverse[:3, :3].T
    with np.errstate(divide="ignore"):
        depth = -eye[2] / turned[..., 2]
    uvs = (eye + depth[..., None] * turned)[..., :2] / SIZE + 0.5
    inside = (depth > CAMERA.near) & ((uvs > 0) & (uvs < 1)).all(axis=-1)
    return np.where(inside, depth, np.inf), uvs


def composed(layers, width, height, behind=BEHIND):
    """The over operator: `layers` are (depth, color, opacity) arrays, opaque ones among them."""
    depths = np.stack([np.broadcast_to(d, (height, width)) for d, _, _ in layers])
    colors = np.stack([np.broadcast_to(c, (height, width, 3)) for _, c, _ in layers])
    opacity = np.stack([np.broadcast_to(a, (height, width)) for _, _, a in layers])
    opacity = np.where(np.isinf(depths), 0.0, opacity)
    light, passed = np.zeros((height, width, 3)), np.ones((height, width))
    for i in np.argsort(depths, axis=0):
        a = np.take_along_axis(opacity, i[None], 0)[0]
        c = np.take_along_axis(colors, i[None, ..., None], 0)[0]
        light += (passed * a)[..., None] * c
        passed *= 1 - a
    return light + passed[..., None] * behind


def picture_of(objects, width, height, side=1, **options):
    options = RenderOptions(
        width=width, height=height, supersampling=side, background=(1.0, 1.0, 1.0), **options
    )
    return draw(prepare(Scene(objects=tuple(objects)), options), CAMERA)


def mean(samples, side):
    height, width = samples.shape[0] // side, samples.shape[1] // side
    return samples.reshape(height, side, width, side, -1).mean(axis=(1, 3))


@pytest.mark.parametrize("side", [1, 3])
@pytest.mark.parametrize("with_wall", [False, True])
def test_crossing_quads_are_right_at_every_sample(side, with_wall):
    values = [((0.9, 0.1, 0.1), 0.5), ((0.1, 0.8, 0.2), 0.3), ((0.2, 0.2, 1.0), 0.8)]
    objects = [quad(glass(*value), turn) for value, turn in zip(values, TURNS, strict=True)]
    if with_wall:  # opaque, and crossing the others
        values.append(((0.5, 0.4, 0.1), 1.0))
        wall = transform_matrix(rotate=(-20, 60, 0), translate=(0, 0, -1))
        objects.append(quad(glass(*values[-1]), wall))
    found = picture_of(objects, 60, 45, side).color[..., :3]
    layers = [
        (met(item, 60 * side, 45 * side)[0], color, opacity)
        for item, (color, opacity) in zip(objects, values, strict=True)
    ]
    expected = mean(composed(layers, 60 * side, 45 * side), side)
    # Each order of the three is seen somewhere.
    orders = np.argsort([depth for depth, _, _ in layers[:3]], axis=0).reshape(3, -1).T
    assert len(np.unique(orders, axis=0)) >= 4
    # Float32 light. Samples right on an edge or where two surfaces meet may go the other way: a
    # handful of pixels.
    wrong = np.abs(found - expected).max(axis=-1) > 2e-6
    assert wrong.mean() < 0.002


@pytest.mark.parametrize("edges", ["multisample", "supersample"])
def test_each_sample_of_a_supersampled_layer_has_its_own_color(edges):
    # A picture on the glass, finer than a pixel: a layer shaded once a pixel cannot show it.
    texels = np.random.default_rng(1).random((2000, 2000, 3)).astype(np.float32)
    image = ImageTexture(image=texels, filter="nearest")
    item = quad(glass(image, 0.5), TURNS[0])
    found = picture_of([item], 40, 30, 3, edges=edges).color[..., :3]
    depth, uvs = met(item, 120, 90)
    columns = np.floor(uvs[..., 0] * 2000).astype(int).clip(0, 1999)
    rows = np.floor((1 - uvs[..., 1]) * 2000).astype(int).clip(0, 1999)
    samples = composed([(depth, texels[rows, columns], 0.5)], 120, 90)
    expected = mean(samples, 3)
    right = np.abs(found - expected).max(axis=-1) < 1e-5
    if edges == "supersample":
        assert right.mean() > 0.99  # but where rounding finds the texel beside
    else:
        centers = samples[1::3, 1::3]
        right = np.abs(found - centers).max(axis=-1) < 1e-5
        assert right.mean() > 0.95  # but at the diagonal between the two triangles


@pytest.mark.parametrize("mode", ["mask", "blend", "opaque"])
def test_opacity_from_an_image(mode):
    levels = np.random.default_rng(2).random((64, 64, 1)).astype(np.float32)
    image = ImageTexture(image=levels, filter="nearest")
    materials = [
        glass((0.9, 0.3, 0.1), image, alpha_mode=mode, alpha_cutoff=0.4),
        glass((0.1, 0.3, 0.9), 1.0),
    ]
    objects = [quad(m, turn) for m, turn in zip(materials, TURNS, strict=False)]
    frame = picture_of(objects, 80, 60)
    depth, uvs = met(objects[0], 80, 60)
    columns = np.floor(uvs[..., 0] * 64).astype(int).clip(0, 63)
    rows = np.floor((1 - uvs[..., 1]) * 64).astype(int).clip(0, 63)
    opacity = levels[rows, columns, 0]
    if mode == "mask":
        opacity = (opacity >= 0.4).astype(float)
    elif mode == "opaque":
        opacity = np.ones_like(opacity)
    layers = [(depth, (0.9, 0.3, 0.1), opacity), (met(objects[1], 80, 60)[0], (0.1, 0.3, 0.9), 1.0)]
    wrong = np.abs(frame.color[..., :3] - composed(layers, 80, 60)).max(axis=-1) > 2e-6
    assert wrong.mean() < 0.002
    assert frame.plan.has("transparency") == (mode != "opaque")


def test_colors_of_images_and_vertices_bring_their_opacity():
    texel = np.array((0.2, 0.4, 0.6, 0.25), np.float32)
    image = ImageTexture(image=np.broadcast_to(texel, (2, 2, 4)).copy(), filter="nearest")
    face_on = transform_matrix()
    found = picture_of([quad(glass(image, None), face_on)], 8, 8).color[4, 4, :3]
    np.testing.assert_allclose(found, 0.25 * texel[:3] + 0.75, rtol=1e-6)
    # The slot multiplies it.
    found = picture_of([quad(glass(image, 0.5), face_on)], 8, 8).color[4, 4, :3]
    np.testing.assert_allclose(found, 0.125 * texel[:3] + 0.875, rtol=1e-6)
    item = quad(glass((1.0, 0.5, 0.5), None, vertex_colors=True), face_on)
    colors = np.tile(np.array((0.5, 0.5, 0.5, 0.4), np.float32), (4, 1))
    mesh = item.mesh.replace(colors=colors)
    found = picture_of([SceneObject(mesh=mesh, material=item.material)], 8, 8).color[4, 4, :3]
    np.testing.assert_allclose(found, 0.4 * np.array((0.5, 0.25, 0.25)) + 0.6, rtol=1e-6)


@pytest.mark.parametrize("n_layers", [MAX_LAYERS - 1, MAX_LAYERS, MAX_LAYERS + 5])
def test_layers_beyond_the_most_are_not_seen_and_what_is_opaque_is(n_layers):
    color, opacity = np.array((0.2, 0.9, 0.4)), 0.2
    panes = [
        quad(glass(tuple(color), opacity), transform_matrix(translate=(0, 0, -0.1 * i)))
        for i in range(n_layers)
    ]
    wall = quad(glass((0.0, 0.0, 1.0), 1.0), transform_matrix(translate=(0, 0, -9)))
    found = picture_of([*panes, wall], 8, 6).color[..., :3]
    passed = (1 - opacity) ** min(n_layers, MAX_LAYERS)
    expected = (1 - passed) * color + passed * np.array((0, 0, 1))
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-5)


def test_layers_in_one_place_all_count_in_the_order_of_their_triangles():
    panes = [quad(glass(c, 0.5), TURNS[0]) for c in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))]
    found = picture_of(panes, 8, 6).color[..., :3]
    expected = 0.5 * np.array((1, 0.5, 0.25)) + 0.125
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-6)


def test_without_background_the_opacity_of_the_picture_is_what_was_hidden():
    options = RenderOptions(width=8, height=6, supersampling=2, background=None)
    scene = Scene(objects=(quad(glass((0.5, 0.25, 1.0), 0.25), TURNS[0]),))
    frame = draw(prepare(scene, options), CAMERA)
    np.testing.assert_allclose(frame.color[..., 3], 0.25, rtol=1e-6)
    np.testing.assert_allclose(
        frame.color[..., :3], np.broadcast_to((0.5, 0.25, 1.0), (6, 8, 3)), rtol=1e-6
    )
    np.testing.assert_array_equal(frame.coverage, 1.0)
    # Wholly clear: nothing is there.
    scene = Scene(objects=(quad(glass((0.5, 0.25, 1.0), 0.0), TURNS[0]),))
    frame = draw(prepare(scene, options), CAMERA)
    assert not frame.color.any() and not frame.coverage.any()


def test_opacity_beyond_its_range_is_held_in_it():
    for opacity, expected in ((7.0, (0.5, 0.25, 0.0)), (-3.0, (1.0, 1.0, 1.0))):
        found = picture_of([quad(glass((0.5, 0.25, 0.0), opacity), TURNS[0])], 8, 6)
        np.testing.assert_allclose(found.color[..., :3], np.broadcast_to(expected, (6, 8, 3)))


def test_gray_with_opacity_lets_through_as_colors_with_opacity_do():
    gray = np.full((2, 2, 2), 0.25, np.float32)
    colors = np.repeat(gray[..., :1], 4, axis=2)
    found = [
        picture_of([quad(glass(ImageTexture(image=image), None), TURNS[0])], 20, 15).color
        for image in (gray, colors)
    ]
    np.testing.assert_array_equal(*found)
    assert found[0][7, 10, 0] == pytest.approx(0.25 * 0.25 + 0.75)
