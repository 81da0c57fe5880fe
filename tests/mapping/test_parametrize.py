"""`parametrize` beside the function of xatlas that it stands for."""

import inspect

import numpy as np
import pytest

import texbake


@pytest.fixture
def arrays():
    torus = texbake.make("torus", resolution=(12, 8))
    return torus.positions.astype(np.float32), torus.faces.astype(np.uint32)


def test_the_answer_indexes_the_given_vertices(arrays):
    positions, faces = arrays
    mapping, indices, uvs = texbake.parametrize(positions, faces)
    assert (mapping.dtype, indices.dtype, uvs.dtype) == (np.uint32, np.uint32, np.float32)
    np.testing.assert_array_equal(mapping[indices], faces)
    assert uvs.shape == (len(mapping), 2)
    assert uvs.min() >= 0.0
    assert uvs.max() <= 1.0
    assert set(indices.ravel()) == set(range(len(mapping)))


def test_the_coordinates_are_those_of_unwrap(arrays):
    positions, faces = arrays
    _, indices, uvs = texbake.parametrize(positions, faces, quality="fast", size=256)
    mesh = texbake.Mesh(positions=positions.astype(np.float64), faces=faces.astype(np.int32))
    unwrapped = texbake.unwrap(mesh, quality="fast", size=256)
    np.testing.assert_array_equal(uvs[indices], unwrapped.corner_uvs().astype(np.float32))


def test_it_is_called_and_answers_as_xatlas_does(arrays):
    xatlas = pytest.importorskip("xatlas", reason="xatlas has no wheel for this Python")
    positions, faces = arrays
    ours, theirs = texbake.parametrize(positions, faces), xatlas.parametrize(positions, faces)
    assert [array.dtype for array in ours] == [array.dtype for array in theirs]
    assert [array.ndim for array in ours] == [array.ndim for array in theirs]
    np.testing.assert_array_equal(ours[0][ours[1]], theirs[0][theirs[1]])
    named = list(inspect.signature(texbake.parametrize).parameters)[:4]
    assert named == ["positions", "indices", "normals", "uvs"]
