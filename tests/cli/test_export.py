"""`texbake export` from the command line."""

import numpy as np
import pytest

from texbake import read_mesh, write_image, write_mesh
from texbake.mesh.shapes import uv_sphere
from texbake.texture.image_files import write_normals


@pytest.fixture
def asset(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh(uv_sphere(8, 12), tmp_path / "rock.obj")
    write_mesh(uv_sphere(4, 6), tmp_path / "far.obj")
    flat = np.zeros((8, 8, 3), np.float32)
    flat[..., 2] = 1.0
    (tmp_path / "maps").mkdir()
    write_normals(flat, tmp_path / "maps" / "normal.png")
    write_image(np.zeros((8, 8, 1), np.uint8), tmp_path / "maps" / "ao.png")
    write_image(np.full((8, 8, 1), 9, np.uint8), tmp_path / "r.png")
    return tmp_path


def test_a_folder_of_maps_and_single_ones(invoke, asset):
    result = invoke("export rock.obj --to unreal --maps maps --map roughness=r.png -o out")
    names = {path.name for path in (asset / "out").iterdir()}
    assert names == {
        *("SM_rock.glb", "T_rock_N.png", "T_rock_ORM.png"), *("import_rock.py", "SETTINGS.txt"),
    }  # fmt: skip
    assert "no metalness was given" in result.stderr


@pytest.mark.parametrize(("words", "file"), [
    ("export rock.obj --to unity -o .", "rock.obj"),
    ("export maps/stone.obj --to unity -o maps", "maps/stone.obj"),
    ("export rock.obj --to blender --map normal=stone_normal.png --name stone -o .", "stone_n"),
])  # fmt: skip
def test_inputs_are_not_overwritten(invoke, asset, words, file):
    write_mesh(uv_sphere(8, 12), asset / "maps" / "stone.obj")
    (asset / "stone_normal.png").write_bytes((asset / "maps" / "normal.png").read_bytes())
    before = {path: path.read_bytes() for path in asset.rglob("*.*")}
    message = invoke(words, 2).stderr
    assert file in message and "it is also an input; give the output another folder" in message
    assert all(path.read_bytes() == content for path, content in before.items())


@pytest.mark.usefixtures("meshoptimizer")
def test_levels_and_compression(run, asset):
    words = "export rock.obj --to threejs --level far.obj --compress --name stone -o out"
    result = run(words)
    assert (result.returncode, result.stderr) == (0, "")
    assert read_mesh(asset / "out" / "stone.glb").n_faces == uv_sphere(8, 12).n_faces
    text = " ".join((asset / "out" / "SETTINGS.txt").read_text(encoding="utf-8").split())
    assert "2 levels of detail" in text and "MeshoptDecoder" in text
