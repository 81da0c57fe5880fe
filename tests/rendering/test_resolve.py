import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.mesh.shapes import plane
from texbake.rendering.effect import Plan
from texbake.rendering.fragments import DrawnObject, Fragments
from texbake.rendering.rasterize import VisibilityBuffer
from texbake.rendering.resolve import Frame, Sums
from texbake.rendering.results import Costs
from texbake.rendering.scene.material import Material


def fragments(pixels, counts, light, normals=None):
    n = len(pixels)
    mesh = plane()
    return Fragments(
        target=0,
        drawn=DrawnObject(
            mesh=mesh, material=Material(), positions=mesh.positions, faces=mesh.faces
        ),
        drawn_faces=np.zeros(n, np.int32),
        drawn_weights=np.zeros((n, 2)),
        faces=np.zeros(n, np.int32),
        weights=np.zeros((n, 2)),
        changes=np.empty((0, 4), np.float32),
        places=np.zeros((n, 2), np.float32),
        pixels=np.array(pixels, np.int32),
        counts=np.array(counts, np.float32),
        back_facing=np.zeros(n, bool),
        normals=np.array([] if normals is None else normals, np.float32).reshape(-1, 3),
        light=np.array(light, np.float32),
    )


def test_a_pixel_is_the_mean_of_its_samples_over_what_is_behind():
    def summed():
        sums = Sums.empty(1, 2, n_samples=4, keeps_normals=True)
        sums.add(fragments([1, 1], [1, 1], [[1, 0, 0], [0, 0.5, 0]], [[1, 0, 0], [0, 1, 0]]))
        return sums

    color, coverage, normals = summed().finished(np.array([0.0, 0.0, 1.0], np.float32))
    np.testing.assert_allclose(color[0], [[0, 0, 1, 1], [0.25, 0.125, 0.5, 1.0]])
    np.testing.assert_array_equal(coverage, [[0, 0.5]])
    np.testing.assert_allclose(normals[0, 1], [0.5**0.5, 0.5**0.5, 0], rtol=1e-6)
    np.testing.assert_array_equal(normals[0, 0], 0.0)
    clear, _, _ = summed().finished(None)
    np.testing.assert_allclose(clear[0], [[0, 0, 0, 0], [0.5, 0.25, 0, 0.5]])
    # A picture behind: each pixel over its own.
    picture = np.array([[[0.0, 0.5, 0.0], [1.0, 1.0, 1.0]]], np.float32)
    over, _, _ = summed().finished(picture)
    np.testing.assert_allclose(over[0], [[0, 0.5, 0, 1], [0.75, 0.625, 0.5, 1.0]])


@pytest.mark.parametrize("n_samples", [1, 9, 49])
def test_a_full_pixel_is_fully_covered(n_samples):
    # 49 times 1 / 49 is not 1: samples have to be counted, and the sum divided.
    sums = Sums.empty(1, 1, n_samples=n_samples, keeps_normals=False)
    for _ in range(n_samples):
        sums.add(fragments([0], [1], [[0.25] * 3]))
    color, coverage, normals = sums.finished(np.ones(3, np.float32))
    assert coverage[0, 0] == 1.0
    np.testing.assert_array_equal(color[0, 0], [0.25, 0.25, 0.25, 1.0])
    assert normals is None


def test_normals_that_cancel_leave_none():
    sums = Sums.empty(1, 1, n_samples=4, keeps_normals=True)
    sums.add(fragments([0, 0], [2, 2], np.zeros((2, 3)), [[0, 0, 1], [0, 0, -1]]))
    _, _, normals = sums.finished(None)
    np.testing.assert_array_equal(normals[0, 0], 0.0)


def test_a_frame_tells_the_nearest_triangle_of_a_pixel_and_its_distance():
    ids = np.array([[7, 3, -1, -1], [-1, -1, -1, -1]], np.int32)
    depths = np.array([[0.25, 0.5, 0, 0], [0, 0, 0, 0]], np.float32)
    frame = Frame(
        color=np.zeros((1, 2, 4), np.float32),
        coverage=np.zeros((1, 2), np.float32),
        plan=Plan((), ()),
        costs=Costs(),
        _visibility=VisibilityBuffer(ids, depths),
        _near=0.1,
    )
    np.testing.assert_array_equal(frame.face_ids, [[3, -1]])
    np.testing.assert_array_equal(frame.depths, np.float32([[0.1 / 0.5, np.inf]]))
    with pytest.raises(OptionError, match="has no normals"):
        _ = frame.normals
