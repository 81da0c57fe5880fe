"""What a model file holds that a mesh has no place for is named."""

import pytest

from tests.fbx_writer import binary, rich_scene
from tests.glb import glb_bytes, read_glb
from texbake.errors import ReadWarning
from texbake.mesh.files.contents import read_contents
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.files.unread_parts import unread_parts
from texbake.mesh.shapes import cube
from texbake.verbs.transform import transform_file


def gltf_with(path, **fields):
    """A cube in a GLB file, with further objects in its JSON."""
    write_glb(cube(), path)
    document, data = read_glb(path)
    path.write_bytes(glb_bytes({**document, **fields}, data))
    return path


def test_animations_and_lights_of_gltf_are_counted(tmp_path):
    path = gltf_with(
        tmp_path / "a.glb",
        animations=[{"channels": [], "samplers": []}] * 2,
        skins=[{"joints": [0]}],
        extensions={"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
    )
    assert read_contents(path).passed_over == ("2 animations", "1 skin", "1 light")
    # The reader itself warns of the skin.
    assert unread_parts(path) == ("2 animations", "1 light")
    with pytest.warns(ReadWarning, match="left out 1 skin"):
        (warning,) = transform_file(path, tmp_path / "b.glb").warnings
    assert "written without 2 animations, 1 light" in warning


def test_a_plain_file_has_nothing_to_pass_over(tmp_path):
    write_glb(cube(), tmp_path / "a.glb")
    assert unread_parts(tmp_path / "a.glb") == ()
    assert unread_parts(tmp_path / "a.obj") == ()


def test_fbx_animations_and_skins_are_counted(tmp_path):
    nodes = rich_scene(7400)
    _, _, objects = nodes[1]
    objects.append(("AnimationStack", [70, "walk\0\1AnimStack", ""], []))
    objects.append(("Deformer", [71, "\0\1Deformer", "Skin"], []))
    path = tmp_path / "a.fbx"
    path.write_bytes(binary(nodes))
    assert unread_parts(path) == ()  # the animation moves nothing
    assert read_contents(path).passed_over == ("1 skin",)
    objects.append(("AnimationCurve", [72, "\0\1AnimCurve", ""], []))
    path.write_bytes(binary(nodes))
    assert unread_parts(path) == ("1 animation",)
    assert read_contents(path).passed_over == ("1 animation", "1 skin")
