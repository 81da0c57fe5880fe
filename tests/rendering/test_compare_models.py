"""Two versions of a model, drawn from all around."""

import math
from pathlib import Path

import numpy as np
import pytest

from texbake.errors import OptionError, ReadWarning
from texbake.mesh.files import write_mesh
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, uv_sphere
from texbake.rendering.compare_models import compare_models, model_scene, sphere_views
from texbake.rendering.options import RenderOptions
from texbake.texture.png_files import png_parts

SMALL = RenderOptions(width=48, height=32)


def painted(color: tuple[float, float, float], path: Path, mesh: Mesh | None = None) -> Path:
    mesh = mesh or uv_sphere(12, 16)
    source = ChannelSource(color)
    channels = {"base-color": source, "roughness": ChannelSource((0.5,))}
    ids = np.zeros(mesh.n_faces, np.int32)
    materials = Materials(
        face_materials=ids, materials=(MeshMaterial(name="a", channels=channels),)
    )
    write_mesh(mesh, path, materials=materials)
    return path


def test_views_are_spread_evenly() -> None:
    angles = np.radians(sphere_views(12))
    azimuths, elevations = angles.T
    points = np.stack(
        [np.cos(elevations) * np.sin(azimuths), np.sin(elevations),
         np.cos(elevations) * np.cos(azimuths)], axis=1,
    )  # fmt: skip
    assert np.abs(points.mean(axis=0)).max() < 0.05
    between = np.degrees(np.arccos(np.clip(points @ points.T - 2 * np.eye(12), -1, 1)))
    # Vertices of an icosahedron, the best that there is for twelve, are 63.4 degrees apart.
    assert between.min() > 40.0


def test_a_model_is_like_itself(tmp_path: Path) -> None:
    model = painted((0.8, 0.2, 0.1), tmp_path / "a.glb")
    found = compare_models(model, model, options=SMALL)
    assert found.psnr_db == (math.inf,) * 12 and found.mean_db == found.worst_db == math.inf
    assert found.n_faces[0] == found.n_faces[1] == uv_sphere(12, 16).n_faces
    assert found.before[0].shape == (32, 48, 3)
    # The sphere is red in each view, and fills what it is framed for.
    for picture in found.before:
        reddish = picture[..., 0] > picture[..., 1].astype(int) + 40
        assert 0.2 < reddish.mean() < 0.6


def test_errors_are_those_of_the_pixels_that_either_model_touches(tmp_path: Path) -> None:
    models = [
        painted(color, tmp_path / f"{i}.glb")
        for i, color in enumerate([(0.5, 0.5, 0.5), (0.3, 0.5, 0.5)])
    ]
    options = RenderOptions(width=48, height=32, background=(0.0, 0.0, 0.0))
    found = compare_models(*models, n_views=3, options=options)
    assert len(found.views) == len(found.psnr_db) == 3
    total, count = 0, 0
    for before, after, error in zip(found.before, found.after, found.psnr_db, strict=True):
        seen = (before > 0).any(axis=2)
        apart = before[seen].astype(int) - after[seen]
        assert error == pytest.approx(10 * math.log10(255**2 / (apart**2).mean()))
        total, count = total + (apart**2).sum(), count + apart.size
    assert found.mean_db == pytest.approx(10 * math.log10(255**2 * count / total))
    assert found.worst_db == min(found.psnr_db) == found.psnr_db[found.worst_view]


def test_a_coarser_model_is_further_off(tmp_path: Path) -> None:
    fine = painted((0.5, 0.5, 0.5), tmp_path / "fine.glb", uv_sphere(48, 64))
    errors = []
    for n in 24, 6:
        coarse = painted((0.5, 0.5, 0.5), tmp_path / f"{n}.glb", uv_sphere(n, n))
        errors.append(compare_models(fine, coarse, n_views=4, options=SMALL).mean_db)
    assert 15 < errors[1] < errors[0] - 5


def test_other_formats_show_their_materials(tmp_path: Path) -> None:
    """An OBJ file with an image for its roughness, and its GLB, packed as glTF has it."""
    from texbake.verbs.transform import transform_file

    write_mesh(uv_sphere(8, 12), tmp_path / "a.obj")
    text = (tmp_path / "a.obj").read_text()
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\nusemtl a\n{text}")
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 0.9 0.6 0.1\nPm 1\nmap_Pr r.png\n")
    codes = np.linspace(30, 200, 16 * 16 * 3).astype(np.uint8).reshape(16, 16, 3)
    (tmp_path / "r.png").write_bytes(b"".join(png_parts(codes)))
    transform_file(tmp_path / "a.obj", tmp_path / "a.glb")
    found = compare_models(tmp_path / "a.obj", tmp_path / "a.glb", n_views=2, options=SMALL)
    assert found.worst_db == math.inf
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 0.9 0.6 0.1\nPm 1\nPr 1\n")
    found = compare_models(tmp_path / "a.obj", tmp_path / "a.glb", n_views=2, options=SMALL)
    assert found.worst_db < 40


def test_images_without_texture_coordinates_are_left_out(tmp_path: Path) -> None:
    mesh = cube().replace(uvs=None, uv_faces=None)
    write_mesh(mesh, tmp_path / "a.obj")
    text = (tmp_path / "a.obj").read_text()
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\nusemtl a\n{text}")
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd c.png\n")
    (tmp_path / "c.png").write_bytes(b"".join(png_parts(np.zeros((4, 4, 3), np.uint8))))
    assert len(model_scene(tmp_path / "a.obj").objects) == 1


def test_content_that_cannot_be_drawn_is_refused_or_named(tmp_path: Path) -> None:
    model = painted((0.5, 0.5, 0.5), tmp_path / "a.glb")
    with pytest.raises(OptionError, match="n_views"):
        compare_models(model, model, n_views=0)
    image = ChannelImage(data=b"\xabKTX 20\xbb\r\n\x1a\n")
    source = ChannelSource(CHANNELS["base-color"].default, image)
    mesh = uv_sphere(4, 6)
    materials = Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(MeshMaterial(name="a", channels={"base-color": source}),),
    )
    write_mesh(mesh, tmp_path / "k.glb", materials=materials)
    with pytest.warns(ReadWarning, match="no image in a supported format"):
        compare_models(model, tmp_path / "k.glb", n_views=1)
