"""Each kind of step, by itself and against what it stands for."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from texbake.building.step import Job
from texbake.building.steps import STEP_KINDS
from texbake.building.steps.figures import steady
from texbake.building.steps.repair import RepairStep, repaired
from texbake.errors import MeshError, OptionError, UvError
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.parametric.make import make
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.mesh.topology import find_edges
from texbake.texture.image import read_image, write_image

Do = Callable[..., tuple[dict[str, Path], dict[str, Any]]]


@pytest.fixture
def do(tmp_path: Path) -> Do:
    """Do a step; returns its files and figures."""

    def do(
        name: str, given: dict[str, Any], threads: int = 1, **inputs: Any
    ) -> tuple[dict[str, Path], dict[str, Any]]:
        kind = STEP_KINDS[name]
        roles = {
            role: file if isinstance(file, tuple) else (file,) for role, file in inputs.items()
        }
        settings = kind.settings({**given, **dict.fromkeys(roles, "x")})
        folder = tmp_path / f"{name}{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        outputs = {key: folder / file for key, file in kind.outputs(settings).items()}
        figures = kind.run(
            Job(settings=settings, inputs=roles, outputs=outputs, threads=threads, asset="a")
        )
        assert all(path.exists() for path in outputs.values())
        assert set(folder.iterdir()) == set(outputs.values())
        return outputs, figures

    return do


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    write_mesh(uv_sphere(8, 16), tmp_path / "ball.obj")
    return tmp_path / "ball.obj"


def test_made_meshes_are_those_of_the_room(do: Do) -> None:
    files, figures = do("make", {"shape": "torus", "resolution": (12, 8), "format": "obj"})
    mesh = read_mesh(files["mesh"])
    expected = make("torus", resolution=(12, 8))
    assert np.array_equal(mesh.positions, expected.positions)
    assert figures["faces"] == 2 * 12 * 8


def test_relief_moves_along_the_normals_by_at_most_its_height(do: Do) -> None:
    files, _ = do("make", {"shape": "sphere", "relief": "worley", "relief_height": 0.1})
    radii = np.linalg.norm(read_mesh(files["mesh"]).positions, axis=1)
    assert radii.min() >= 1.0 - 1e-6 and radii.max() <= 1.1 + 1e-6
    assert radii.std() > 0.01


def test_a_shape_is_given_what_it_reads(do: Do) -> None:
    with pytest.raises(OptionError, match="radius: the shape plane does not use it"):
        do("make", {"shape": "plane", "radius": 2.0})
    with pytest.raises(OptionError, match="profile: the shape revolution needs it"):
        do("make", {"shape": "revolution"})


def test_levels_of_detail(do: Do, ball: Path) -> None:
    files, figures = do("simplify", {"faces": (100, 40)}, mesh=ball)
    assert list(files) == ["lod0", "lod1"]
    assert [read_mesh(path).n_faces for path in files.values()] == [
        level["faces"] for level in figures["levels"]
    ]
    assert figures["levels"][0]["faces"] <= 100 and figures["levels"][1]["faces"] <= 40


def test_maps_in_several_formats(do: Do, ball: Path) -> None:
    given = {
        "maps": ("normal", "displacement"), "format": {"displacement": "exr"}, "size": 32,
        "padding": 1,
    }  # fmt: skip
    files, figures = do("bake", given, high=ball, low=ball)
    assert [path.suffix for path in files.values()] == [".png", ".exr", ".png", ".json"]
    assert figures["miss_percent"] == 0.0 and figures["faces"] == 224
    again, _ = do("bake", given, threads=2, high=ball, low=ball)
    for name, path in files.items():
        assert path.read_bytes() == again[name].read_bytes()


def test_reports_have_no_times() -> None:
    report = {"a": [{"seconds": 1.0, "b": 2}], "stages": [], "options": {"threads": 3, "size": 4}}
    assert steady(report) == {"a": [{"b": 2}], "options": {"size": 4}}


def test_textures(do: Do, ball: Path, tmp_path: Path) -> None:
    made, _ = do(
        "bake-texture", {"procedure": "marble", "size": 32, "padding": 1, "samples": 1}, mesh=ball
    )
    assert read_image(made["texture"], color=True).pixels.std() > 0.01
    levels, figures = do("mipmap", {}, image=made["texture"])
    assert figures["levels"] == len(list(levels["levels"].iterdir())) == 6
    write_image(np.zeros((16, 16, 3)), tmp_path / "black.png", color=True)
    packed, figures = do(
        "pack-textures",
        {"meshes": 2, "padding": 0},
        images=(made["texture"], tmp_path / "black.png"),
        mesh=(ball, ball),
    )
    assert list(packed) == ["texture", "mesh0", "mesh1"]
    places = [read_mesh(packed[f"mesh{i}"]).corner_uvs() for i in range(2)]
    assert not np.array_equal(*places)
    with pytest.raises(OptionError, match="meshes: it is the number"):
        do("pack-textures", {"meshes": 1}, images=(made["texture"],))


def test_a_picture(do: Do, ball: Path) -> None:
    files, _ = do("preview", {"width": 64, "height": 48}, mesh=ball)
    assert read_image(files["picture"], color=True).pixels.shape[:2] == (48, 64)


def test_an_asset_for_another_program(do: Do, ball: Path) -> None:
    maps, _ = do("bake", {"size": 32, "padding": 1}, high=ball, low=ball)
    files, figures = do(
        "export", {"target": "unreal", "mesh_format": "glb"}, mesh=ball, levels=(ball, ball),
        normal=maps["normal"],
    )  # fmt: skip
    made = {path.name: path for path in files["folder"].iterdir()}
    assert set(made) == {"SM_a.glb", "T_a_N.png", "SETTINGS.txt"}
    assert figures["bytes"] == sum(path.stat().st_size for path in made.values())
    # Unreal's green goes down, that of the bake up.
    ours, theirs = (read_image(p, color=False).pixels for p in (maps["normal"], made["T_a_N.png"]))
    np.testing.assert_allclose(theirs[..., 1], 1.0 - ours[..., 1], atol=2 / 255)


def test_a_page_tells_what_the_files_do(do: Do, ball: Path) -> None:
    given = {"maps": ("normal", "displacement"), "size": 32, "padding": 1}
    maps, _ = do("bake", given, high=ball, low=ball)
    files, figures = do(
        "page", {"size": 64}, high=ball, low=ball, normal_map=maps["normal"],
        displacement=maps["displacement"], misses=maps["misses"],
    )  # fmt: skip
    text = files["page"].read_text()
    assert "<title>a: baked from its dense mesh</title>" in text
    assert 'id="distances"' in text and 'id="errors"' in text and str(ball.parent) not in text
    # A mesh baked onto itself: what is left comes from 8 and 16 bit codes and 64 pixels.
    assert figures["error_deg"] < 0.5 and figures["bare_error_deg"] < 0.5
    bare, figures = do("page", {}, high=ball, low=ball)
    assert 'id="errors"' not in bare["page"].read_text() and figures == {}


def test_limits(do: Do, ball: Path, tmp_path: Path) -> None:
    _, figures = do("check", {"fail_on": "never", "max_faces": 224}, mesh=ball)
    assert figures["stretch_l2"] > 1.0
    with pytest.raises(MeshError, match="224 triangles are more than max_faces, 223"):
        do("check", {"fail_on": "never", "max_faces": 223}, mesh=ball)
    with pytest.raises(UvError, match=r"max_stretch is 1\.01"):
        do("check", {"fail_on": "never", "max_stretch": 1.01}, mesh=ball)
    write_mesh(plane().replace(uvs=[[1, 0], [0, 0], [1, 1], [0, 1]]), tmp_path / "mirrored.obj")
    with pytest.raises(MeshError, match="the check found mirrored"):
        do("check", {"fail_on": "warning"}, mesh=tmp_path / "mirrored.obj")


def spoiled(mesh: Mesh, seed: int) -> Mesh:
    """The same surface with vertices split, faces turned, repeated and without area."""
    random = np.random.default_rng(seed)
    faces = np.arange(3 * mesh.n_faces).reshape(-1, 3)
    turned = random.random(len(faces)) < 0.4
    faces[turned] = faces[turned][:, ::-1]
    more = random.integers(0, len(faces), 5)
    flat = np.stack([faces[:3, 0], faces[:3, 1], faces[:3, 1]], axis=1)
    return Mesh(
        positions=mesh.positions[mesh.faces].reshape(-1, 3),
        faces=np.concatenate([faces, faces[more], flat]),
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["icosphere", "torus", "cube"])
def test_a_closed_mesh_is_mended_to_what_it_was(name: str, seed: int) -> None:
    meshes = {"icosphere": icosphere(2), "torus": make("torus", resolution=(9, 6)), "cube": cube()}
    mesh = meshes[name]
    mended, counts = repaired(spoiled(mesh, seed))
    assert counts["duplicate faces"] == 5 and counts["faces without area"] == 3
    assert counts["vertices merged"] == 3 * mesh.n_faces - mesh.n_vertices
    # Corner by corner, up to where each face begins.
    before, after = (m.positions[m.faces] for m in (mesh, mended))
    firsts = [np.abs(np.roll(after, k, axis=1) - before).max(axis=(1, 2)) for k in range(3)]
    assert np.min(firsts, axis=0).max() == 0.0


def test_an_open_mesh_keeps_the_side_that_most_faces_show() -> None:
    mesh = plane(4, 4)
    faces = mesh.faces.copy()
    faces[:5] = faces[:5, ::-1]
    mended, counts = repaired(Mesh(positions=mesh.positions, faces=faces))
    assert counts["faces turned"] == 5
    assert not find_edges(mended.faces).misoriented.any()
    normals = np.cross(
        *(
            mended.positions[mended.faces[:, k]] - mended.positions[mended.faces[:, 0]]
            for k in (1, 2)
        )
    )
    assert (normals[:, 2] > 0).all()


def test_what_has_one_side_is_left_as_it_is() -> None:
    strip = make("mobius", resolution=(16, 2))
    mended, counts = repaired(strip)
    assert counts["faces turned"] == 0
    assert np.array_equal(mended.faces, repaired(mended)[0].faces)


def test_turned_faces_take_their_normals_and_coordinates_with_them() -> None:
    ball = uv_sphere(4, 8)
    normals = ball.positions / np.linalg.norm(ball.positions, axis=1)[:, None]
    ball = ball.replace(normals=normals, normal_faces=ball.faces)
    inside_out = {
        name: np.ascontiguousarray(getattr(ball, name)[:, ::-1])
        for name in ("faces", "uv_faces", "normal_faces")
    }
    turned = ball.replace(**inside_out, normals=-ball.normals)
    mended, counts = repaired(turned, RepairStep(merge=False))
    assert counts["faces turned"] == ball.n_faces
    assert np.array_equal(mended.faces, ball.faces)
    assert np.array_equal(mended.corner_uvs(), ball.corner_uvs())
    assert mended.normals is not None
    assert np.array_equal(mended.normals[mended.normal_faces], ball.normals[ball.normal_faces])
