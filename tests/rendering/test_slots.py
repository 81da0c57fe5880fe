from dataclasses import replace

import numpy as np
import pytest

from texbake import ImageTexture, Light, Lighting, Material, Mesh, RenderOptions, Scene, SceneObject
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.scene.scene import transform_matrix
from texbake.rendering.scene.textures import ProcedureTexture
from texbake.texture.procedures import evaluate

CLOSE = {"rtol": 2e-6, "atol": 1e-6}


def unlit(base_color, **fields):
    return Material(shading="unlit", base_color=base_color, **fields)


def procedure(**fields):
    """Smooth everywhere, so that float32 coordinates change little."""
    return ProcedureTexture(
        **{"procedure": "stripes", "parameters": {"profile": "sine"}, "filtered": False} | fields
    )


def values_at(points, **parameters):
    flat = np.ascontiguousarray(points.reshape(-1, points.shape[-1]))
    found = evaluate(
        "stripes", flat, None, parameters={"profile": "sine"} | parameters, scalar=True, threads=1
    )
    return found.reshape(*points.shape[:-1], 1)


def test_a_procedure_is_evaluated_where_the_point_lies(wall):
    found = wall.light(unlit(procedure(scale=(0.7, 0.3, 1.0))))
    expected = values_at(wall.points * (0.7, 0.3, 1.0))
    np.testing.assert_allclose(found, expected.repeat(3, -1), **CLOSE)
    assert np.ptp(found) > 0.5


def test_a_procedure_on_the_texture_takes_its_coordinates(wall):
    found = wall.light(unlit(procedure(space="uv", scale=7.0)))
    np.testing.assert_allclose(found, values_at(wall.uvs * 7.0).repeat(3, -1), **CLOSE)


@pytest.mark.parametrize("space", ["object", "world"])
def test_object_space_moves_with_the_object_and_world_space_stays(wall, space):
    # The wall again, as a square of half the size turned by 90 degrees, doubled and turned back.
    move = transform_matrix(rotate=(0, 0, 90), scale=2.0)
    mesh = wall.mesh()
    inverse = np.linalg.inv(move)
    moved = mesh.replace(positions=mesh.positions @ inverse[:3, :3].T)
    item = SceneObject(mesh=moved, material=unlit(procedure(space=space)), transform=move)
    found = draw(prepare(Scene(objects=(item,)), wall.options), wall.camera).color[..., :3]
    points = wall.points @ inverse[:3, :3].T if space == "object" else wall.points
    np.testing.assert_allclose(found, values_at(points).repeat(3, -1), **CLOSE)


def test_a_ramp_colors_the_value_and_a_factor_scales_it(wall):
    stops = ((0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    found = wall.light(unlit(procedure(colors=stops, factor=(0.5, 1.0, 2.0))))
    value = values_at(wall.points)[..., 0]
    expected = np.stack(
        [np.interp(value, (0, 0.5, 1), [stop[k] for stop in stops]) for k in range(3)], -1
    )
    np.testing.assert_allclose(found, expected * (0.5, 1.0, 2.0), **CLOSE)


def test_a_filtered_procedure_fades_with_its_distance():
    # Stripes of 0.02 to the horizon: sharp in front, their mean behind, and no noise between.
    mesh = Mesh(
        positions=[[-50, 0, -200], [50, 0, -200], [50, 0, 0], [-50, 0, 0]],
        faces=[[0, 2, 1], [0, 3, 2]],
    )
    texture = ProcedureTexture(procedure="checker", scale=10.0)
    camera = Camera.looking_at((0, 1.0, 0), (0, 0.7, -3), fov=0.9, near=0.01)
    options = RenderOptions(width=60, height=60, supersampling=1)

    def rows(**fields):
        item = SceneObject(mesh=mesh, material=unlit(replace(texture, **fields)))
        frame = draw(prepare(Scene(objects=(item,)), options), camera)
        covered = (frame.coverage == 1).all(axis=1)
        return frame.color[covered, :, 0]

    filtered, raw = rows(), rows(filtered=False)
    assert set(np.unique(raw)) == {0.0, 1.0}
    far = filtered[: len(filtered) // 5]
    np.testing.assert_allclose(far, 0.5, atol=0.02)
    assert raw[: len(raw) // 5].std() > 0.3 and filtered[-3:].std() > 0.3


@pytest.mark.parametrize("filtered", [True, False])
def test_the_scale_of_a_procedure_is_one_of_the_coordinates_for_its_filter_too(wall, filtered):
    scale = np.array((60.0, -25.0))
    texture = ProcedureTexture(
        procedure="checker", space="uv", scale=(*scale, 1.0), filtered=filtered
    )
    found = wall.light(unlit(texture))
    expected = wall.light(unlit(replace(texture, scale=1.0)), uvs=wall.mesh().uvs * scale)
    np.testing.assert_allclose(found, expected, atol=1e-4)
    # A cell is about a pixel wide: with the filter it is gray, and black or white without.
    assert (np.abs(found - 0.5).mean() < 0.3) == filtered


def test_vertex_colors_multiply_the_base_color(wall):
    rng = np.random.default_rng(1)
    colors = rng.random((4, 3)).astype(np.float32)
    base = np.array((0.9, 0.5, 0.2))
    found = wall.light(unlit(tuple(base), vertex_colors=True), colors=colors)
    u, v = wall.uvs[..., 0], wall.uvs[..., 1]
    below = np.stack([1 - u, u - v, v, 0 * u], -1)
    above = np.stack([1 - v, 0 * u, u, v - u], -1)
    expected = np.where((u >= v)[..., None], below, above) @ colors.astype(float) * base
    np.testing.assert_allclose(found, expected, **CLOSE)
    # Only where the material says so, and the mesh has any.
    np.testing.assert_allclose(
        wall.light(unlit(tuple(base)), colors=colors), np.broadcast_to(base, found.shape), rtol=1e-6
    )
    np.testing.assert_allclose(
        wall.light(unlit(tuple(base), vertex_colors=True)),
        np.broadcast_to(base, found.shape),
        rtol=1e-6,
    )


def test_constants_images_and_procedures_mix_in_one_material(wall):
    image = ImageTexture(image=np.full((2, 2, 3), (0.2, 0.4, 0.6), np.float32))
    found = wall.light(unlit(image, emission=procedure()))
    np.testing.assert_allclose(found, values_at(wall.points) + np.array((0.2, 0.4, 0.6)), **CLOSE)


def test_a_slot_of_one_number_takes_the_value_of_a_procedure(wall):
    # Opacity over white: the value is what the base color counts for.
    material = unlit((0.0, 0.0, 0.0), opacity=procedure())
    frame = wall.frame(material)
    np.testing.assert_allclose(frame.color[..., 3], values_at(wall.points)[..., 0], **CLOSE)


@pytest.mark.parametrize(("value", "meant"), [(1e30, 1.0), (7.0, 1.0), (-3.0, 0.0)])
@pytest.mark.parametrize("name", ["roughness", "metalness"])
def test_roughness_and_metalness_stay_from_0_to_1(wall, name, value, meant):
    lit = {"base_color": (0.8, 0.5, 0.2), "roughness": 0.3}
    image = ImageTexture(image=np.full((2, 2, 1), value, np.float32))
    lighting = Lighting(lights=(Light(direction=(0.2, -0.3, -1.0)),))
    found = wall.light(Material(**lit | {name: image}), lighting)
    expected = wall.light(Material(**lit | {name: meant}), lighting)
    assert expected.max() > 0.0
    np.testing.assert_allclose(found, expected, **CLOSE)
