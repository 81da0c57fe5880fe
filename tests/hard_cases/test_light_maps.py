"""Light maps of every scene of the catalog."""

import numpy as np

import texbake
from texbake.errors import UvError

OPTIONS = texbake.BakeOptions(size=16, threads=1)


def test_light_is_finite_not_negative_and_shown_again(scene_case):
    made = scene_case.make()
    try:
        baked = texbake.bake_light_maps(made, OPTIONS)
    except UvError as error:
        assert "\n" not in str(error)
        return  # there are no coordinates to bake to
    for item in baked.maps:
        assert np.isfinite(item.values).all() and item.values.min() >= 0.0
        assert (item.values[~item.has_data] >= 0.0).all()
    options = texbake.RenderOptions(width=24, height=16)
    frame = texbake.render_scene(baked.shown_in(made), options, threads=1)
    assert np.isfinite(frame.color).all() and frame.color.min() >= 0.0


def test_threads_change_no_byte_of_a_light_map(scene_case):
    made = scene_case.make()
    try:
        one, three = (
            texbake.bake_light_maps(made, texbake.BakeOptions(size=8, threads=n)) for n in (1, 3)
        )
    except UvError:
        return
    for ours, theirs in zip(one.maps, three.maps, strict=True):
        np.testing.assert_array_equal(ours.values, theirs.values)
