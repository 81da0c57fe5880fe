"""Laws that hold for every map: what a bake must not depend on, and how maps follow from others."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from texbake import BakeOptions, bake, remap
from texbake.baking.maps import MAP_NAMES, MAPS
from texbake.mesh.compose import transformed

REACH = {"front": 0.1, "back": 0.1}
ALL = BakeOptions(
    maps=MAP_NAMES, size=(40, 32), padding=2, secondary_rays=4, keep_hits=True, **REACH
)
# What scales with the model, by the power.
POWERS = {"height": 1, "vector": 1, "position": 1, "thickness": 1, "curvature": -1}
OF_HITS = tuple(name for name in MAP_NAMES if MAPS[name].needs == "hits")


@pytest.fixture(scope="module")
def baked(painted):
    high, low, materials = painted
    return bake(high, low, ALL, materials=materials)


def values(result):
    return {name: item.values for name, item in result.maps.items()}


def assert_equal(found, wanted, **tolerance):
    assert list(found.maps) == list(wanted.maps)
    np.testing.assert_array_equal(found.has_data, wanted.has_data)
    np.testing.assert_array_equal(found.texel_faces, wanted.texel_faces)
    for name, expected in values(wanted).items():
        if tolerance:
            np.testing.assert_allclose(found.maps[name].values, expected, err_msg=name, **tolerance)
        else:
            assert found.maps[name].values.tobytes() == expected.tobytes(), name


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"samples": 4, "space": "object", "fill": "push-pull"},
        {"rays": "vertex", "front": None, "back": None, "cull_back_faces": False},
        {"rays": "face", "on_miss": "closest", "front": 0.01, "back": 0.01,
         "maps": tuple(name for name in MAP_NAMES if name != "opacity")},
        {"samples": "adaptive", "max_error": "2deg,0.002", "keep_hits": False,
         "maps": ("normal", "displacement", "object-id", "ao")},
        {"orientation": "auto", "flipped": True, "max_memory": "1M", "keep_hits": False,
         "maps": OF_HITS},
    ],
    ids=lambda changes: " ".join(changes),
)  # fmt: skip
def test_the_number_of_threads_changes_no_byte(painted, changes):
    high, low, materials = painted
    changes = dict(changes)
    if changes.pop("flipped", False):
        high = high.replace(faces=high.faces[:, ::-1], uv_faces=high.uv_faces[:, ::-1])
    masks = {
        "skew_mask": np.linspace(0.0, 1.0, 12).reshape(3, 4),
        "offset_map": np.linspace(0.5, 1.0, 12).reshape(4, 3),
    }
    # So large that the work of each kernel is divided.
    large = replace(ALL, size=(190, 180), secondary_rays=2)
    images = masks if changes.get("rays") == "vertex" else {}
    one, three = (
        bake(high, low, replace(large, threads=n, **changes), materials=materials, **images)
        for n in (1, 3)
    )
    assert_equal(three, one)
    assert three.report.counts == one.report.counts
    assert three.report.distance_percentiles == one.report.distance_percentiles
    assert three.report.sampling == one.report.sampling


@pytest.mark.parametrize("exponent", [-20, 20])
def test_a_power_of_two_scales_lengths_and_changes_nothing_else(painted, baked, exponent):
    high, low, materials = painted
    scale = 2.0**exponent
    meshes = [mesh.replace(positions=mesh.positions * scale) for mesh in (high, low)]
    options = replace(ALL, front=0.1 * scale, back=0.1 * scale)
    found = bake(*meshes, options, materials=materials)
    for name, expected in values(baked).items():
        power = POWERS.get(MAPS[name].coding, 0)
        np.testing.assert_array_equal(found.maps[name].values, expected * scale**power, name)
    assert found.report.counts == baked.report.counts
    for percent, length in baked.report.distance_percentiles.items():
        assert found.report.distance_percentiles[percent] == length * scale


@pytest.mark.parametrize("space", ["tangent", "object"])
def test_a_moved_and_turned_model_has_moved_and_turned_maps(painted, baked, space):
    """Turn by a quarter about z, which is exact, and move by about the size of the model."""
    high, low, materials = painted
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, [2.0, -1.0, 0.5]
    meshes = [transformed(mesh, matrix) for mesh in (high, low)]
    options = replace(ALL, space=space)
    wanted = baked if space == "tangent" else remap(baked, high, low, options)
    found = bake(*meshes, options, materials=materials)
    same = (found.has_data == wanted.has_data) & found.has_data
    assert same.sum() > 0.999 * found.has_data.sum()
    for name, expected in values(wanted).items():
        kind = MAPS[name]
        if kind.needs != "hits":  # other rays of the same hemispheres
            continue
        if kind.coding == "position":
            expected = expected @ turn.T + matrix[:3, 3]
        elif space == "object" and kind.coding in ("normal", "vector"):
            expected = expected @ turn.T
        off = np.abs(found.maps[name].values - expected)[same].max(axis=1)
        # A ray at an edge may take the other face, whose group or corner is another one.
        assert np.mean(off > 2e-5) < 0.002, name


def test_the_order_of_faces_and_vertices_changes_nothing(painted, baked):
    high, low, materials = painted
    rng = np.random.default_rng(5)
    vertices, faces, low_faces = (
        rng.permutation(n) for n in (high.n_vertices, high.n_faces, low.n_faces)
    )
    place = np.argsort(vertices)
    other = high.replace(
        positions=high.positions[vertices], colors=high.colors[vertices],
        faces=place[high.faces][faces], uv_faces=high.uv_faces[faces],
        face_groups=high.face_groups[faces],
    )  # fmt: skip
    of_faces = replace(materials, face_materials=materials.face_materials[faces])
    turned = low.replace(
        faces=np.roll(low.faces[low_faces], 1, axis=1),
        uv_faces=np.roll(low.uv_faces[low_faces], 1, axis=1),
    )
    found = bake(other, turned, ALL, materials=of_faces)
    same = (found.has_data == baked.has_data) & found.has_data
    assert same.sum() > 0.999 * found.has_data.sum()
    for name, expected in values(baked).items():
        off = np.abs(found.maps[name].values - expected)[same].max(axis=1)
        assert np.mean(off > 2e-5) < 0.002, name


@pytest.mark.parametrize("turn", ["mirrored", "turned"])
def test_a_mirrored_or_turned_layout_has_mirrored_or_turned_maps(painted, baked, turn):
    """Normals and vectors in tangent space turn with it, and nothing else does."""
    high, low, materials = painted
    u, v = low.uvs.T
    uvs = np.stack([1.0 - u, v] if turn == "mirrored" else [1.0 - v, u], axis=1)
    options = ALL if turn == "mirrored" else replace(ALL, size=(32, 40))
    found = bake(high, low.replace(uvs=uvs), options, materials=materials)

    def back(image):
        return image[:, ::-1] if turn == "mirrored" else np.rot90(image, -1)

    same = back(found.has_data & (found.texel_faces >= 0)) & baked.has_data
    same &= back(found.texel_faces) == baked.texel_faces
    assert same.sum() > 0.95 * baked.has_data.sum()
    for name, expected in values(baked).items():
        kind, image = MAPS[name], back(found.maps[name].values)
        if kind.needs != "hits":
            continue
        if kind.coding in ("normal", "vector"):
            x, y, z = np.moveaxis(image, 2, 0)
            image = np.stack([-x, y, z] if turn == "mirrored" else [y, -x, z], axis=2)
        off = np.abs(image - expected)[same].max(axis=1)
        # Tangents at right angles to the other axis differ a little where charts are skewed.
        assert np.mean(off > (1e-3 if turn == "mirrored" else 0.03)) < 0.05, name


@pytest.mark.parametrize("samples", [4, 16])
def test_a_texel_combines_the_texels_that_its_samples_are_alone(painted, samples):
    """The mean of its hits, the unit mean of normals, or the first of them for ids."""
    high, low, materials = painted
    side = {4: 2, 16: 4}[samples]
    coarse = replace(ALL, maps=OF_HITS, size=(24, 16), samples=samples, padding=0)
    fine = replace(coarse, size=(24 * side, 16 * side), samples=1)
    found, parts = (bake(high, low, each, materials=materials) for each in (coarse, fine))

    def cells(image):
        split = image.reshape(16, side, 24, side, -1).swapaxes(1, 2)
        return split.reshape(16, 24, side**2, -1)

    is_hit = cells(parts.has_data).astype(float)
    np.testing.assert_array_equal(found.has_data, is_hit.any(axis=2)[..., 0])
    for name in OF_HITS:
        kind, cell = MAPS[name], cells(parts.maps[name].values).astype(float)
        if kind.combine == "first":
            expected = np.take_along_axis(cell, is_hit.argmax(axis=2)[:, :, None], axis=2)[:, :, 0]
        else:
            counted = cells(parts.texel_faces >= 0).astype(float) if kind.of_misses else is_hit
            expected = (cell * counted).sum(axis=2) / np.maximum(counted.sum(axis=2), 1.0)
        if kind.combine == "unit mean":
            expected /= np.maximum(np.linalg.norm(expected, axis=2, keepdims=True), 1e-30)
        off = np.abs(found.maps[name].values - expected)[found.has_data]
        assert off.max() < 2e-5, name


@pytest.mark.parametrize("name", MAP_NAMES)
def test_a_map_alone_is_that_among_others_and_that_of_kept_hits(painted, baked, name):
    high, low, materials = painted
    alone = replace(ALL, maps=(name,))
    direct = bake(high, low, alone, materials=materials)
    expected = baked.maps[name].values.tobytes()
    assert direct.maps[name].values.tobytes() == expected
    assert remap(baked, high, low, alone).maps[name].values.tobytes() == expected
    assert (direct.report.counts.secondary_rays > 0) == (MAPS[name].needs != "hits")
    assert (direct.hits.secondary is not None) == (MAPS[name].needs != "hits")


def test_a_result_is_the_same_after_pickling(baked):
    again = pickle.loads(pickle.dumps(baked))
    assert_equal(again, baked)
    assert [item.kind for item in again.maps.values()] == list(MAPS.values())
    assert again.report == baked.report


@pytest.mark.parametrize("padding", [0, 1, 5])
@pytest.mark.parametrize("fill", ["none", "push-pull"])
def test_padding_and_fill_change_no_texel_of_a_chart(painted, baked, padding, fill):
    """A texel of the padding has the value of the nearest texels with data, as far as it goes."""
    high, low, _ = painted
    squeezed = low.replace(uvs=0.2 + 0.6 * low.uvs)
    options = replace(ALL, maps=(*OF_HITS[:3], "object-id"), padding=padding, fill=fill)
    found = bake(high, squeezed, options)
    plain = remap(found, high, squeezed, replace(options, padding=0, fill="none"))
    data, covered = found.has_data, found.texel_faces >= 0
    rows, columns = np.nonzero(data)
    y, x = np.mgrid[: data.shape[0], : data.shape[1]]
    squares = (y[..., None] - rows) ** 2 + (x[..., None] - columns) ** 2
    least = squares.min(axis=2)
    inside = ~covered & (least <= padding**2)
    for name, item in found.maps.items():
        before = plain.maps[name].values
        np.testing.assert_array_equal(item.values[covered], before[covered])
        sources = before[rows, columns]
        for row, column in np.argwhere(inside):
            nearest = sources[squares[row, column] == least[row, column]]
            assert (nearest == item.values[row, column]).all(axis=1).any(), name
        outside = item.values[~covered & (least > padding**2)]
        if fill == "none" or MAPS[name].combine == "first":
            assert (outside == MAPS[name].neutral(options)).all()
        else:
            assert (outside != MAPS[name].neutral(options)).any(axis=1).mean() > 0.9


def test_positions_are_encoded_in_the_box_of_both_meshes(painted, baked):
    points = np.concatenate([mesh.positions for mesh in painted[:2]])
    for name, item in baked.maps.items():
        if MAPS[name].coding != "position":
            assert item.bounds is None
        else:
            np.testing.assert_array_equal(item.bounds, [points.min(axis=0), points.max(axis=0)])
