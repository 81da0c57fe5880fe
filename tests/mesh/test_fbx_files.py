"""FBX files of Blender and Maya, held against what they show as OBJ.

The files are in the folder of meshes that TEXBAKE_DATA names; without it these tests skip.
"""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from texbake.errors import TexbakeError
from texbake.mesh.files import read_mesh
from texbake.mesh.files.fbx_scene import read_scene
from texbake.mesh.files.fbx_transforms import scene_axes

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data")) / "fbx"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"the meshes of {DATA} are not there")

# Files whose OBJ shows what is not read: skins and shapes at work, subdivision, NURBS; or whose
# OBJ is in other axes and units.
OTHERWISE = re.compile(
    "half_skinned|subsurf|crease|blend_shape|skinned_pivot|dual_quaternion|maya_poses|nurbs"
    "|blender_340_._up"
)


def pairs():
    for shown in sorted(DATA.glob("*.obj")):
        name = re.compile(re.escape(shown.stem) + r"_\d{4}_(ascii|binary)\.fbx")
        if not OTHERWISE.search(shown.stem):
            yield from ((f, shown) for f in sorted(DATA.glob("*.fbx")) if name.fullmatch(f.name))


def directed_edges(mesh, positions):
    corners = positions[mesh.faces]
    return np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 6)


def polygon_edges(path, positions):
    """(E, 6) directed edges of the polygons of an OBJ file."""
    edges = []
    for line in path.read_text(errors="replace").splitlines():
        if line.startswith("f "):
            corners = [int(word.split("/")[0]) for word in line.split()[1:]]
            corners = [c - 1 if c > 0 else c for c in corners]
            edges += zip(corners, corners[1:] + corners[:1], strict=True)
    return positions[np.array(edges)].reshape(-1, 6)


@pytest.mark.parametrize(
    "file, shown", [pytest.param(file, shown, id=file.stem) for file, shown in pairs()]
)
def test_a_file_shows_what_its_obj_shows(file, shown):
    """The polygons of the OBJ, whose edges run the same way round; diagonals may differ."""
    expected, mesh = read_mesh(shown), read_mesh(file)
    settings = read_scene(file).settings
    axes = scene_axes({key: settings[key] for key in settings if "Axis" in key or "Unit" in key})
    assert mesh.n_faces == expected.n_faces
    edges = polygon_edges(shown, expected.positions @ axes[:3, :3].T)
    size = np.abs(edges).max()
    far, _ = KDTree(directed_edges(mesh, mesh.positions)).query(edges)
    # OBJ files have six digits.
    assert far.max() <= 3e-5 * size


def test_every_file_is_read_or_refused_with_one_line():
    n_read, refused = 0, []
    for file in sorted(DATA.glob("*.fbx")):
        try:
            read_mesh(file)
            n_read += 1
        except TexbakeError as error:
            assert "\n" not in str(error)
            refused.append(str(error).split(": ", 1)[1])
    # Those without a mesh: cameras, lights, bones, curves, NURBS, animations alone.
    assert (n_read, len(refused)) == (358, 63)
    whys = {re.sub(r", but \d[\w ,]*", "", why) for why in refused}
    assert whys == {
        "it has no faces; a mesh needs at least one triangle",
        "it shows no faces; its meshes are hidden or empty; a mesh needs at least one triangle",
    }
    assert sum("NURBS surface" in why for why in refused) == 7


def test_up_axes_agree():
    """The same scene, exported Y up and Z up."""
    meshes = [read_mesh(DATA / f"blender_340_{axis}_up_7400_binary.fbx") for axis in "yz"]
    np.testing.assert_allclose(meshes[0].positions, meshes[1].positions, atol=1e-5)
