import numpy as np
import pytest

from texbake.render.resolve import resolve
from texbake.render.shade import Shading
from texbake.render.visibility import Visibility


def samples(n):
    """One pixel of n x n samples, the first of which are covered, with what they show."""

    def make(face_ids, colors, normals, depths):
        shape = (n, n)

        def spread(values, width):
            out = np.zeros((n * n, width), np.float32)
            out[: len(values)] = values
            return out.reshape(*shape, width)

        ids = np.full(n * n, -1, np.int32)
        ids[: len(face_ids)] = face_ids
        visibility = Visibility(
            ids.reshape(shape),
            np.zeros((*shape, 2), np.float32),
            spread(np.reshape(depths, (-1, 1)), 1)[..., 0],
            np.zeros(shape, bool),
        )
        return visibility, Shading(spread(colors, 3), spread(normals, 3))

    return make


def test_a_pixel_is_the_mean_of_its_samples_over_the_background():
    visibility, shading = samples(2)(
        [7, 3], [[1, 0, 0], [0, 0.5, 0]], [[1, 0, 0], [0, 1, 0]], [0.25, 0.5]
    )
    frame = resolve(
        visibility, shading, supersampling=2, background=(0.0, 0.0, 1.0), near=0.1, threads=1
    )
    np.testing.assert_allclose(frame.color[0, 0], [0.25, 0.125, 0.5, 1.0])
    np.testing.assert_allclose(frame.normals[0, 0], [0.5**0.5, 0.5**0.5, 0], rtol=1e-6)
    assert frame.coverage[0, 0] == 0.5
    assert frame.face_ids[0, 0] == 3  # the nearer
    assert frame.depths[0, 0] == np.float32(0.1 / 0.5)
    clear = resolve(visibility, shading, supersampling=2, background=None, near=0.1)
    np.testing.assert_allclose(clear.color[0, 0], [0.5, 0.25, 0, 0.5])


@pytest.mark.parametrize("n", [1, 3, 7])
def test_a_full_pixel_is_fully_covered(n):
    # 49 times 1 / 49 is not 1: it has to be divided.
    visibility, shading = samples(n)(
        [0] * n * n, [[0.25] * 3] * n * n, [[0, 0, 1]] * n * n, [0.5] * n * n
    )
    frame = resolve(visibility, shading, supersampling=n, background=(1.0, 1.0, 1.0), near=1.0)
    assert frame.coverage[0, 0] == 1.0
    np.testing.assert_array_equal(frame.color[0, 0], [0.25, 0.25, 0.25, 1.0])


def test_normals_that_cancel_leave_none():
    visibility, shading = samples(2)([1, 2], np.zeros((2, 3)), [[0, 0, 1], [0, 0, -1]], [0.5, 0.5])
    frame = resolve(visibility, shading, supersampling=2, background=None, near=1.0)
    np.testing.assert_array_equal(frame.normals[0, 0], 0.0)
    assert frame.face_ids[0, 0] == 1  # the first of equally near ones
