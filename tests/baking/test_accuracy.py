"""A sphere with a closed-form displacement, baked onto 512 triangles, against its own formula.

r(theta, phi) = 1 + 0.04 sin(20 theta) sin(20 phi), with z along theta = 0, as a grid of 998,000
triangles in float32. The decoded maps, turned back to model space, are compared with the formula at
the very points that the rays of the texels hit.
"""

from dataclasses import replace

import numpy as np
import pytest

from texbake import BakeOptions, bake, remap, unwrap
from texbake.baking.bake import remap_hits
from texbake.mesh.normals import shading_normals, smooth_normals
from texbake.mesh.shapes import grid_sphere, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.texture.encoding import decode_normals, encode_normals

AMPLITUDE, WAVES = 0.04, 20
SIZE = 512


def radius(theta, phi):
    return 1 + AMPLITUDE * np.sin(WAVES * theta) * np.sin(WAVES * phi)


def angles_of(points):
    x, y, z = points.T
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def analytic_normals(points):
    """Normals of the surface r(theta, phi) at points given in its directions."""
    theta, phi = angles_of(points)
    zero = np.zeros_like(theta)
    r = radius(theta, phi)
    by_theta = AMPLITUDE * WAVES * np.cos(WAVES * theta) * np.sin(WAVES * phi)
    by_phi = AMPLITUDE * WAVES * np.sin(WAVES * theta) * np.cos(WAVES * phi)
    sin, cos = np.sin(theta), np.cos(theta)
    outward = np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=1)
    along_theta = np.stack([cos * np.cos(phi), cos * np.sin(phi), -sin], axis=1)
    along_phi = np.stack([-np.sin(phi), np.cos(phi), zero], axis=1)
    # The gradient of (distance from the center) - r.
    with np.errstate(divide="ignore", invalid="ignore"):
        normals = (
            outward * r[:, None]
            - along_theta * by_theta[:, None]
            - along_phi * (by_phi / sin)[:, None]
        )
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def high():
    mesh = grid_sphere(500, 1000, radius)
    assert mesh.n_faces == 998_000
    return mesh.replace(positions=mesh.positions.astype(np.float32))


@pytest.fixture(scope="module")
def low():
    mesh = uv_sphere(17, 16)
    assert mesh.n_faces == 512
    return mesh


@pytest.fixture(scope="module")
def baked(high, low):
    """A bake of the normals in model space, from whose hits the other maps are made."""
    options = BakeOptions(
        size=SIZE, space="object", front=0.1, back=0.1, rays="vertex", padding=0, keep_hits=True
    )
    return bake(high, low, options)


def mean_angle(result, low):
    """Mean angle in degrees between the decoded 16-bit map and the formula."""
    assert result.report.texels_missed == 0
    codes = encode_normals(result.maps["normal"].values, bits=16)
    hits = result.hits
    values = decode_normals(codes).reshape(-1, 3)[hits.texel_ids].astype(float)
    b = hits.low_barycentrics.astype(float)
    weights = np.column_stack([1 - b.sum(axis=1), b])
    points = np.einsum("ni,nij->nj", weights, low.positions[low.faces[hits.low_faces]])
    points += hits.offsets
    if result.report.options.space == "tangent":
        values = to_model_space(values, weights, hits.low_faces, low)
    # Near the poles the grid's triangles are needles; within 2 % of an edge a texel may straddle.
    counted = (np.sin(angles_of(points)[0]) > 0.15) & (weights.min(axis=1) > 0.02)
    assert counted.sum() > 125_000
    chords = np.linalg.norm(values - analytic_normals(points), axis=1)[counted]
    # Texels are weighted by the surface that they cover, which varies with the latitude.
    areas = texel_areas(low)[hits.low_faces][counted]
    return np.average(np.degrees(2 * np.arcsin(chords / 2)), weights=areas)


def texel_areas(mesh):
    """Surface per texel of each face, up to a factor."""
    corners, uvs = mesh.positions[mesh.faces], mesh.corner_uvs()
    in_space = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    a, b = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    return in_space / np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def to_model_space(values, weights, faces, mesh):
    """Do what a renderer does with tangent-space normals: x T + y B + z N, then normalize."""
    normals, corners = shading_normals(mesh)
    tangents = corner_tangents(mesh)[faces].astype(float)
    n = np.einsum("ni,nij->nj", weights, normals[corners[faces]])
    t = np.einsum("ni,nij->nj", weights, tangents[:, :, :3])
    b = np.cross(n, t) * tangents[:, 0, 3:]
    vectors = values[:, :1] * t + values[:, 1:2] * b + values[:, 2:] * n
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize(("space", "limit"), [("object", 0.247), ("tangent", 0.25)])
def test_normals_of_the_high_poly_mesh(baked, low, space, limit):
    """The interpolated vertex normals of the high-poly mesh are themselves off by 0.245 degrees."""
    result = remap_hits(baked, replace(baked.report.options, space=space))
    assert 0.2 < mean_angle(result, low) <= limit


def test_normals_on_an_atlas(high, low, baked):
    atlas = unwrap(low, size=SIZE, padding=2)
    result = bake(high, atlas, replace(baked.report.options, space="tangent"))
    assert 0.2 < mean_angle(result, atlas) <= 0.25


def test_normals_of_the_file(high, low, baked):
    """With exact normals in the file, only their interpolation is off: by 0.099 degrees."""
    exact = high.replace(normals=analytic_normals(high.positions), normal_faces=high.faces)
    assert 0.05 < mean_angle(remap(baked, exact, low, baked.report.options), low) <= 0.102


def test_displacement_of_the_sphere(high, low, baked):
    """Displaced points lie on the surface of the formula, well within 1e-3 of the diagonal."""
    result = remap_hits(baked, replace(baked.report.options, maps=("displacement",)))
    hits = result.hits
    heights = result.maps["displacement"].values.reshape(-1)[hits.texel_ids].astype(float)
    b = hits.low_barycentrics.astype(float)
    weights = np.column_stack([1 - b.sum(axis=1), b])
    faces = low.faces[hits.low_faces]
    points = np.einsum("ni,nij->nj", weights, low.positions[faces])
    directions = np.einsum("ni,nij->nj", weights, smooth_normals(low)[faces])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    displaced = points + heights[:, None] * directions
    away = np.abs(np.linalg.norm(displaced, axis=1) - radius(*angles_of(displaced)))
    # The grid's chords are off by h^2 / 8 of the curvature: 2e-5 of the diagonal of 3.5.
    assert away.max() < 1e-3 * high.diagonal and away.mean() < 2e-5 * high.diagonal
