"""The mapping of an object: computed when something reads its coordinates, and only then."""

from dataclasses import replace

import numpy as np
import pytest

import texbake.mapping.unwrap as unwrapping
from tests.rendering.test_uv_sets import READERS
from texbake.errors import FileError, UnwrapError
from texbake.jobs.light_maps import bake_light_maps
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.files import write_mesh
from texbake.mesh.shapes import cube, uv_sphere
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.plan import plan_rows
from texbake.rendering.render import render_scene
from texbake.rendering.scene.lights import Light, Lighting
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import (
    CameraView,
    Scene,
    SceneObject,
    apply_mapping,
    camera_of,
    transform_matrix,
)
from texbake.rendering.scene.textures import ImageTexture

NOISE = np.random.default_rng(4).random((16, 16, 3)).astype(np.float32)
IMAGE = ImageTexture(image=NOISE)
MAPPING = UnwrapOptions(method="spherical")
LIGHTING = Lighting(lights=(Light(direction=(0.4, -0.3, -1.0)),))
VIEW = CameraView(position=(1.0, 1.0, 6.0), target=(0.0, 0.0, 0.0))
OPTIONS = RenderOptions(width=48, height=40, supersampling=1)
PLACE = transform_matrix(rotate=(20.0, 30.0, 0.0), scale=(1.0, -1.2, 0.9))
BALL = SceneObject(mesh=uv_sphere(8, 16), mapping=MAPPING, name="ball", transform=PLACE)


def scene_of(*items):
    return Scene(objects=items, lighting=LIGHTING, view=VIEW)


@pytest.fixture
def n_mapped(monkeypatch):
    """The name of a mesh for each time it is mapped."""
    found: list[str] = []
    work = unwrapping.unwrap

    def counted(mesh, *args, **named):
        found.append(mesh.name)
        return work(mesh, *args, **named)

    monkeypatch.setattr(unwrapping, "unwrap", counted)
    return found


@pytest.mark.parametrize("name", READERS)
def test_the_picture_equals_one_of_a_mesh_with_these_coordinates(name, n_mapped):
    item = replace(BALL, material=Material(**READERS[name](None)))
    expected = render_scene(scene_of(apply_mapping(item)), OPTIONS)
    other = render_scene(scene_of(replace(item, mapping=None)), OPTIONS)
    assert expected.color.tobytes() != other.color.tobytes()
    n_mapped.clear()
    found = render_scene(scene_of(item), OPTIONS)
    assert found.color.tobytes() == expected.color.tobytes()
    assert n_mapped == [BALL.mesh.name]
    (row,) = (row for row in plan_rows(found.plan, found.costs) if row.name == "mapping")
    assert row.milliseconds and row.n_bytes and not row.skipped


def test_the_mapping_of_a_hidden_object_is_not_computed_and_that_of_others_once(n_mapped):
    textured = replace(BALL, material=Material(base_color=IMAGE))
    hidden = replace(
        textured, name="hidden", transform=transform_matrix(translate=(-0.5, -0.5, -3.0))
    )
    frame = render_scene(scene_of(replace(BALL, mapping=None), hidden), OPTIONS)
    assert not n_mapped
    (row,) = (row for row in plan_rows(frame.plan, frame.costs) if row.name == "mapping")
    assert row.skipped == "it reaches no pixel"
    # Cameras that see it later share one mapping, computed at the first.
    scene = scene_of(replace(BALL, mapping=None), hidden)
    prepared = prepare(scene, OPTIONS)
    around = replace(VIEW, position=(-3.0, -3.0, -9.0), target=(-0.5, -0.5, -3.0))
    cameras = [camera_of(replace(scene, view=view), OPTIONS) for view in (VIEW, around, around)]
    frames = [draw(prepared, camera) for camera in cameras]
    assert len(n_mapped) == 1
    expected = draw(prepare(scene_of(scene.objects[0], apply_mapping(hidden)), OPTIONS), cameras[1])
    assert frames[1].color.tobytes() == expected.color.tobytes() == frames[2].color.tobytes()


def test_a_mapping_that_cannot_be_computed_names_the_file_and_the_object(tmp_path):
    path = tmp_path / "scene.toml"
    write_mesh(cube(), tmp_path / "box.obj")
    ball = '[[objects]]\nname = "ball"\nmesh = "box.obj"\nmapping = "parametric"\n'
    path.write_text(ball)
    render_scene(read_scene(path), OPTIONS)  # nothing reads it
    checker = '{procedure = "checker", space = "uv"}'
    path.write_text(f'{ball}material = {{shading = "unlit", base_color = {checker}}}\n')
    with pytest.raises((FileError, UnwrapError), match=r"scene\.toml.*ball"):
        render_scene(read_scene(path), OPTIONS)


def test_light_maps_lie_on_the_coordinates_of_the_mapping():
    found, expected = (
        bake_light_maps(scene_of(item)).maps[0].values for item in (BALL, apply_mapping(BALL))
    )
    np.testing.assert_array_equal(found, expected)
