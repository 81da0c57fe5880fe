"""USD files, written by texbake, by hand and by Pixar's library."""

import re
import sys
import zipfile

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade

from texbake import FileError, OptionError, ReadWarning, read_mesh, write_mesh
from texbake.errors import DependencyError, FileFormatError, MeshError, UvError
from texbake.mesh.files.usd import read_usd
from texbake.mesh.normals import shading_normals
from texbake.mesh.shapes import cube, grid_sphere, plane, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.texture.png_files import write_png

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")

# Two quads side by side in the plane z = 0, of a stage whose head is to be filled in.
TWO_QUADS = """#usda 1.0
(
    {head}
)
def Xform "world"
{{
    double3 xformOp:translate = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "wall"
    {{
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
        {body}
    }}
}}
"""
QUAD_POINTS = np.array([[1, 2, 3], [2, 2, 3], [3, 2, 3], [1, 3, 3], [2, 3, 3], [3, 3, 3]])


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.usda"


@pytest.fixture
def stage_file(path):
    def write(body="", head=""):
        path.write_text(TWO_QUADS.format(head=head, body=body))
        return path

    return write


@pytest.fixture
def grouped():
    sphere = uv_sphere(8, 12)
    return sphere.replace(
        face_groups=np.arange(sphere.n_faces) % 3,
        group_names=("a", 'quotes " and \\', "Schale \U0001f34a"),
        colors=np.linspace(0, 1, 4 * sphere.n_vertices).reshape(-1, 4),
        tangents=corner_tangents(sphere),
    )


@pytest.fixture
def image(tmp_path):
    write_png(tmp_path / "n.png", np.full((4, 4, 3), 128, np.uint8))
    return tmp_path / "n.png"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_written_meshes_come_back_and_have_the_same_bytes_again(tmp_path, grouped, suffix, image):
    path = tmp_path / f"a{suffix}"
    write_mesh(grouped, path)
    back = read_mesh(path)
    assert back.name == path.name
    for field in "faces", "uv_faces", "face_groups":
        np.testing.assert_array_equal(getattr(back, field), getattr(grouped, field))
    # The format's points, coordinates and normals are float32.
    np.testing.assert_array_equal(back.positions, grouped.positions.astype(np.float32))
    np.testing.assert_array_equal(back.uvs, grouped.uvs.astype(np.float32))
    np.testing.assert_array_equal(back.colors, grouped.colors)
    np.testing.assert_array_equal(back.tangents, grouped.tangents)
    assert back.group_names == grouped.group_names
    normals, corners = shading_normals(grouped)
    found = back.normals[back.normal_faces]
    np.testing.assert_allclose(found, normals[corners], atol=1e-6)  # float32 of unit vectors
    contents = []
    for name in "one", "two":
        (tmp_path / name).mkdir()
        path = tmp_path / name / f"a{suffix}"
        write_mesh(grouped, path, normal_map=image)
        contents.append(path.read_bytes())
    assert contents[0] == contents[1]


def test_hard_edges_and_bare_meshes_come_back(path):
    write_mesh(cube(), path)
    back = read_usd(path)
    normals, corners = shading_normals(cube())
    np.testing.assert_allclose(back.normals[back.normal_faces], normals[corners], atol=1e-6)
    write_mesh(grid_sphere(4, 6).replace(normals=None, normal_faces=None), path)
    assert read_usd(path).uvs is None


def test_a_place_far_from_the_origin_is_kept_by_the_transform(path):
    sphere = uv_sphere(8, 12)
    far = sphere.replace(positions=sphere.positions + 1e6)
    write_mesh(far, path)
    # What float32 leaves of a sphere of radius 1 about its own middle.
    assert np.abs(read_usd(path).positions - far.positions).max() < 1e-6


def test_axes_and_unit_become_the_houses(stage_file):
    points = QUAD_POINTS
    np.testing.assert_array_equal(read_usd(stage_file()).positions, points)
    x, y, z = points.T
    turned = np.stack([x, z, -y], axis=1)
    np.testing.assert_array_equal(read_usd(stage_file(head='upAxis = "Z"')).positions, turned)
    centimeters = read_usd(stage_file(head='upAxis = "Z"\nmetersPerUnit = 0.01'))
    np.testing.assert_allclose(centimeters.positions, turned * 0.01, rtol=1e-15)


def test_left_handed_faces_are_turned(stage_file):
    right = read_usd(stage_file())
    left = read_usd(stage_file('uniform token orientation = "leftHanded"'))
    np.testing.assert_array_equal(left.faces, right.faces[:, ::-1])


@pytest.mark.parametrize(("body", "expected"), [
    ("vertex", "point"),
    ("varying", "point"),
    ("faceVarying", "corner"),
    ("uniform", "polygon"),
    ("constant", "zero"),
])  # fmt: skip
def test_every_interpolation_reaches_the_corners(stage_file, body, expected):
    counts = {"point": 6, "corner": 8, "polygon": 2, "zero": 1}
    values = [(i / 8, 1 - i / 8) for i in range(counts[expected])]
    mesh = read_usd(stage_file(f'texCoord2f[] primvars:st = {values} (interpolation = "{body}")'))
    # Both quads are fanned out from their first corner: corners 0 1 2, 0 2 3 of each.
    corners = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    points = np.array([0, 1, 4, 3, 1, 2, 5, 4])
    element = {"point": points, "corner": np.arange(8), "polygon": np.arange(8) // 4,
               "zero": np.zeros(8, int)}[expected]  # fmt: skip
    np.testing.assert_array_equal(mesh.corner_uvs(), np.array(values)[element][corners])


def test_indexed_coordinates_keep_their_indices(stage_file):
    mesh = read_usd(
        stage_file(
            "texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] "
            '(interpolation = "faceVarying")\n'
            "int[] primvars:st:indices = [0, 1, 2, 3, 0, 1, 2, 3]"
        )
    )
    assert mesh.uv_faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3]]


def test_coordinates_of_corners_are_welded_where_point_and_value_agree(stage_file):
    values = [(0, 0), (0.5, 0), (0.5, 1), (0, 1), (0.5, 0), (1, 0), (1, 1), (0.75, 1)]
    mesh = read_usd(stage_file(
        f'texCoord2f[] primvars:st = {values} (interpolation = "faceVarying")'
    ))  # fmt: skip
    # One of the two points that both quads share has one coordinate, the other has two.
    assert len(mesh.uvs) == 7
    assert mesh.uv_faces[0, 1] == mesh.uv_faces[2, 0]


def test_other_names_of_coordinates_are_found(stage_file):
    values = [(i / 8, 0) for i in range(6)]
    body = (
        f'float2[] primvars:pairs = {values[::-1]} (interpolation = "vertex")\n'
        f'texCoord2f[] primvars:UVMap = {values} (interpolation = "vertex")'
    )
    mesh = read_usd(stage_file(body))
    np.testing.assert_array_equal(mesh.uvs, values)


def test_subsets_are_groups_and_the_rest_is_the_mesh(stage_file):
    body = """
        def GeomSubset "left"
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0, 2, -1]
        }"""
    mesh = read_usd(stage_file(body))
    assert (mesh.group_names, mesh.face_groups.tolist()) == (("left", "wall"), [0, 0, 1, 1])


def test_holes_faces_without_corners_and_hidden_meshes_are_left_out(stage_file):
    assert read_usd(stage_file("int[] holeIndices = [0]")).n_faces == 2
    path = stage_file()
    path.write_text(path.read_text().replace("[4, 4]", "[4, 0, 4]"))
    with pytest.warns(ReadWarning, match="left out 1 face with fewer than three corners"):
        assert read_usd(path).n_faces == 4
    for hidden in 'token visibility = "invisible"', 'uniform token purpose = "guide"':
        with pytest.raises(MeshError, match="it has no faces"):
            read_usd(stage_file(hidden))


def test_several_meshes_are_joined_where_they_stand(path):
    stage = Usd.Stage.CreateNew(str(path))
    for i, name in enumerate(("first", "second")):
        mesh = UsdGeom.Mesh.Define(stage, f"/{name}")
        mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
        mesh.CreateFaceVertexCountsAttr([3])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
        mesh.AddTranslateOp().Set((10.0 * i, 0, 0))
    # One of them mirrored, which turns its faces inside out; they are turned back.
    mesh.AddScaleOp().Set((-1, 1, 1))
    stage.Save()
    joined = read_usd(path)
    assert joined.group_names == ("first", "second")
    assert joined.positions[3:].tolist() == [[10, 0, 0], [9, 0, 0], [10, 1, 0]]
    corners = joined.positions[joined.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()


def test_time_samples_are_read_at_their_first(stage_file):
    path = stage_file()
    text = path.read_text()
    points = re.search(r"points = (\[.*\])", text)[1]
    moved = f"points.timeSamples = {{ 5: {points}, 9: [(9, 9, 9)] }}"
    path.write_text(text.replace(f"points = {points}", moved))
    np.testing.assert_array_equal(read_usd(path).positions, QUAD_POINTS)


def test_the_material_is_a_preview_surface_of_its_textures(tmp_path, image):
    path = tmp_path / "usd" / "a.usda"
    path.parent.mkdir()
    write_mesh(plane(), path, normal_map=image, base_color=(0.9, 0.4, 0.1), orm=image)
    stage = Usd.Stage.Open(str(path))
    mesh = stage.GetDefaultPrim().GetChild("a")
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    surface, _, _ = material.ComputeSurfaceSource()
    assert surface.GetIdAttr().Get() == "UsdPreviewSurface"
    assert np.allclose(surface.GetInput("diffuseColor").Get(), (0.9, 0.4, 0.1))
    for name, channel in (("normal", "rgb"), ("roughness", "g"), ("metallic", "b"),
                          ("occlusion", "r")):  # fmt: skip
        (source,), _ = surface.GetInput(name).GetConnectedSources()
        assert source.sourceName == channel
        shader = UsdShade.Shader(source.source.GetPrim())
        file = shader.GetInput("file").Get()
        assert (file.path, file.resolvedPath) == ("../n.png", str(image))
        assert shader.GetInput("sourceColorSpace").Get() == "raw"


def test_a_package_holds_its_textures_where_readers_map_them(tmp_path, image):
    path = tmp_path / "a.usdz"
    write_mesh(plane(), path, normal_map=image)
    image_bytes = image.read_bytes()
    image.unlink()
    with zipfile.ZipFile(path) as package:
        entries = package.infolist()
        assert [entry.filename for entry in entries] == ["asset.usdc", "textures/normal.png"]
        assert package.read("textures/normal.png") == image_bytes
    data = path.read_bytes()
    for entry in entries:
        assert entry.compress_type == zipfile.ZIP_STORED
        head = entry.header_offset
        lengths = np.frombuffer(data[head + 26 : head + 30], "<u2")
        assert (head + 30 + lengths.sum()) % 64 == 0
    stage = Usd.Stage.Open(str(path))
    shader = UsdShade.Shader(stage.GetPrimAtPath("/asset/material/normal"))
    assert shader.GetInput("file").Get().resolvedPath.endswith("a.usdz[textures/normal.png]")


def test_invalid_usd_data_is_an_error(tmp_path, path, image):
    with pytest.raises(UvError, match="no texture coordinates"):
        write_mesh(grid_sphere(4, 6), path, normal_map=image)
    with pytest.raises(OptionError, match="factors between 0 and 1"):
        write_mesh(plane(), path, base_color=(2, 0, 0))
    with pytest.raises(OptionError, match="has no levels"):
        write_mesh(plane(), path, levels=[plane()])
    huge = plane().replace(positions=plane().positions * 1e39)
    with pytest.raises(MeshError, match="beyond float32"):
        write_mesh(huge, path)
    assert not path.exists()


@pytest.mark.parametrize(("change", "message"), [
    (("[4, 4]", "[4, 3]"), "its faces count 7 corners, and 8 are there"),
    (("[4, 4]", "[9, -1]"), "corners"),
    (("2, 5, 4]", "2, 6, 4]"), "a corner is none of its 6 points"),
    (("(1, 1, 0)", "(1, nan, 0)"), "a position is not finite"),
    (("[4, 4]", "[4, 4"), "not a USD file, or damaged"),
    (("Counts", "\udcffCounts"), "not a USD file, or damaged"),
    (("(interp", " = [(0, 0)] (interp"), "/world/wall: primvars:st: it has 1 values"),
    (("(interp", f" = {[(0, 0)] * 9} (interp"), "it has 9 values for 8 corners"),
    (('(interpolation = "faceVarying")', "= [(0, 0)]\nint[] primvars:st:indices = [7]"),
     "primvars:st: it has 1 values"),
])  # fmt: skip
def test_inconsistent_files_are_one_clear_line(stage_file, change, message):
    path = stage_file('texCoord2f[] primvars:st (interpolation = "faceVarying")')
    text = path.read_text().replace(*change)
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises((FileFormatError, MeshError), match=re.escape(message)) as error:
        read_mesh(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


@pytest.mark.parametrize("suffix", [".usdc", ".usda"])
def test_a_file_cut_anywhere_is_one_clear_line_or_whole(tmp_path, grouped, suffix, monkeypatch):
    monkeypatch.undo()  # a process of its own reads damaged files
    path = tmp_path / f"a{suffix}"
    write_mesh(grouped, path)
    data = path.read_bytes()
    for length in 0, len(data) // 2, len(data) - 1:
        path.write_bytes(data[:length])
        try:
            mesh = read_usd(path)
        except (FileFormatError, MeshError) as error:
            assert "\n" not in str(error)
        else:  # what is left out is the newline at the end of the text
            assert mesh.n_faces == grouped.n_faces
            assert length == len(data) - 1


def test_a_missing_file_or_library_is_reported(tmp_path, path, monkeypatch):
    with pytest.raises(FileError, match="there is no such file"):
        read_usd(path)
    monkeypatch.setitem(sys.modules, "pxr.Usd", None)
    (tmp_path / "pxr.py").write_text("raise ImportError('usd-core is not here')")
    monkeypatch.syspath_prepend(tmp_path)  # for the process that reads
    for use in (lambda: write_mesh(plane(), path), lambda: (path.touch(), read_usd(path))):
        with pytest.raises(DependencyError, match=r"texbake\[usd\]"):
            use()


def test_a_file_written_again_is_read_again(path):
    write_mesh(plane(), path)
    assert read_usd(path).n_faces == plane().n_faces
    write_mesh(cube(), path)
    assert read_usd(path).n_faces == cube().n_faces
