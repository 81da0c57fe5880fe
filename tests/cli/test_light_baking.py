"""`texbake bake-lightmap`: files, summary, and what it refuses."""

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from texbake import read_image
from texbake.jobs.light_maps import file_names

Invoke = Callable[..., Result]

SCENE = """
[[lights]]
kind = "directional"
direction = [0, 0, -1]
intensity = 2.0
shadow = {}

[[objects]]
name = "the floor"
mesh = "low.obj"
material = { shading = "lambert" }
"""


@pytest.fixture
def scene(workplace: Path) -> Path:
    (workplace / "room.toml").write_text(SCENE, encoding="utf-8")
    return workplace


def test_a_file_for_each_object(scene: Path, invoke: Invoke) -> None:
    result = invoke("bake-lightmap room.toml -o maps --size 64 --padding 1")
    assert "wrote maps/the_floor.exr" in result.output
    pixels = read_image(scene / "maps" / "the_floor.exr", color=True).pixels
    assert pixels.shape == (64, 64, 3)
    # The top of the sphere has all of the light, its lower half none.
    assert pixels.max() == pytest.approx(2.0, rel=0.05)
    assert pixels[40:].max() == pytest.approx(0.0, abs=1e-6)
    invoke("bake-lightmap room.toml -o maps --size 64 --format png --quiet")
    assert (scene / "maps" / "the_floor.png").is_file()


def test_objects_of_one_name_get_files_of_their_own() -> None:
    names = ["lamp", "Lamp", "lamp_2", "a/b", "..", "", "Stra\u00dfe 1"]
    files = file_names(names)
    assert files == ["lamp", "Lamp_2", "lamp_2_2", "a_b", "object", "object_2", "Stra\u00dfe_1"]
    assert len({name.lower() for name in files}) == len(names)
