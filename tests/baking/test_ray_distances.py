"""Ray distances fitted at each vertex: no part takes the surface of another."""

import numpy as np
import pytest

from texbake import BakeOptions, Mesh, bake, unwrap
from texbake.baking.ray_distances import MARGIN
from texbake.baking.scenes import BakeScenes
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.progress import Stages

OPTIONS = BakeOptions(maps=("object-id", "displacement"), size=256, padding=0)


def box(center, size):
    solid = cube()
    positions = (solid.positions - solid.bounds.mean(axis=0)) / np.ptp(solid.bounds, axis=0)
    return Mesh(positions=positions * size + center, faces=solid.faces)


def ball(center, radii, rows=24):
    sphere = uv_sphere(rows, 2 * rows)
    return Mesh(positions=sphere.positions * radii + center, faces=sphere.faces)


def grouped(parts, name):
    ids = np.concatenate([np.full(part.n_faces, i, np.int32) for i, part in enumerate(parts)])
    names = tuple(f"part {i}" for i in range(len(parts)))
    return join_meshes(parts).replace(face_groups=ids, group_names=names, name=name)


def hand():
    """Five fingers close together, on a palm with a wart that lengthened all rays."""
    places = [(0.3 * i, 0.0, 0.0) for i in range(5)]
    high = [ball(place, (0.14, 0.14, 1.0)) for place in places]
    low = [ball(place, (0.145, 0.145, 1.02), rows=8) for place in places]
    palm = box((0.6, 0.0, -1.6), (1.8, 0.6, 0.8))
    wart = ball((0.6, -0.5, -1.6), (0.2, 0.4, 0.2))
    # The wart is part of the palm, and the low-poly mesh does without it.
    high_palm = join_meshes([palm, wart])
    return grouped([*high, high_palm], "high"), grouped([*low, palm], "low")


def machine():
    """Plates in a stack, a pipe through them, and a knob that stands out far."""
    plates = [box((0.0, 0.0, 0.2 * i), (2.0, 2.0, 0.12)) for i in range(4)]
    pipe = ball((0.0, 0.0, 0.3), (0.3, 0.3, 1.2))
    low_pipe = ball((0.0, 0.0, 0.3), (0.31, 0.31, 1.25), rows=10)
    knob = box((0.7, 0.7, 1.0), (0.3, 0.3, 0.7))
    return (
        grouped([*plates[:3], join_meshes([plates[3], knob]), pipe], "high"),
        grouped([*plates, low_pipe], "low"),
    )


def share_of_other_parts(high, low, **changes):
    """Share of the texels that have the surface of another part, and the result."""
    options = BakeOptions(
        **{f: getattr(OPTIONS, f) for f in ("maps", "size", "padding")}, **changes
    )
    result = bake(high, low, options)
    found = result.maps["object-id"].values[..., 0]
    expected = low.face_groups[result.texel_faces] + 1
    return float(np.mean(found[result.has_data] != expected[result.has_data])), result


@pytest.mark.parametrize(("make", "most"), [(hand, 0.001), (machine, 0.02)])
def test_no_part_takes_the_surface_of_another(make, most):
    high, low = make()
    low = unwrap(low, size=256, padding=2)
    fitted, result = share_of_other_parts(high, low)
    report = result.report
    before, _ = share_of_other_parts(high, low, front=report.front, back=report.back)
    assert before > 0.1
    assert fitted <= most
    assert report.texels_missed == 0
    front, back = report.median_reach
    assert front < 0.2 * report.front
    assert back <= report.back


def test_each_vertex_reaches_as_far_as_the_surface_around_it():
    """A step in the high-poly mesh over one half of a plane."""
    high = plane(32, 32)
    step = np.where(high.positions[:, 0] > 0.5, 0.25, 0.0)
    high = Mesh(positions=high.positions + step[:, None] * [0, 0, 1], faces=high.faces)
    low = plane(16, 16)
    scenes = BakeScenes.build(high, low, Stages())
    reach = scenes.reach(scenes.low, "smooth")
    front = scenes.frame.length_to_model(reach[..., 0])
    x = low.positions[low.faces, 0]
    assert front[x > 0.5] == pytest.approx(0.25 * MARGIN, rel=0.01)
    assert front[x < 0.25].max() < 0.01


def test_given_distances_and_cages_are_taken_as_they_are():
    high, low = plane(8, 8), plane()
    for changes in ({"front": 0.1}, {"back": 0.1}, {"front": 0.1, "back": 0.1}):
        assert bake(high, low, BakeOptions(size=8, **changes)).report.median_reach is None
    caged = bake(high, low, BakeOptions(size=8), cage=low).report
    assert caged.median_reach is None
    masked = bake(high, low, BakeOptions(size=8), offset_map=np.ones((2, 2))).report
    assert masked.median_reach is None
    assert bake(high, low, BakeOptions(size=8)).report.median_reach is not None


@pytest.mark.parametrize("max_reach", [None, 0.3, 0.05])
def test_no_height_is_greater_than_the_longest_ray(max_reach):
    """A knob that only the high-poly mesh has: rays reach less far if they must."""
    high, low = machine()
    low = unwrap(low, size=128, padding=2)
    result = bake(high, low, BakeOptions(maps=("displacement",), size=128, max_reach=max_reach))
    report = result.report
    heights = result.maps["displacement"].values[..., 0][result.has_data]
    assert report.measured
    assert -report.back <= heights.min() and heights.max() <= report.front
    assert (report.counts.faces_limited > 0) == (max_reach is not None)
    assert ("the most allowed" in dict(report.table())["distances"]) == (max_reach is not None)
    if max_reach is not None:
        assert report.front == max_reach


def test_rays_reach_a_peak_at_the_last_corners_of_faces():
    """A coarse tent over the square: its top is the last corner of each of its faces."""
    low = plane()
    least, greatest = low.bounds
    x, y = [least[0], greatest[0]], [least[1], greatest[1]]
    top = [(x[0] + x[1]) / 2, (y[0] + y[1]) / 2, 0.3]
    around = [[x[0], y[0], 0], [x[1], y[0], 0], [x[1], y[1], 0], [x[0], y[1], 0]]
    high = Mesh(
        positions=np.array([*around, top], dtype=np.float64),
        faces=np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], dtype=np.int32),
    )
    result = bake(high, low, BakeOptions(size=32))
    assert result.report.front is not None and result.report.front >= 0.3
    assert result.report.texels_missed == 0
