"""Further sets of texture coordinates: in a mesh, through files and through what changes meshes."""

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from tests.glb import glb_bytes, read_glb
from texbake import OptionError, UnwrapOptions, read_mesh, unwrap, write_mesh
from texbake.errors import FileFormatError, MeshError, UvError
from texbake.mapping.overlap import find_overlaps
from texbake.mesh.compose import excerpt, join_meshes, transformed, turned_over
from texbake.mesh.mesh import MOST_UV_SETS, UvSet
from texbake.mesh.shapes import cube, uv_sphere
from texbake.verbs.meshes import transform_file
from texbake.verbs.unwrap import unwrap_files


@pytest.fixture
def mesh():
    """A sphere whose second set has a random place for each corner of each face."""
    sphere = uv_sphere(5, 8)
    rng = np.random.default_rng(3)
    uvs = rng.random((3 * sphere.n_faces, 2)).astype(np.float32).astype(np.float64)
    faces = rng.permutation(len(uvs)).reshape(-1, 3)
    return sphere.replace(
        uv_sets={"lightmap": UvSet(uvs, faces), "decals": UvSet(uvs, faces[::-1])}
    )


def corners_by_position(mesh, name):
    """Corners of all faces with their places, in an order that does not depend on the file's."""
    rows = np.concatenate([mesh.positions[mesh.faces], mesh.corner_uvs(name)], axis=2)
    return rows.astype(np.float32)


def test_sets_of_gltf_are_numbered_without_zeros_before(tmp_path, mesh):
    path = tmp_path / "a.glb"
    write_mesh(mesh, path)
    document, data = read_glb(path)
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_01"] = attributes.pop("TEXCOORD_1")
    path.write_bytes(glb_bytes(document, data))
    assert list(read_mesh(path).uv_sets) == ["decals"]


def test_arrays_are_checked_and_read_only(mesh):
    found = mesh.uv_set("lightmap")
    assert found.faces.dtype == np.int32 and not found.uvs.flags.writeable
    for wrong, message in (
        (UvSet(found.uvs[:3], found.faces), "out of range"),
        (UvSet(found.uvs, found.faces[:2]), r"faces of the UV set 'a' has the shape \(2, 3\)"),
        (UvSet(found.uvs * np.nan, found.faces), "not finite"),
        (UvSet(found.uvs, found.faces.astype(np.int64) + (1 << 32)), "out of range"),
        (UvSet(found.uvs, found.faces + 0.5), "must be integers"),
    ):
        with pytest.raises(MeshError, match=message):
            mesh.replace(uv_sets={"a": wrong})
    own = UvSet(found.uvs.copy(), found.faces.copy())
    mesh.replace(uv_sets={"a": own})
    own.uvs[0] = own.faces[0] = 0  # those of the caller stay as they were
    with pytest.raises(MeshError, match="not a name"):
        mesh.replace(uv_sets={"\n": found})
    with pytest.raises(UvError, match="it has lightmap, decals; make it with"):
        mesh.uv_set("other")


def test_new_faces_leave_further_sets_out(mesh):
    assert mesh.replace(faces=mesh.faces[:2], uv_faces=None, uvs=None).uv_sets == {}
    assert set(mesh.replace(name="a").uv_sets) == {"lightmap", "decals"}


def test_what_changes_a_mesh_carries_its_sets_along(mesh):
    chosen = np.arange(mesh.n_faces) % 3 == 0
    part = excerpt(mesh, chosen)
    np.testing.assert_array_equal(part.corner_uvs("decals"), mesh.corner_uvs("decals")[chosen])
    mirrored = transformed(mesh, np.diag([-1.0, 1.0, 1.0, 1.0]))
    np.testing.assert_array_equal(
        mirrored.corner_uvs("lightmap"), mesh.corner_uvs("lightmap")[:, ::-1]
    )
    over = turned_over(mesh, chosen)
    np.testing.assert_array_equal(
        over.corner_uvs("lightmap")[chosen], mesh.corner_uvs("lightmap")[chosen][:, ::-1]
    )
    both = join_meshes([cube(), mesh])
    np.testing.assert_array_equal(both.corner_uvs("lightmap")[12:], mesh.corner_uvs("lightmap"))
    assert (both.corner_uvs("lightmap")[:12] == 0.0).all()


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_files_keep_all_sets(mesh, tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_mesh(mesh, path)
    read = read_mesh(path)
    assert list(read.uv_sets) == ["lightmap", "decals"]
    for name in (None, "lightmap", "decals"):
        np.testing.assert_allclose(
            corners_by_position(read, name), corners_by_position(mesh, name), atol=1e-7
        )


def test_a_compressed_glb_keeps_them(mesh, tmp_path):
    write_mesh(mesh, tmp_path / "a.glb", quantize=True)
    read = read_mesh(tmp_path / "a.glb")
    np.testing.assert_allclose(read.corner_uvs("decals"), mesh.corner_uvs("decals"), atol=1e-7)


def test_the_file_beside_an_obj(mesh, tmp_path):
    path, beside = tmp_path / "a.obj", tmp_path / "a.uvs.npz"
    write_mesh(mesh, path)
    first = beside.read_bytes()
    write_mesh(mesh, path)
    assert beside.read_bytes() == first
    # Another program has changed the faces.
    path.write_text(path.read_text() + "f 1 2 3\n")
    with pytest.raises(FileFormatError, match=r"a\.uvs\.npz: it belongs to other faces"):
        read_mesh(path)
    np.savez(beside, names=np.array([{}], dtype=object))
    with pytest.raises(FileFormatError, match="not a file of UV sets"):
        read_mesh(path)
    np.savez_compressed(beside, names=np.array(["a"]))
    with pytest.raises(FileFormatError, match="compressed"):
        read_mesh(path)
    # A mesh without sets takes the file away.
    write_mesh(mesh.replace(uv_sets={}), path)
    assert not beside.exists() and read_mesh(path).uv_sets == {}


def test_unwrap_adds_a_set_and_leaves_the_first(tmp_path):
    sphere = uv_sphere(8, 16)
    made = unwrap(sphere, uv_set="lightmap", size=256)
    np.testing.assert_array_equal(made.uvs, sphere.uvs)
    np.testing.assert_array_equal(made.uv_faces, sphere.uv_faces)
    alone = unwrap(sphere, size=256)
    np.testing.assert_array_equal(made.corner_uvs("lightmap"), alone.corner_uvs())
    assert not find_overlaps(made.corner_uvs("lightmap")).overlapping.any()
    with pytest.raises(UvError, match="no texture coordinates yet"):
        unwrap(sphere.replace(uvs=None, uv_faces=None), uv_set="lightmap")

    write_mesh(sphere, tmp_path / "in.obj")
    run = CliRunner().invoke(
        texbake,
        [
            "unwrap", str(tmp_path / "in.obj"), "--uv-set", "lightmap", "-o",
            str(tmp_path / "out.obj"),
        ],
    )  # fmt: skip
    assert run.exit_code == 0, run.output
    read = read_mesh(tmp_path / "out.obj")
    np.testing.assert_array_equal(read.corner_uvs(), sphere.corner_uvs())
    assert not find_overlaps(read.corner_uvs("lightmap")).overlapping.any()
    assert (tmp_path / "out.uvs.npz").is_file()
    with pytest.raises(OptionError, match=r"\.ply files have one set"):
        unwrap_files(tmp_path / "in.obj", tmp_path / "a.ply", UnwrapOptions(uv_set="a"))


def test_convert_keeps_sets_or_says_so(mesh, tmp_path):
    write_mesh(mesh, tmp_path / "a.obj")
    done = transform_file(tmp_path / "a.obj", tmp_path / "b.glb")
    assert list(read_mesh(tmp_path / "b.glb").uv_sets) == ["lightmap", "decals"]
    assert done.warnings == ()
    done = transform_file(tmp_path / "b.glb", tmp_path / "c.obj")
    assert tmp_path / "c.uvs.npz" in done.files
    done = transform_file(tmp_path / "b.glb", tmp_path / "d.ply")
    assert "further texture coordinates" in done.warnings[0]


def test_an_obj_file_that_is_not_written_keeps_its_further_sets(mesh, tmp_path, monkeypatch):
    path = tmp_path / "ball.obj"
    write_mesh(mesh, path)
    older = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert set(older) == {"ball.obj", "ball.uvs.npz"}
    plain = mesh.replace(uv_sets={})

    def stop(path):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("texbake.files._write_to_disk", stop)
        for newer in plain, transformed(mesh, np.diag([2.0, 2.0, 2.0, 1.0])):
            with pytest.raises(KeyboardInterrupt):
                write_mesh(newer, path)
            assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == older
    write_mesh(plain, path)
    assert [file.name for file in tmp_path.iterdir()] == ["ball.obj"]


def test_a_mesh_has_a_limited_number_of_sets(mesh):
    found = mesh.uv_set("lightmap")
    most = {f"set {i}": found for i in range(MOST_UV_SETS)}
    assert len(mesh.replace(uv_sets=most).uv_sets) == MOST_UV_SETS
    with pytest.raises(MeshError, match="it has 65 sets of texture coordinates besides the first"):
        mesh.replace(uv_sets={**most, "one more": found})


def one_array_as_many_sets(path, n_primitives, n_sets):
    """Write a GLB file whose primitives name one accessor as sets of names of their own."""
    write_mesh(uv_sphere(3, 4), path)
    document, data = read_glb(path)
    (mesh,) = document["meshes"]
    uvs = mesh["primitives"][0]["attributes"]["TEXCOORD_0"]
    mesh["primitives"][0]["attributes"] |= {f"TEXCOORD_{i + 1}": uvs for i in range(n_sets)}
    names = [{f"TEXCOORD_{i + 1}": f"{k} {i}" for i in range(n_sets)} for k in range(n_primitives)]
    document["meshes"] = [{**mesh, "extras": extras} for extras in names]
    document["nodes"] = [{"mesh": k} for k in range(n_primitives)]
    document["scenes"] = [{"nodes": list(range(n_primitives))}]
    path.write_bytes(glb_bytes(document, data))


@pytest.mark.parametrize(("n_primitives", "n_sets"), [(1, 65), (13, 5)])
def test_a_file_that_names_one_array_as_many_sets_is_refused(tmp_path, n_primitives, n_sets):
    path = tmp_path / "many.glb"
    one_array_as_many_sets(path, n_primitives, n_sets - 1)
    assert len(read_mesh(path).uv_sets) == n_primitives * (n_sets - 1)
    one_array_as_many_sets(path, n_primitives, n_sets)
    with pytest.raises(MeshError, match=r"many\.glb: it has 65 sets .* at most 64 are read"):
        read_mesh(path)
