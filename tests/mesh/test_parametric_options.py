"""Options of surfaces: which shape reads which, and their ranges."""

from dataclasses import fields

import numpy as np
import pytest

from texbake import MakeOptions, OptionError, make
from texbake.mesh.parametric.make import _MAKERS
from texbake.mesh.parametric.options import MAX_TRIANGLES, SHAPE_DEFAULTS, SHAPES

SOURCES = {
    "revolution": {"profile": [(1, 0), (1, 1)]},
    "bezier": {"patches": np.random.default_rng(0).random((1, 4, 4, 3))},
    "height-field": {"image": np.zeros((3, 4))},
    "cylindrical-range": {"image": np.ones((3, 4))},
    "depth-image": {"image": np.ones((3, 4))},
}


def test_every_shape_is_made_with_its_defaults():
    assert tuple(_MAKERS) == SHAPES
    for shape in SHAPES:
        mesh = make(shape, **SOURCES.get(shape, {}))
        assert mesh.uvs is not None
        assert mesh.name == shape.replace("-", " ")


def test_the_table_has_every_option_and_no_other():
    read = {name for defaults in SHAPE_DEFAULTS.values() for name in defaults}
    assert read == {field.name for field in fields(MakeOptions)}


@pytest.mark.parametrize("shape", SHAPES)
def test_an_option_that_a_shape_does_not_read_is_named(shape):
    values = {
        **dict.fromkeys(("radius", "height", "width", "minor_radius", "turns", "crease"), 1.0),
        **{"sides": 6, "caps": False, "twists": 1, "profile": "a", "patches": "a", "image": "a"},
    }
    for name in values.keys() - SHAPE_DEFAULTS[shape].keys():
        with pytest.raises(OptionError, match=f"^{name}: the shape {shape} "):
            make(shape, **SOURCES.get(shape, {}), **{name: values[name]})


@pytest.mark.parametrize("shape", SOURCES)
def test_a_missing_source_is_named(shape):
    (name,) = SOURCES[shape]
    with pytest.raises(OptionError, match=f"^{name}: the shape {shape} needs it"):
        make(shape)


@pytest.mark.parametrize(
    ("shape", "options", "message"),
    [
        ("cube", {}, "shape: cube is not one of plane, cylinder,"),
        ("sphere", {"resolution": 0}, "resolution: 0 is out of range"),
        ("sphere", {"resolution": (8, -1)}, "resolution: -1 is out of range"),
        ("sphere", {"resolution": 8.5}, "neither a whole number nor"),
        ("sphere", {"resolution": 10**9}, "makes 2,000,000,000,000,000,000 triangles; 20,000,000"),
        ("sphere", {"resolution": (8, 1)}, "resolution: 8x1 is too small"),
        ("torus", {"resolution": 2}, "resolution: 2x2 is too small"),
        ("cylinder", {"sides": 10**9}, "triangles"),
        ("height-field", {**SOURCES["height-field"], "resolution": 10**5}, "20,000,000,000 tri"),
        ("sphere", {"radius": 0}, "radius: 0 is out of range"),
        ("sphere", {"radius": float("nan")}, "radius: nan is not a finite number"),
        ("torus", {"minor_radius": 1.0}, "minor_radius: 1.0 is not below the radius"),
        ("cylinder", {"sides": 2}, "sides: 2 is out of range; it must be 3 or more"),
        ("mobius", {"twists": 0.5}, "twists: 0.5 is not a whole number"),
        ("revolution", {"turns": 1.5}, "turns: 1.5 is out of range"),
        ("revolution", {"crease": 91}, "crease: 91 is out of range"),
    ],
)
def test_values_out_of_range(shape, options, message):
    with pytest.raises(OptionError) as caught:
        make(shape, **options)
    assert message in str(caught.value)


def test_the_limit_of_triangles_is_that_of_the_message():
    side = int((MAX_TRIANGLES / 2) ** 0.5)
    MakeOptions(resolution=side).settings("plane")
    with pytest.raises(OptionError, match="are the most"):
        MakeOptions(resolution=side + 1).settings("plane")


def test_changes_go_on_top_of_options():
    options = MakeOptions(radius=3, resolution=8)
    assert make("sphere", options).bounds[1, 1] == 3
    assert make("sphere", options, radius=2).bounds[1, 1] == 2
    assert options.radius == 3


@pytest.mark.parametrize("scale", [2.0**-20, 2.0**20])
@pytest.mark.parametrize("shape", ["sphere", "cylinder", "cone", "torus", "mobius", "plane"])
def test_size_changes_only_the_size(shape, scale):
    lengths = {"radius": 1.5, "height": 0.7, "width": 0.3, "minor_radius": 0.2}
    lengths = {name: length for name, length in lengths.items() if name in SHAPE_DEFAULTS[shape]}
    one = make(shape, **lengths)
    other = make(shape, **{name: scale * length for name, length in lengths.items()})
    np.testing.assert_array_equal(other.positions, scale * one.positions)
    np.testing.assert_array_equal(other.uvs, one.uvs)
    np.testing.assert_array_equal(other.normals, one.normals)
