"""Hits in a file: the maps made from it are those of a bake, without the high-poly mesh."""

import io
import json
import zipfile
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from texbake.baking.bake import bake, remap_hits
from texbake.baking.hits_file import read_hits, write_hits
from texbake.baking.maps import MAPS
from texbake.baking.options import BakeOptions
from texbake.errors import FileError, FileFormatError, OptionError
from texbake.mesh.shapes import plane

MAPS_OF_HITS = tuple(name for name, kind in MAPS.items() if kind.needs == "hits")
OPTIONS = BakeOptions(size=(80, 64), maps=MAPS_OF_HITS, samples=4, padding=3, front=0.02, back=0.01)


@pytest.fixture(scope="module")
def kept(painted, tmp_path_factory):
    """The file of the hits of a bake, and that bake."""
    high, low, materials = painted
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
def test_maps_of_the_file_are_those_of_a_bake(painted, kept, tmp_path, changes):
    high, low, materials = painted
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


def test_the_same_result_writes_the_same_bytes_and_is_read_with_its_report(kept, tmp_path):
    path, result = kept
    write_hits(result, tmp_path / "b.npz")
    assert (tmp_path / "b.npz").read_bytes() == path.read_bytes()
    assert read_hits(path).report == result.report


def test_only_the_faces_that_were_hit_are_kept(painted, tmp_path):
    high, low, _ = painted
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
    assert not result.has_data.any() and not result.maps["opacity"].values.any()


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


def test_a_missing_file(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_hits(tmp_path / "a.npz")


def altered(kept, tmp_path, **changed):
    """The file with some arrays changed by functions, or left out for None."""
    with np.load(kept[0]) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, change in changed.items():
        array = arrays.pop(name)
        if change is not None:
            arrays[name] = change(array)
    np.savez(tmp_path / "a.npz", **arrays)
    return tmp_path / "a.npz"


def with_value(value):
    """A change of the fourth number of an array."""

    def change(array):
        array = array.copy()
        array.reshape(-1)[3] = value
        return array

    return change


DAMAGE = {
    "texel_ids": [with_value(80 * 64), with_value(-1), lambda a: a.astype(np.int64)],
    "low_faces": [with_value(10**6), with_value(-1), lambda a: a[:-1]],
    "low_barycentrics": [None, lambda a: a[:, :1], lambda a: a.astype(int)],
    "high_faces": [with_value(10**6), with_value(-2), lambda a: a[:, None]],
    "high_barycentrics": [lambda a: a.astype(np.float64), lambda a: a.T],
    "offsets": [None, lambda a: a[:, 0], lambda a: a[:-1], lambda a: a.astype(float)],
    "texel_faces": [None, with_value(10**6), with_value(-2), lambda a: a.T],
    "curvatures": [None, lambda a: a[:3], lambda a: a[:, 0]],
    "tangents": [lambda a: a[..., :3]],
    "bounds": [None, lambda a: a[:1], lambda a: a.astype(np.float32)],
    "face_materials": [None, lambda a: a[:1]],
    "uv_set_1": [None, lambda a: a[:-1], with_value(np.nan)],
    "low_mesh_faces": [None, with_value(10**6)],
    "header": [None, lambda a: a[:-1]],
}


@pytest.mark.parametrize(
    ("name", "number"), [(name, i) for name, changes in DAMAGE.items() for i in range(len(changes))]
)
def test_no_array_that_is_damaged_gets_to_a_kernel(kept, tmp_path, name, number):
    with pytest.raises(FileFormatError, match="damaged"):
        read_hits(altered(kept, tmp_path, **{name: DAMAGE[name][number]}))


def flipped(data, place, bit):
    changed = bytearray(data)
    changed[place] ^= bit
    return bytes(changed)


def rezipped(data, method=zipfile.ZIP_STORED, **changed):
    """A copy of an archive with some entries replaced or added."""
    content = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(content, "w", method) as new:
        for name, entry in ({name: old.read(name) for name in old.namelist()} | changed).items():
            new.writestr(name, entry)
    return content.getvalue()


def npy(shape, dtype, data):
    header = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape!r}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data


@pytest.mark.parametrize("change", [
    lambda data: b"",
    lambda data: b"PK",
    lambda data: b"hello",
    lambda data: bytes(1000),
    lambda data: data[: len(data) // 2],
    *(partial(lambda at, data: flipped(data, int(at * len(data)), 16), at)
      for at in (0.2, 0.5, 0.9)),
    # Shapes beyond the file, a compressed entry, and one that is no array.
    *(partial(lambda shape, data: rezipped(
        data, **{"offsets.npy": npy(shape, "<f4", b"\0" * 64)}), shape)
      for shape in ((1 << 40,), (1 << 62, 1 << 62), (-1,))),
    lambda data: rezipped(
        data, zipfile.ZIP_DEFLATED,
        **{"unused.npy": npy((1 << 26,), "|u1", b"\0" * (1 << 26))}),
    lambda data: rezipped(data, header=b"{}", **{"header.npy": b""}),
])  # fmt: skip
def test_a_file_that_is_damaged_is_one_error(kept, tmp_path, change):
    (tmp_path / "a.npz").write_bytes(change(kept[0].read_bytes()))
    with pytest.raises(FileFormatError, match="not a file of hits, or it is damaged"):
        read_hits(tmp_path / "a.npz")


def test_another_version_is_named(kept, tmp_path):
    def change(header):
        content = {**json.loads(header.tobytes()), "version": 99}
        return np.frombuffer(json.dumps(content).encode(), dtype=np.uint8)

    with pytest.raises(FileFormatError, match="version 99"):
        read_hits(altered(kept, tmp_path, header=change))
