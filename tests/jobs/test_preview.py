"""What a preview chooses by itself and reports: light, sides, camera and materials."""

import numpy as np
import pytest

import texbake
from tests.glb import glb_bytes, read_glb
from texbake import Mesh, read_image
from texbake.mesh.files.conversion import linear_colors
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.options import TransformOptions
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.texture.png_files import write_png
from texbake.verbs.meshes import convert_file
from texbake.verbs.preview import preview_files

pytestmark = pytest.mark.usefixtures("small_room")
SMALL = {"width": 96, "height": 64}
BALL = uv_sphere(24, 48)
HALF = Mesh(
    positions=BALL.positions, faces=BALL.faces[BALL.positions[BALL.faces].mean(axis=1)[:, 2] < -0.1]
)
INSIDE_OUT = Mesh(positions=BALL.positions, faces=np.ascontiguousarray(BALL.faces[:, ::-1]))


@pytest.fixture
def drawn(tmp_path):
    def draw(mesh, name="mesh.obj", **options):
        path = tmp_path / name
        if isinstance(mesh, Mesh):
            texbake.write_mesh(mesh, path)
        return preview_files(path, tmp_path / "picture.png", {**SMALL, **options})

    return draw


@pytest.mark.parametrize("mesh", [HALF, INSIDE_OUT], ids=["open", "inside out"])
def test_back_faces_are_shown_and_reported(drawn, mesh):
    done = drawn(mesh, view=(0.0, 0.0))
    assert (done.report.coverage > 0).mean() > 0.3
    (row,) = [text for label, text in done.table() if label == "back faces"]
    assert float(row.split(" %")[0]) > 90.0
    assert not done.warnings


def test_a_mesh_without_normals_is_hard_at_sharp_edges_but_smooth_with_a_normal_map(tmp_path):
    write_png(tmp_path / "flat.png", np.full((4, 4, 3), (128, 128, 255), np.uint8))
    maps = {"normal_map": tmp_path / "flat.png"}
    bare = cube().replace(uvs=cube().positions[:, :2], uv_faces=cube().faces)
    meshes = (bare, with_normals(bare), with_normals(bare, "smooth"))

    def drawn(**maps):
        for mesh in meshes:
            texbake.write_mesh(mesh, tmp_path / "cube.obj")
            preview_files(tmp_path / "cube.obj", tmp_path / "picture.png", SMALL, **maps)
            yield (tmp_path / "picture.png").read_bytes()

    plain, hard, smooth = drawn()
    assert plain == hard != smooth
    plain, hard, smooth = drawn(albedo=tmp_path / "flat.png")
    assert plain == hard != smooth
    plain, hard, smooth = drawn(**maps)
    assert plain == smooth != hard


def test_front_faces_are_shown_without_a_report(drawn):
    assert drawn(HALF, view=(180.0, 0.0)).table() == []
    assert drawn(BALL).table() == []


@pytest.mark.parametrize(("side", "rows"), [(0.02, []), (0.2, ["back faces"])])
def test_back_faces_of_no_share_in_the_figure_are_not_reported(drawn, side, rows):
    corner = np.array([[0.5, 0.5, 0.1], [0.5, 0.5 + side, 0.1], [0.5 + side, 0.5, 0.1]])
    mesh = Mesh(
        positions=np.vstack([plane().positions, corner]),
        faces=np.vstack([plane().faces, [[4, 5, 6]]]),
    )
    done = drawn(mesh, view=(0.0, 0.0), width=300, height=300)
    assert [label for label, _ in done.table()] == rows


@pytest.mark.parametrize("mesh", [HALF, BALL], ids=["open", "closed"])
@pytest.mark.parametrize("back_faces", ["cull", "show"])
def test_options_choose_the_sides(drawn, mesh, back_faces):
    done = drawn(mesh, view=(0.0, 0.0), back_faces=back_faces)
    assert done.report.coverage.any() == (mesh is BALL or back_faces == "show")
    assert "back faces" not in dict(done.table())


def one_color(done):
    (line,) = [line for line in done.warnings if "the picture has one color" in line]
    return line.split("one color: ")[1]


def test_a_picture_of_one_color_is_a_warning(drawn, tmp_path):
    said = one_color(drawn(HALF, view=(0.0, 0.0), back_faces="cull"))
    assert said == "every triangle is seen from behind; draw them with --back-faces show"
    point = Mesh(positions=np.ones((3, 3)), faces=[[0, 1, 2]])
    edge_on = Mesh(positions=[[0, 0, 0], [0, 0, 1], [1, 0, 0]], faces=[[0, 1, 2]])
    for mesh in (point, edge_on):
        said = one_color(drawn(mesh, view=(0.0, 0.0)))
        assert said.startswith("every triangle is seen edge-on or has no area")
    assert "another --view" in one_color(drawn(BALL, view=(0.0, 0.0, 1e9)))
    gltf_ball(tmp_path, extensions={"KHR_materials_unlit": {}},
              pbrMetallicRoughness={"baseColorFactor": [0, 0, 0, 1]})  # fmt: skip
    assert one_color(drawn(None, "ball.glb")).startswith("everything is black")
    assert not drawn(cube()).warnings


def gltf_ball(folder, **material):
    path = folder / "ball.glb"
    texbake.write_mesh(BALL, path)
    document, data = read_glb(path)
    document["materials"] = [material]
    document["meshes"][0]["primitives"][0]["material"] = 0
    path.write_bytes(glb_bytes(document, data))


@pytest.mark.parametrize("metal", [0.0, 1.0])
def test_white_materials_do_not_clip_and_black_ones_stay_black(drawn, tmp_path, metal):
    shares = {}
    for gray in 0.0, 0.2, 1.0:
        pbr = {"baseColorFactor": [gray] * 3 + [1], "metallicFactor": metal, "roughnessFactor": 0.3}
        gltf_ball(tmp_path, pbrMetallicRoughness=pbr)
        done = drawn(None, "ball.glb")
        inside = done.report.coverage == 1.0
        codes = read_image(tmp_path / "picture.png", color=False).pixels[inside] * 255.0
        assert (codes >= 254.5).any(axis=1).mean() <= 0.01
        shares[gray] = np.median(codes)
    assert shares[0.0] < 16 < shares[0.2] < shares[1.0] > 120


def test_materials_of_an_obj_file_are_drawn(drawn, tmp_path):
    texbake.write_mesh(BALL, tmp_path / "ball.obj")
    text = (tmp_path / "ball.obj").read_text(encoding="utf-8")
    (tmp_path / "ball.obj").write_text(f"mtllib ball.mtl\nusemtl paint\n{text}", encoding="utf-8")
    means = {}
    for color in "1 0 0", "0 0 0":
        (tmp_path / "ball.mtl").write_text(f"newmtl paint\nKd {color}\n", encoding="utf-8")
        done = drawn(None, "ball.obj")
        means[color] = done.report.color[done.report.coverage == 1.0][:, :3].mean(axis=0)
    red, green, _ = means["1 0 0"]
    assert red > 0.3
    assert green < 0.05
    assert means["0 0 0"].max() < 0.02


def test_colors_of_vertices_are_drawn(drawn):
    colors = np.tile([0.0, 0.5, 0.0, 1.0], (BALL.n_vertices, 1))
    done = drawn(BALL.replace(colors=colors), "ball.ply")
    red, green, _ = done.report.color[done.report.coverage == 1.0][:, :3].mean(axis=0)
    assert green > 4.0 * red


def test_colors_of_vertices_look_the_same_in_every_format(drawn, tmp_path):
    colors = linear_colors(np.round(255.0 * (0.5 + 0.5 * BALL.positions)).astype(np.uint8))
    of_ply = drawn(with_normals(BALL.replace(colors=colors)), "mesh.ply").report.color
    convert_file(tmp_path / "mesh.ply", tmp_path / "mesh.glb", TransformOptions(), progress=None)
    of_glb = drawn(None, "mesh.glb").report.color
    np.testing.assert_allclose(of_ply, of_glb, atol=1e-4)


def test_a_turntable_has_the_exposure_of_its_first_picture(tmp_path):
    gltf_ball(tmp_path, emissiveFactor=[1, 1, 1])
    one, three = (
        preview_files(tmp_path / "ball.glb", tmp_path / f"turn{n}", SMALL, n_views=n)
        for n in (1, 3)
    )
    assert one.report.exposure == three.report.exposure < 1.0
    assert (one.report.color != three.report.color).any()


def test_pictures_side_by_side_share_one_exposure(tmp_path):
    gltf_ball(tmp_path, emissiveFactor=[1, 1, 1])
    preview_files(
        tmp_path / "ball.glb", tmp_path / "both.png", SMALL,
        side_by_side={"interpolation": ("perspective", "affine")},
    )  # fmt: skip
    pixels = read_image(tmp_path / "both.png", color=False).pixels
    assert pixels.max() < 1.0
