"""Formats that are read through trimesh, and Draco and strips, which our own readers know."""

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

import texbake
from texbake.errors import DependencyError, FileFormatError, MeshError, ReadWarning, TexbakeError
from texbake.mesh.files import MESH_SUFFIXES, WRITABLE_MESH_SUFFIXES
from texbake.mesh.files.trimesh_read import mesh_of_trimesh
from texbake.mesh.shapes import cube, uv_sphere

ONLY_READ = sorted({*MESH_SUFFIXES} - {*WRITABLE_MESH_SUFFIXES, ".gltf"})


def test_a_3mf_file_keeps_positions_and_faces(tmp_path):
    mesh = uv_sphere(6, 8).replace(uvs=None, uv_faces=None)
    texbake.to_trimesh(mesh).export(tmp_path / "sphere.3mf")
    read = texbake.read_mesh(tmp_path / "sphere.3mf")
    # The file has as many digits as trimesh writes.
    assert np.allclose(read.positions[read.faces], mesh.positions[mesh.faces], atol=1e-7)
    assert (read.name, len(read.group_names)) == ("sphere.3mf", 1)


def test_a_collada_file_keeps_coordinates_and_has_each_vertex_once(tmp_path):
    mesh = uv_sphere(6, 8)
    texbake.to_trimesh(mesh).export(tmp_path / "sphere.dae")
    read = texbake.read_mesh(tmp_path / "sphere.dae")
    assert read.n_vertices == mesh.n_vertices
    assert np.allclose(read.positions[read.faces], mesh.positions[mesh.faces], atol=1e-6)
    assert np.allclose(read.corner_uvs(), mesh.corner_uvs(), atol=1e-6)
    with zipfile.ZipFile(tmp_path / "sphere.zae", "w") as archive:
        archive.write(tmp_path / "sphere.dae", "sphere.dae")
    assert texbake.read_mesh(tmp_path / "sphere.zae").n_faces == mesh.n_faces


def test_collada_numbers_that_are_not_finite_are_read_as_in_other_formats(tmp_path):
    path = tmp_path / "a.dae"
    texbake.to_trimesh(uv_sphere(6, 8)).export(path)
    text = path.read_text()

    def read_with(source):
        """Read the file after replacing the first number of a source by one that is not finite."""
        changed = re.sub(rf'(<float_array[^>]*id="{source}[^>]*>)\S+', r"\1-nan", text)
        assert changed != text
        path.write_text(changed)
        return texbake.read_mesh(path)

    with pytest.warns(ReadWarning, match="1 of .* normals are not finite"):
        assert np.isfinite(read_with("normals").normals).all()
    with pytest.warns(ReadWarning, match=r"1 of .* texture coordinates are not finite; \(0, 0\)"):
        assert np.isfinite(read_with("texcoords").uvs).all()
    with pytest.raises(MeshError, match="a position of a face is not finite"):
        read_with("verts")
    path.write_text(re.sub('(<float_array[^>]*id="verts[^>]*>[^<]*)', r"\1 inf 0 0", text))
    with pytest.warns(ReadWarning, match="1 of 62 vertices are not finite; no face uses them"):
        assert texbake.read_mesh(path).n_faces == uv_sphere(6, 8).n_faces


def test_a_xaml_file_is_read(tmp_path):
    (tmp_path / "a.xaml").write_text(
        '<Viewport3D xmlns="http://schemas.microsoft.com/winfx/2006/xaml/presentation">'
        '<GeometryModel3D><GeometryModel3D.Geometry><MeshGeometry3D Positions="0,0,0 1,0,0 0,1,0" '
        'Normals="0,0,1 0,0,1 0,0,1" TriangleIndices="0,1,2"/></GeometryModel3D.Geometry>'
        "<GeometryModel3D.Material><DiffuseMaterial><DiffuseMaterial.Brush>"
        '<SolidColorBrush Color="#FF0000" Opacity="1"/></DiffuseMaterial.Brush></DiffuseMaterial>'
        "</GeometryModel3D.Material></GeometryModel3D></Viewport3D>",
        encoding="utf-8",
    )
    assert texbake.read_mesh(tmp_path / "a.xaml").n_faces == 1


def test_a_3mf_file_with_a_bad_number_is_one_error(tmp_path):
    texbake.to_trimesh(cube()).export(tmp_path / "good.3mf")
    wrong = [('v1="0"', 'v1="77"', "index"), ('x="-0.5', 'x="abc', "could not be read to its end"),
             ('x="-0.5', 'x="nan', "not finite")]  # fmt: skip
    for old, new, error in wrong:
        changed = tmp_path / "bad.3mf"
        with zipfile.ZipFile(tmp_path / "good.3mf") as good, zipfile.ZipFile(changed, "w") as bad:
            for name in good.namelist():
                text = good.read(name)
                bad.writestr(name, text.replace(old.encode(), new.encode(), 1))
        with pytest.raises(TexbakeError, match=rf"bad\.3mf: .*{error}"):
            texbake.read_mesh(changed)


def test_a_file_is_not_written_in_a_format_that_is_only_read(tmp_path):
    for suffix in ONLY_READ:
        with pytest.raises(FileFormatError, match="can only be read"):
            texbake.write_mesh(cube(), tmp_path / f"cube{suffix}")


def draco_file(mesh, path):
    content = trimesh.Scene(texbake.to_trimesh(mesh)).export(file_type="glb", extension_draco=True)
    assert b"KHR_draco_mesh_compression" in content
    path.write_bytes(content)
    return content


def test_a_file_compressed_by_draco_is_read(tmp_path):
    mesh = uv_sphere(12, 16)
    path = tmp_path / "sphere.glb"
    draco_file(mesh, path)
    read = texbake.read_mesh(path)
    assert read.n_faces == mesh.n_faces
    np.testing.assert_allclose(np.ptp(read.uvs, axis=0), np.ptp(mesh.uvs, axis=0), atol=1e-3)
    # 14 bits of a length of 2, half a step up or down along each axis.
    assert texbake.surface_distance(read, mesh).max <= 3**0.5 * 2 / 2**14


# Hides every package that no default dependency needs, then reads a file of each format.
WITHOUT_EXTRAS = """
import re, sys, tomllib
from importlib.metadata import PackageNotFoundError, packages_distributions, requires

project = tomllib.load(open(sys.argv.pop(1), "rb"))["project"]
needed, waiting = {"texbake"}, project["dependencies"]
while waiting:
    name = re.match(r"[\\w.-]+", waiting.pop())[0].lower().replace("_", "-")
    if name not in needed:
        needed.add(name)
        try:
            lines = requires(name) or []
        except PackageNotFoundError:  # for another system
            continue
        waiting += [line for line in lines if "extra ==" not in line]

class Hidden:
    def find_spec(self, module, path=None, target=None):
        names = {name.lower().replace("_", "-") for name in packages.get(module, ())}
        if names and not names & needed:
            raise ModuleNotFoundError(f"no default dependency has {module}", name=module)

packages = packages_distributions()
sys.meta_path.insert(0, Hidden())
import texbake

for path in sys.argv[1:]:
    assert texbake.read_mesh(path).n_faces == 12, path
"""


def test_the_default_dependencies_read_all_formats_but_usd(tmp_path):
    for suffix in (".obj", ".ply", ".stl", ".off", ".glb"):
        texbake.write_mesh(cube(), tmp_path / f"cube{suffix}")
    for suffix in (".dae", ".3mf"):
        texbake.to_trimesh(cube()).export(tmp_path / f"cube{suffix}")
    draco_file(cube(), tmp_path / "draco.glb")
    project = Path(__file__).parents[2] / "pyproject.toml"
    command = [sys.executable, "-P", "-c", WITHOUT_EXTRAS, project, *tmp_path.iterdir()]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_triangle_strips_of_a_ply_file_become_triangles(tmp_path):
    path = tmp_path / "strips.ply"
    header = (
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
        "property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    )
    points = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n"
    path.write_text(header + points + "9 0 1 2 3 -1 2 3 4 5\n")
    mesh = texbake.read_mesh(path)
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]]
    # All on one side, and a triangle that only turns the strip around is dropped.
    path.write_text(header + points + "5 0 1 2 2 3\n")
    assert texbake.read_mesh(path).faces.tolist() == [[0, 1, 2]]
    path.write_text(header + points + "3 0 1 9\n")
    with pytest.raises(MeshError, match="out of range"):
        texbake.read_mesh(path)
    path.write_text(header + points + "2 0 1\n")
    with pytest.raises(MeshError, match="no faces"):
        texbake.read_mesh(path)


def test_strips_of_a_binary_ply_file_in_several_rows(tmp_path):
    path = tmp_path / "strips.ply"
    header = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\n"
        "property float y\nproperty float z\nelement tristrips 2\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4").tobytes()
    rows = b"\x03" + np.array([0, 1, 2], "<i4").tobytes()
    rows += b"\x04" + np.array([2, 1, 3, 0], "<i4").tobytes()
    path.write_bytes(header.encode() + points + rows)
    assert texbake.read_mesh(path).faces.tolist() == [[0, 1, 2], [2, 1, 3], [1, 0, 3]]


def nested(tmp_path, n_levels, n_copies):
    """A sphere in a node, which each level places some times more."""
    texbake.to_trimesh(uv_sphere(4, 6)).export(tmp_path / "sphere.dae")
    text = (tmp_path / "sphere.dae").read_text("utf-8")
    geometry = re.search(r"<instance_geometry[^>]*?(?:/>|>.*?</instance_geometry>)", text, re.S)[0]
    nodes = [f'<node id="level0">{geometry}</node>'] + [
        f'<node id="level{i}">' + f'<instance_node url="#level{i - 1}"/>' * n_copies + "</node>"
        for i in range(1, n_levels + 1)
    ]
    library = f"<library_nodes>{''.join(nodes)}</library_nodes>"
    text = text.replace("<library_visual_scenes>", library + "<library_visual_scenes>", 1)
    top = f'<node id="top"><instance_node url="#level{n_levels}"/></node></visual_scene>'
    (tmp_path / "nested.dae").write_text(text.replace("</visual_scene>", top, 1), "utf-8")
    return tmp_path / "nested.dae"


def test_nodes_of_collada_that_place_nodes_are_read(tmp_path):
    path = nested(tmp_path, 2, 3)
    assert texbake.read_mesh(path).n_faces == 10 * uv_sphere(4, 6).n_faces


def test_what_macos_adds_to_an_archive_is_passed_over(tmp_path):
    texbake.to_trimesh(uv_sphere(4, 6)).export(tmp_path / "sphere.dae")
    with zipfile.ZipFile(tmp_path / "sphere.zae", "w") as archive:
        archive.write(tmp_path / "sphere.dae", "sphere.dae")
        archive.writestr("__MACOSX/._sphere.dae", b"\0\5\x16\7" + bytes(100))
    assert texbake.read_mesh(tmp_path / "sphere.zae").n_faces == uv_sphere(4, 6).n_faces


def built(folder, items, components=None, *, n_triangles=1, name="part"):
    """A .3mf file that builds objects, `1` of triangles, and others that consist of some."""
    points = "".join(f'<vertex x="{x}" y="{y}" z="0"/>' for x, y in ((0, 0), (1, 0), (0, 1)))
    triangles = '<triangle v1="0" v2="1" v3="2"/>' * n_triangles
    objects = (
        f'<object id="1" name="{name}"><mesh><vertices>{points}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object>"
    )
    for index, placed in (components or {}).items():
        parts = "".join(f'<component objectid="{other}"/>' for other in placed)
        objects += f'<object id="{index}"><components>{parts}</components></object>'
    text = (
        '<model unit="meter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f"<resources>{objects}</resources>"
        f"<build>{''.join(f'<item objectid={item}/>' for item in items)}</build></model>"
    )
    with zipfile.ZipFile(folder / "a.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", text)
    return folder / "a.3mf"


ONE = '"1"'


def test_objects_of_3mf_are_read_as_often_as_they_are_built(tmp_path):
    assert texbake.read_mesh(built(tmp_path, [ONE] * 20)).n_faces == 20
    assert texbake.read_mesh(built(tmp_path, ['"2"'] * 2, {"2": "111"})).n_faces == 6


@pytest.mark.parametrize(
    "lost",
    [
        {"items": ['"2"'] * 10, "components": {"2": "1" * 50}},
        {"items": ['"1" partnumber="a"'] * 2},
        {"items": ['"2"'], "components": {"2": "12"}},
    ],
    ids=["steps", "twins", "circle"],
)
def test_a_3mf_file_of_which_objects_would_be_lost_is_refused(lost, tmp_path):
    with pytest.raises(FileFormatError, match=r"would be lost|or it is damaged"):
        texbake.read_mesh(built(tmp_path, **lost))


@pytest.mark.parametrize("index", ["-1", "99999999999999999999"])
def test_indices_of_collada_that_are_out_of_range_are_refused(index, tmp_path):
    """The reader took another vertex without a word."""
    path = tmp_path / "indices.dae"
    texbake.to_trimesh(uv_sphere(4, 6)).export(path)
    text = path.read_text("utf-8")
    start = text.index("<p>") + 3
    path.write_text(text[:start] + index + text[text.index(" ", start) :], "utf-8")
    with pytest.raises(FileFormatError, match="an index of its faces is out of range"):
        texbake.read_mesh(path)


@pytest.mark.parametrize(("suffix", "module", "package"), [
    (".dae", "collada", "pycollada"),
    (".dae", "trimesh", "trimesh"),
    (".3mf", "networkx", "networkx"),
    (".xaml", "lxml", "lxml"),
])  # fmt: skip
def test_a_missing_library_is_named(tmp_path, monkeypatch, suffix, module, package):
    (tmp_path / f"a{suffix}").write_text("<a/>")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(DependencyError, match=f"{module} is missing; .*pip install {package}$"):
        mesh_of_trimesh(tmp_path / f"a{suffix}")
