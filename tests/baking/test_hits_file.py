"""Hits in a file: the maps made from it are those of a bake, without the high-poly mesh."""

import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from tests import models
from texbake.baking.bake import bake, remap_hits
from texbake.baking.hits_file import read_hits, write_hits
from texbake.baking.maps import MAPS
from texbake.baking.options import BakeOptions
from texbake.errors import FileError, FileFormatError, OptionError
from texbake.mesh.materials import (
    CHANNELS,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
)
from texbake.mesh.shapes import icosphere, plane, uv_sphere
from texbake.texture.image import write_image

MAPS_OF_HITS = tuple(name for name, kind in MAPS.items() if kind.needs == "hits")
OPTIONS = BakeOptions(size=(80, 64), maps=MAPS_OF_HITS, samples=4, padding=3, front=0.02, back=0.01)


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A dented ball of two groups and materials, with colors and an image, and a low-poly ball."""
    ball = icosphere(4)
    points = ball.positions * (1.0 + 0.02 * np.sin(9.0 * ball.positions[:, :1]))
    angles = np.arctan2(points[:, 1], points[:, 0])
    groups = (points[ball.faces].mean(axis=1)[:, 2] > 0.0).astype(np.int32)
    high = ball.replace(
        positions=points,
        colors=(0.5 + 0.4 * points).astype(np.float32),
        uvs=np.stack([angles, points[:, 2]], axis=1),
        uv_faces=ball.faces,
        face_groups=groups,
        group_names=("south", "north"),
        name="dents.ply",
    )
    path = tmp_path_factory.mktemp("image") / "noise.png"
    write_image(np.random.default_rng(2).random((8, 8, 3), dtype=np.float32), path, color=True)
    image = ChannelImage(path.read_bytes(), "noise.png", wraps=("mirror", "clamp"))
    every = {name: ChannelSource(channel.default) for name, channel in CHANNELS.items()}
    every |= {
        "base-color": ChannelSource((1.0, 0.5, 1.0), image),
        "normal": ChannelSource((1.0, 1.0, 1.0), image),
        "roughness": ChannelSource((0.5,), replace(image, components=(1,), uv_set=1), 0.25),
    }
    materials = Materials(
        face_materials=1 - groups,
        materials=(MeshMaterial(name="rust", channels=every), MeshMaterial(name="moss")),
        uv_sets={1: 2.0 * high.uvs},
        has_vertex_colors=True,
    )
    return high, uv_sphere(12, 24), materials


@pytest.fixture(scope="module")
def kept(pair, tmp_path_factory):
    """The file of the hits of a bake, and that bake."""
    high, low, materials = pair
    result = bake(high, low, replace(OPTIONS, keep_hits=True), materials=materials)
    path = tmp_path_factory.mktemp("hits") / "a.npz"
    write_hits(result, path)
    return path, result


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"space": "object", "padding": 7},
        {"high_shading": "flat", "fill": "push-pull"},
        {"vertex_colors": "linear", "padding": 0},
    ],
    ids=str,
)
def test_maps_of_the_file_are_those_of_a_bake(pair, kept, tmp_path, changes):
    high, low, materials = pair
    options = replace(OPTIONS, **changes)
    expected = bake(high, low, options, materials=materials)
    found = remap_hits(read_hits(kept[0]), options)
    assert found.report.padding_meets == expected.report.padding_meets
    assert found.report.texels_missed == expected.report.texels_missed > 0
    for name in MAPS_OF_HITS:
        for suffix in "png", "exr":
            for result, folder in (expected, "bake"), (found, "remap"):
                (tmp_path / folder).mkdir(exist_ok=True)
                result.maps[name].write(tmp_path / folder / f"{name}.{suffix}")
            files = [tmp_path / folder / f"{name}.{suffix}" for folder in ("bake", "remap")]
            assert files[0].read_bytes() == files[1].read_bytes(), files


def test_options_of_the_rays_stay(kept):
    result = remap_hits(read_hits(kept[0]), BakeOptions(size=16, samples=16, maps=("normal",)))
    assert result.maps["normal"].values.shape == (64, 80, 3)
    assert result.report.options.samples == 4
    assert result.report.options.front == 0.02


def test_the_same_result_writes_the_same_bytes(kept, tmp_path):
    path, result = kept
    write_hits(result, tmp_path / "b.npz")
    assert (tmp_path / "b.npz").read_bytes() == path.read_bytes()


def test_files_of_two_equal_bakes_differ_only_in_times(pair, kept, tmp_path):
    high, low, materials = pair
    options = replace(OPTIONS, keep_hits=True, threads=1)
    write_hits(bake(high, low, options, materials=materials), tmp_path / "b.npz")
    with np.load(kept[0]) as one, np.load(tmp_path / "b.npz") as other:
        assert one.files == other.files
        for name in set(one.files) - {"header"}:
            assert one[name].tobytes() == other[name].tobytes(), name


def test_the_report_is_read_as_it_was_written(kept):
    path, result = kept
    assert read_hits(path).report == result.report


def test_a_sample_takes_forty_bytes(kept):
    with np.load(kept[0]) as archive:
        of_samples = [
            archive[name]
            for name in ("texel_ids", "low_faces", "low_barycentrics", "high_faces",
                         "high_barycentrics", "offsets")
        ]  # fmt: skip
    n = len(kept[1].hits)
    assert sum(array.nbytes for array in of_samples) == 40 * n


def test_only_the_faces_that_were_hit_are_kept(pair, tmp_path):
    high, low, _ = pair
    # One texel of one face of the low-poly ball.
    result = bake(high, low, BakeOptions(size=8, keep_hits=True, padding=0))
    write_hits(result, tmp_path / "few.npz")
    n_hit = len(np.unique(result.hits.high_faces[result.hits.high_faces >= 0]))
    assert read_hits(tmp_path / "few.npz").inputs.high.n_faces == n_hit < high.n_faces / 50


def test_a_bake_without_any_hit_is_kept_too(tmp_path):
    far = plane().replace(positions=plane().positions + np.array([0.0, 0.0, 9.0]))
    options = BakeOptions(size=8, front=0.1, back=0.1, keep_hits=True, maps=("normal", "opacity"))
    write_hits(bake(far, plane(), options), tmp_path / "none.npz")
    result = remap_hits(read_hits(tmp_path / "none.npz"), options)
    assert not result.has_data.any()
    assert not result.maps["opacity"].values.any()


def test_a_map_that_the_bake_could_not_make_is_an_error(tmp_path):
    write_hits(bake(plane(), plane(), BakeOptions(size=8, keep_hits=True)), tmp_path / "a.npz")
    kept = read_hits(tmp_path / "a.npz")
    with pytest.raises(ValueError, match="no vertex colors"):
        remap_hits(kept, BakeOptions(maps=("vertex-color",)))
    with pytest.raises(OptionError, match="ao"):
        remap_hits(kept, BakeOptions(maps=("ao",)))


def test_hits_must_have_been_kept(tmp_path):
    result = bake(plane(), plane(), BakeOptions(size=8))
    with pytest.raises(OptionError, match="keep_hits"):
        write_hits(result, tmp_path / "a.npz")
    with pytest.raises(OptionError, match="keep_hits"):
        remap_hits(result, BakeOptions())


# Files that are not files of hits


def test_a_missing_file(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_hits(tmp_path / "a.npz")


@pytest.mark.parametrize("content", [b"", b"PK", b"hello", bytes(1000)], ids=len)
def test_a_file_that_is_not_an_archive(tmp_path, content):
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(FileFormatError, match="not a file of hits"):
        read_hits(tmp_path / "a.npz")


def test_another_archive(tmp_path):
    np.savez(tmp_path / "a.npz", positions=np.zeros(3))
    with pytest.raises(FileFormatError, match="not a file of hits"):
        read_hits(tmp_path / "a.npz")


@pytest.mark.parametrize("at", [0.2, 0.5, 0.9])
def test_checksums_detect_flipped_bits(kept, tmp_path, at):
    data = bytearray(kept[0].read_bytes())
    data[int(at * len(data))] ^= 16
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(tmp_path / "a.npz")


def test_a_file_cut_short(kept, tmp_path):
    data = kept[0].read_bytes()
    (tmp_path / "a.npz").write_bytes(data[: len(data) // 2])
    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(tmp_path / "a.npz")


def altered(kept, tmp_path, change):
    """The file with its arrays changed."""
    with np.load(kept[0]) as archive:
        arrays = {name: archive[name] for name in archive.files}
    change(arrays)
    np.savez(tmp_path / "a.npz", **arrays)
    assert zipfile.is_zipfile(tmp_path / "a.npz")
    return tmp_path / "a.npz"


@pytest.mark.parametrize(
    ("name", "changed"),
    [("offsets", lambda a: a[:, 0]), ("offsets", lambda a: a.astype(float)),
     ("low_barycentrics", lambda a: a[:, :1]), ("high_barycentrics", lambda a: a.astype(int))],
)  # fmt: skip
def test_values_of_another_type_never_get_to_a_kernel(kept, tmp_path, name, changed):
    def change(arrays):
        arrays[name] = changed(arrays[name])

    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(altered(kept, tmp_path, change))


def test_an_entry_that_is_not_an_array_is_damage(kept, tmp_path):
    path = altered(kept, tmp_path, lambda arrays: arrays.pop("header"))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("header", b"{}")
    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(path)


@pytest.mark.parametrize(
    ("name", "value"),
    [("texel_ids", 80 * 64), ("texel_ids", -1), ("low_faces", 10**6), ("high_faces", 10**6),
     ("high_faces", -2), ("texel_faces", 10**6)],
)  # fmt: skip
def test_indices_out_of_range_never_get_to_a_kernel(kept, tmp_path, name, value):
    def change(arrays):
        arrays[name].reshape(-1)[3] = value

    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(altered(kept, tmp_path, change))


def test_arrays_of_other_lengths(kept, tmp_path):
    def change(arrays):
        arrays["offsets"] = arrays["offsets"][:-1]

    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(altered(kept, tmp_path, change))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("low_barycentrics", lambda array: array[:, :1]),
        ("high_barycentrics", lambda array: array.astype(np.float64)),
        ("offsets", lambda array: array[:, :1]),
        ("curvatures", lambda array: array[:3]),
        ("bounds", lambda array: array[:1]),
        ("face_materials", lambda array: array[:1]),
    ],
)
def test_arrays_of_other_shapes_or_types_never_get_to_a_kernel(kept, tmp_path, name, change):
    def changed(arrays):
        arrays[name] = change(arrays[name])

    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(altered(kept, tmp_path, changed))


def test_flipped_bits_of_the_table_of_contents_are_one_error(kept, tmp_path):
    data = kept[0].read_bytes()
    start = data.index(b"PK\x01\x02")
    # Required version, flags (encrypted, patched) and method of the first entry.
    for place, bit in ((6, 64), (8, 1), (8, 32), (8, 64), (10, 1)):
        flipped = bytearray(data)
        flipped[start + place] ^= bit
        (tmp_path / "a.npz").write_bytes(flipped)
        with pytest.raises(FileFormatError, match="damaged"):
            read_hits(tmp_path / "a.npz")


def test_another_version_is_named(kept, tmp_path):
    def change(arrays):
        header = json.loads(arrays["header"].tobytes())
        arrays["header"] = np.frombuffer(
            json.dumps({**header, "version": 99}).encode(), dtype=np.uint8
        )

    with pytest.raises(FileFormatError, match="version 99"):
        read_hits(altered(kept, tmp_path, change))


def test_a_pair_is_remapped_byte_for_byte(tmp_path):
    high, low = models.pair("figure")
    maps = ("normal", "displacement", "position", "curvature", "object-id", "opacity")
    options = BakeOptions(size=256, maps=maps, keep_hits=True)
    result = bake(high, low, options)
    write_hits(result, tmp_path / "a.npz")
    found = remap_hits(read_hits(tmp_path / "a.npz"), options)
    for name in maps:
        assert found.maps[name].values.tobytes() == result.maps[name].values.tobytes(), name


def _with_entries(kept, path, changed, method=zipfile.ZIP_STORED):
    """A copy of a file of hits with some entries replaced, added (bytes) or left out (None)."""
    with zipfile.ZipFile(kept[0]) as old, zipfile.ZipFile(path, "w", method) as new:
        entries = {name: old.read(name) for name in old.namelist()} | changed
        for name, content in entries.items():
            if content is not None:
                new.writestr(name, content)
    return path


def _npy(shape, dtype, data):
    header = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape!r}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data


@pytest.mark.parametrize("name", ["low_barycentrics", "offsets", "texel_faces", "low_mesh_faces"])
def test_an_array_that_is_missing(kept, tmp_path, name):
    path = _with_entries(kept, tmp_path / "part.npz", {f"{name}.npy": None})
    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(path)


@pytest.mark.parametrize("shape", [(1 << 40,), (1 << 62, 1 << 62), (-1,)])
def test_a_shape_beyond_the_file_takes_no_memory(kept, tmp_path, shape):
    changed = {"offsets.npy": _npy(shape, "<f4", b"\0" * 64)}
    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(_with_entries(kept, tmp_path / "huge.npz", changed))


def test_compressed_entries_are_not_unpacked(kept, tmp_path):
    bomb = {"unused.npy": _npy((1 << 26,), "|u1", b"\0" * (1 << 26))}
    path = _with_entries(kept, tmp_path / "bomb.npz", bomb, zipfile.ZIP_DEFLATED)
    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(path)
