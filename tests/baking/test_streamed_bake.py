"""A bake of a high-poly mesh that stays in its file: byte for byte that of the whole mesh."""

import numpy as np
import pytest

from texbake import BakeOptions, Mesh, OptionError, bake, read_mesh, write_mesh
from texbake.baking.maps import MAPS, MATERIAL_MAPS
from texbake.baking.memory import STREAMED_CHUNKS, STREAMED_FACE, bake_memory
from texbake.errors import MeshError
from texbake.jobs.maps import BakeFiles, bake_files
from texbake.mesh.frame import LocalFrame
from texbake.mesh.shapes import uv_sphere
from texbake.mesh.streamed import source
from texbake.mesh.streamed.mesh import StreamedMesh, open_streamed
from texbake.raycast.scene import RayScene

WHOLE = {name for name, kind in MAPS.items() if kind.of_neighbors or kind.needs != "hits"}
NAMES = tuple(name for name in MAPS if name not in WHOLE and name not in MATERIAL_MAPS)
OPTIONS = BakeOptions(maps=NAMES, size=(48, 40), samples=4, padding=2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A dented sphere twice, the second time turned round, in three files; and a low-poly one."""
    folder = tmp_path_factory.mktemp("streamed")
    ball = uv_sphere(40, 60, lambda a, b: 1 + 0.03 * np.sin(11 * a) * np.sin(9 * b))
    faces = np.vstack([ball.faces, ball.faces[1000:2000, ::-1], ball.faces[500:1500]])
    faces = np.vstack([faces[::2], faces[1::2]])  # neighbors in different chunks
    colors = np.float32(0.5 + 0.4 * ball.positions)
    mesh = Mesh(positions=ball.positions, faces=faces, colors=colors)
    write_mesh(mesh, folder / "high.ply")
    write_mesh(mesh, folder / "high.stl")
    normals = ball.positions.copy()
    normals[::7] = 0.0
    write_mesh(mesh.replace(normals=normals, normal_faces=faces), folder / "normals.ply")
    write_mesh(uv_sphere(7, 9), folder / "low.obj")
    return folder


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch):
    monkeypatch.setattr(source, "ROWS_PER_BLOCK", 700)


def assert_same_bake(folder, name, options, n_chunks, monkeypatch):
    low = read_mesh(folder / "low.obj")
    whole = bake(folder / name, low, BakeOptions(**{**vars(options), "threads": None}))
    high = open_streamed(folder / name, threads=options.threads)
    monkeypatch.setattr(
        BakeOptions, "streamed_chunk_faces", lambda *_: -(-high.n_faces // n_chunks)
    )
    scene = RayScene.build(high, LocalFrame.around(high), chunk_faces=-(-high.n_faces // n_chunks))
    assert len(list(scene.trees())) == n_chunks
    streamed = bake(high, low, options)
    for kind in options.maps:
        assert streamed.maps[kind].values.tobytes() == whole.maps[kind].values.tobytes(), kind
    assert streamed.report.counts == whole.report.counts
    assert (streamed.report.front, streamed.report.back) == (whole.report.front, whole.report.back)
    assert streamed.report.distance_percentiles == whole.report.distance_percentiles


@pytest.mark.parametrize(("name", "n_chunks", "changes"), [
    ("high.ply", 2, {"threads": 7}),
    ("high.ply", 7, {"threads": 1}),
    ("high.stl", 3, {"maps": ("normal", "displacement")}),
    ("normals.ply", 3, {"maps": ("normal",)}),
    ("high.ply", 3, {"maps": ("normal",), "high_shading": "flat"}),
    ("high.ply", 3, {"maps": ("normal", "opacity"), "front": 0.001, "back": 0.001}),
    ("high.ply", 3, {"maps": ("displacement",), "cull_back_faces": False}),
])  # fmt: skip
def test_any_chunks_threads_files_and_options(folder, name, n_chunks, changes, monkeypatch):
    options = BakeOptions(**{**vars(OPTIONS), **changes})
    assert_same_bake(folder, name, options, n_chunks, monkeypatch)


def test_hits_are_made_into_maps_in_pieces(folder, monkeypatch):
    monkeypatch.setattr("texbake.baking.texel_values._HITS_OF_STREAM", 1001)
    monkeypatch.setattr("texbake.baking.trace._SAMPLES_IN_CHUNKS", 1 << 12)
    assert_same_bake(folder, "high.ply", OPTIONS, 2, monkeypatch)


def test_a_limit_of_memory_decides(folder, tmp_path):
    opened: list[str] = []
    original = StreamedMesh.open.__func__

    def spy(cls, source, **given):
        opened.append(source.path.name)
        return original(cls, source, **given)

    contents = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(StreamedMesh, "open", classmethod(spy))
        for limit, expected in ((None, 0), ("4G", 0), ("1M", 1)):
            options = BakeOptions(**{**vars(OPTIONS), "max_memory": limit})
            out = tmp_path / str(limit)
            done = bake_files(folder / "high.ply", folder / "low.obj", out, options)
            assert len(opened) == expected
            assert done.report.n_high_faces == read_mesh(folder / "high.ply").n_faces
            contents.append({p.name: p.read_bytes() for p in sorted(out.iterdir())})
    assert len(contents[0]) == len(NAMES)
    assert contents[0] == contents[1] == contents[2]


def test_sizes_of_chunks():
    options = BakeOptions(size=1024, max_memory="1.5G")
    assert not BakeOptions().must_stream(10**9, 10)
    assert not options.must_stream(4_000_000, 10) and options.must_stream(100_000_000, 10)
    least, most = STREAMED_CHUNKS
    assert BakeOptions().streamed_chunk_faces(10) == most
    assert BakeOptions(max_memory=1).streamed_chunk_faces(10) == least
    without = bake_memory(0, 10, 1024**2, ("normal",))
    limit = without + 1_000_000 * STREAMED_FACE
    assert BakeOptions(size=1024, max_memory=limit).streamed_chunk_faces(10) == 1_000_000


@pytest.mark.parametrize(("changes", "message"), [
    ({"maps": ("normal", "ao")}, "ao need all of it at once"),
    ({"maps": ("curvature", "convexity")}, "curvature, convexity need all of it at once"),
    ({"samples": "adaptive"}, "use 1, 4, 16 or 64 `samples`"),
    ({"samples": 1, "time_budget": "3s"}, "use 1, 4, 16 or 64 `samples`"),
    ({"keep_hits": True}, "its hits cannot be kept"),
])  # fmt: skip
def test_what_needs_the_whole_mesh(folder, tmp_path, changes, message):
    options = BakeOptions(**{**vars(OPTIONS), "max_memory": "1M", **changes})
    with pytest.raises(OptionError, match=rf"^max_memory: high.ply .*{message}") as error:
        bake_files(folder / "high.ply", folder / "low.obj", tmp_path / "maps", options)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["html", "high_texture"])
def test_files_that_need_the_whole_mesh(folder, tmp_path, name):
    maps = ("normal",) if name == "html" else ("base-color",)
    options = BakeOptions(maps=maps, size=16, max_memory="1M")
    file = tmp_path / f"file.{name}" if name == "html" else folder / "low.obj"
    files = BakeFiles(**{name: file})
    with pytest.raises(OptionError, match=f"max_memory, {name}: high.ply"):
        bake_files(folder / "high.ply", folder / "low.obj", tmp_path / "maps", options, files)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_damaged_late(folder, tmp_path):
    content = bytearray((folder / "high.ply").read_bytes())
    content[-4:] = b"\xff\xff\xff\x7f"
    (tmp_path / "high.ply").write_bytes(content)
    options = BakeOptions(size=16, max_memory="1M")
    with pytest.raises(MeshError, match=r"high\.ply: a position index is out of range \(face"):
        bake_files(tmp_path / "high.ply", folder / "low.obj", tmp_path / "maps", options)
    assert not (tmp_path / "maps").exists()
