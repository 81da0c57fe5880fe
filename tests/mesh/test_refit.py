"""Vertices of simplified meshes fitted to the original, with flat parts and rims as they were."""

import numpy as np
import pytest

from texbake.mesh.distance import surface_distance
from texbake.mesh.mesh import Mesh
from texbake.mesh.parametric.make import make
from texbake.mesh.refit import refitted
from texbake.mesh.shapes import grid_sphere, icosphere
from texbake.mesh.simplify import simplify


def shaken(mesh, size):
    """A mesh whose vertices are off by some of a length."""
    steps = np.random.default_rng(7).uniform(-size, size, (mesh.n_vertices, 3))
    return mesh.replace(positions=mesh.positions + steps)


@pytest.mark.parametrize("size", [0.0, 0.05])
def test_a_coarse_sphere_lies_within_and_outside_the_fine_one_alike(size):
    """Inscribed, its middle would be too small; the best one cuts through the sphere."""
    source, low = icosphere(5), shaken(icosphere(2), size)
    fitted = refitted(source, low)
    before, after = surface_distance(source, low), surface_distance(source, fitted)
    assert after.rms < 0.6 * before.rms
    assert after.max < before.max
    heights = np.linalg.norm(fitted.positions[fitted.faces].mean(axis=1), axis=1)
    assert (np.linalg.norm(fitted.positions, axis=1) > 1.0).mean() > 0.9
    assert (heights < 1.0).mean() > 0.9


def test_any_number_of_threads_gives_the_same_bytes():
    source, low = icosphere(4), shaken(icosphere(2), 0.02)
    one, several = (refitted(source, low, threads) for threads in (1, 3))
    assert one.positions.tobytes() == several.positions.tobytes()


def test_vertices_with_texture_coordinates_move_along_their_normals():
    source, low = icosphere(5), icosphere(2)
    low = low.replace(uvs=low.positions[:, :2].copy(), uv_faces=low.faces)
    fitted = refitted(source, low)
    lengths = np.linalg.norm(fitted.positions, axis=1)
    assert lengths.min() > 1.005
    assert fitted.positions / lengths[:, None] == pytest.approx(low.positions, abs=2e-4)
    assert surface_distance(source, fitted).rms < 0.4 * surface_distance(source, low).rms


def test_open_edges_stay():
    source = grid_sphere(60, 120, pole_margin=0.6)
    low = grid_sphere(9, 18, pole_margin=0.6)
    at_rim = np.abs(np.abs(low.positions[:, 2]) - np.cos(0.6)) < 1e-9
    fitted = refitted(source, low)
    assert at_rim.sum() == 36
    assert np.array_equal(fitted.positions[at_rim], low.positions[at_rim])
    assert surface_distance(source, fitted).rms < 0.8 * surface_distance(source, low).rms


def test_flat_parts_stay_flat():
    """The caps of a barrel, whose sides are curved both ways."""
    barrel = make("cylinder", resolution=(96, 24), caps=True)
    x, y, z = barrel.positions.T
    bulge = 1.3 - 0.3 * y**2
    source = Mesh(positions=np.stack([bulge * x, y, bulge * z], axis=1), faces=barrel.faces)
    low = simplify(source, 200)
    fitted = refitted(source, low)
    flat = np.ptp(low.positions[low.faces][..., 1], axis=1) == 0.0
    assert flat.sum() > 10
    assert np.abs(fitted.positions[low.faces[flat]][..., 1]) == pytest.approx(1.0, abs=1e-7)
    assert surface_distance(source, fitted).rms < 0.9 * surface_distance(source, low).rms
