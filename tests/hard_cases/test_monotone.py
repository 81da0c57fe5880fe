"""Each step of a setting makes the error smaller; tests/study has those of the study's knobs."""

from itertools import pairwise

import numpy as np

import texbake
from texbake.mesh.shapes import plane
from texbake.texture.encoding import decode_heights, decode_normals, encode_heights, encode_normals

POINTS = np.random.default_rng(8).random((2000, 2))


def wave(x, y):
    """Heights and unit normals of a closed form over the unit square."""
    heights = 0.02 * np.sin(5.0 * x) * np.cos(7.0 * y)
    along = 0.1 * np.cos(5.0 * x) * np.cos(7.0 * y)
    up = -0.14 * np.sin(5.0 * x) * np.sin(7.0 * y)
    normals = np.stack([-along, -up, np.ones_like(x)], axis=-1)
    return heights, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def high_poly(n):
    """The wave over a grid, with the closed form's own normals at its vertices."""
    flat = plane(n, n)
    heights, normals = wave(*flat.positions[:, :2].T)
    points = np.column_stack([flat.positions[:, :2], heights])
    return flat.replace(positions=points, normals=normals, normal_faces=flat.faces)


def degrees(vectors, units):
    chords = np.linalg.norm(np.asarray(vectors, np.float64) - units, axis=-1)
    return float(np.degrees(2.0 * np.arcsin(np.minimum(chords / 2.0, 1.0))).mean())


def assert_falling(errors):
    assert all(after < before for before, after in pairwise(errors)), errors


def test_high_poly_mesh():
    """Grids of ever more faces, baked at one size: the mesh's own error falls by four a step."""
    centers = (np.arange(27) + 0.5) / 27.0  # on no vertex of the grids
    heights, _ = wave(*np.meshgrid(centers, centers[::-1]))
    errors = []
    for n in (4, 8, 16, 32, 64):
        options = texbake.BakeOptions(size=27, maps=("displacement",))
        found = texbake.bake(high_poly(n), plane(), options).maps["displacement"].values[..., 0]
        errors.append(float(np.abs(found - heights).mean()))
    assert_falling(errors)
    # Half the width of a face is a quarter of its sagitta, once faces are smaller than waves.
    assert all(3.0 < before / after < 5.0 for before, after in pairwise(errors[1:]))


def test_bit_depth():
    heights, normals = wave(*POINTS.reshape(-1, 40, 2).transpose(2, 0, 1))
    heights = heights.astype(np.float32)
    angles, errors = [], []
    for bits in (8, 16, 32):
        codes = encode_normals(normals.astype(np.float32), bits=bits)
        angles.append(degrees(decode_normals(codes), normals))
        if bits < 32:
            codes = encode_heights(heights, bits=bits, mid=0.5, scale=0.05)
            back = decode_heights(codes, mid=0.5, scale=0.05)
            errors.append(float(np.abs(back - heights).mean()))
    assert_falling(angles)
    assert_falling(errors)
    assert 200.0 < errors[0] / errors[1] < 300.0  # steps of 1/255 and of 1/65535: 257
