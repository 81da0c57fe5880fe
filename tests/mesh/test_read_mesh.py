import os
import subprocess
import sys

import numpy as np
import pytest

from tests.models import model
from texbake.errors import FileError, FileFormatError, MeshError, OptionError
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.mesh import Mesh

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".fbx")
OWN_SUFFIXES = SUFFIXES[:4]
every_suffix = pytest.mark.parametrize("suffix", SUFFIXES)


@pytest.fixture
def square():
    return Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]],
        faces=[[0, 1, 2], [0, 2, 3]],
        uvs=[[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]],
        uv_faces=[[0, 1, 2], [4, 2, 3]],
        normals=[[0, 0, 1], [0, 1, 0]],
        normal_faces=[[0, 0, 0], [1, 1, 1]],
    )


def error_of(path):
    with pytest.raises(FileError) as caught:
        read_mesh(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return caught.value


@every_suffix
def test_missing_file(tmp_path, suffix):
    error = error_of(tmp_path / f"none{suffix}")
    assert not isinstance(error, FileFormatError)
    assert "no such file" in str(error)


@every_suffix
def test_folder(tmp_path, suffix):
    (tmp_path / f"folder{suffix}").mkdir()
    assert "it is a folder" in str(error_of(tmp_path / f"folder{suffix}"))
    assert "it is a folder" in str(error_of(tmp_path))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_pipe_does_not_hang(tmp_path):
    os.mkfifo(tmp_path / "mesh.obj")
    assert "not a regular file" in str(error_of(tmp_path / "mesh.obj"))


def test_unknown_suffix_names_the_known_ones(tmp_path, square):
    (tmp_path / "mesh.blend").write_text("x")
    message = str(error_of(tmp_path / "mesh.blend"))
    assert all(suffix in message for suffix in SUFFIXES)
    with pytest.raises(FileFormatError, match=r"\.obj, \.ply"):
        write_mesh(square, tmp_path / "mesh")
    with pytest.raises(FileFormatError, match=r"write a \.glb file"):
        write_mesh(square, tmp_path / "mesh.gltf")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root reads all")
def test_file_that_may_not_be_read(tmp_path):
    (tmp_path / "mesh.obj").write_text("v 0 0 0")
    (tmp_path / "mesh.obj").chmod(0)
    assert "cannot be read" in str(error_of(tmp_path / "mesh.obj"))


@pytest.mark.parametrize("suffix", [".obj", ".PLY", ".Off"])
def test_suffix_in_any_case_and_name(tmp_path, square, suffix):
    path = tmp_path / f"my mesh{suffix}"
    write_mesh(square, path)
    mesh = read_mesh(path)
    assert mesh.name == f"my mesh{suffix}"
    assert mesh.positions.tobytes() == square.positions.tobytes()
    assert mesh.faces.tobytes() == square.faces.tobytes()


def test_errors_of_the_mesh_name_the_path(tmp_path):
    path = tmp_path / "mesh.off"
    path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n")
    with pytest.raises(MeshError) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("suffix", OWN_SUFFIXES)
def test_options_of_other_formats(tmp_path, square, suffix):
    path = tmp_path / f"mesh{suffix}"
    with pytest.raises(OptionError, match="normal_map"):
        write_mesh(square, path, normal_map=np.zeros((4, 4, 3)))
    assert not path.exists()
    write_mesh(square, path, normal_map=None)
    assert path.exists()


@pytest.mark.parametrize("suffix", OWN_SUFFIXES)
def test_write_replaces_whole_or_not_at_all(tmp_path, square, suffix):
    path = tmp_path / f"mesh{suffix}"
    path.write_text("precious")
    write_mesh(square, path)
    assert path.read_bytes() != b"precious"
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    with pytest.raises(FileError, match="there is no folder"):
        write_mesh(square, tmp_path / "none" / f"mesh{suffix}")


def test_progress_is_one_stage(tmp_path, square):
    events = []

    class Sink:
        def started(self, stage, total, unit):
            events.append(("started", stage))

        def advanced(self, stage, done):
            events.append(("advanced", stage))

        def finished(self, stage, seconds):
            events.append(("finished", stage))

    write_mesh(square, tmp_path / "mesh.ply")
    read_mesh(tmp_path / "mesh.ply", progress=Sink())
    assert events == [("started", "read mesh.ply"), ("finished", "read mesh.ply")]


def test_memory_is_bounded_by_the_file(tmp_path):
    # In a process of its own: a header that claims 10^10 rows must not be believed.
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 10000000000\nproperty float x\n"
    header += "property float y\nproperty float z\nelement face 1\n"
    header += "property list uchar int vertex_indices\nend_header\n"
    (tmp_path / "mesh.ply").write_bytes(header.encode() + bytes(200))
    script = (
        "import sys, resource\n"
        "from texbake.errors import FileFormatError\n"
        "from texbake.mesh.files import read_mesh\n"
        "import texbake.mesh.files.ply\n"
        "used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "try:\n"
        "    read_mesh(sys.argv[1])\n"
        "except FileFormatError:\n"
        "    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used)\n"
    )
    if sys.platform != "linux":
        pytest.skip("resident memory is reported in other units elsewhere")
    done = subprocess.run(
        [sys.executable, "-P", "-c", script, tmp_path / "mesh.ply"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout) < 10_000  # KB


# Faces of the real meshes as their index counts them.
FACES = {
    "pairs/koala/high.obj": 99_994,
    "pairs/koala/low.obj": 7_116,
    "pairs/koala/low_uv.obj": 7_116,
    "pairs/skull/high.obj": 100_002,
    "pairs/skull/low.obj": 10_312,
    "pairs/skull/low_uv.obj": 10_312,
    "pairs/spot/high.obj": 23_062,
    "pairs/spot/low.obj": 1_654,
    "pairs/spot/low_uv.obj": 1_654,
    "pairs/penguin/high.obj": 26_880,
    "pairs/penguin/low.obj": 6_720,
    "pairs/penguin/low_uv.obj": 6_720,
    "pairs/LeePerrySmith/LeePerrySmith.obj": 17_684,
    "meshes/mri_skin.ply": 1_136_410,
    "meshes/hubmap_vh_male_merged.ply": 1_533_743,
    "meshes/nefertiti-lowres.obj": 70_000,
    "meshes/hammer.obj": 60_160,
    "meshes/mountain.obj": 50_562,
    "meshes/boot.obj": 39_906,
    "meshes/makehuman_base.obj": 36_972,
    "meshes/boat.obj": 32_416,
    "meshes/fish.obj": 21_568,
    "meshes/Generic_Twin_7081.1.t0_left.obj": 19_704,
    "meshes/capsule.obj": 10_200,
}


@pytest.mark.realdata
def test_real_meshes_have_the_faces_of_the_index(data_dir):
    assert {name: read_mesh(data_dir / name).n_faces for name in FACES} == FACES


def canonical_triangles(corners):
    """Triangles sorted, each beginning with its least corner: the same for any order of faces."""
    rotations = np.stack([np.roll(corners, -k, axis=1).reshape(-1, 9) for k in range(3)], axis=1)
    least = np.array([min(map(tuple, rotation)) for rotation in rotations.tolist()])
    return least[np.lexsort(least.T[::-1])]


def assert_same_triangles(path):
    import trimesh

    mesh = read_mesh(path)
    other = trimesh.load(path, process=False, force="mesh")
    np.testing.assert_array_equal(
        canonical_triangles(mesh.positions[mesh.faces]),
        canonical_triangles(np.asarray(other.vertices)[other.faces]),
    )


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb"])
@pytest.mark.parametrize("name", ["bracket", "fused cells", "scan"])
def test_a_file_of_trimesh_has_the_triangles_that_trimesh_reads(tmp_path, name, suffix):
    import trimesh

    mesh = model(name)
    made = trimesh.Trimesh(mesh.positions, mesh.faces, process=False)
    made.export(tmp_path / f"a.{suffix}")
    assert_same_triangles(tmp_path / f"a.{suffix}")


@pytest.mark.realdata
def test_real_files_have_the_triangles_that_trimesh_reads(data_dir):
    # Without that of quadrilaterals, which have two ways to be cut.
    few = (name for name, count in FACES.items() if count < 20_000 and "Perry" not in name)
    others = ("busted.STL", "featuretype.STL")
    for name in (*few, "meshes/sword.obj", *(f"meshes/{name}" for name in others)):
        assert_same_triangles(data_dir / name)


def test_import_of_the_package_loads_no_other_reader():
    script = "import sys, texbake.mesh.files; assert not {'trimesh', 'scipy'} & set(sys.modules)"
    subprocess.run([sys.executable, "-P", "-c", script], check=True)
