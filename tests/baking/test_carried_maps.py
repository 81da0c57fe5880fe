"""A model's own maps, baked onto the model itself, come back."""

import numpy as np
import pytest

from texbake import BakeOptions, OptionError, bake, read_image, read_mesh, write_image, write_mesh
from texbake.jobs.maps import BakeFiles, bake_files
from texbake.mesh.materials import (
    CHANNELS,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    read_materials,
)
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.texture.encoding import decode_normals, encode_normals

N = 128


def smooth_noise(rng, n, channels):
    """Noise from 0 to 1 that repeats, with features of about eight texels."""
    spectrum = np.fft.fft2(rng.random((n, n, channels)), axes=(0, 1))
    frequency = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.fftfreq(n)[None, :])
    noise = np.fft.ifft2(spectrum * (frequency < 0.1)[..., None], axes=(0, 1)).real
    least, most = noise.min(axis=(0, 1)), noise.max(axis=(0, 1))
    return ((noise - least) / (most - least)).astype(np.float32)


def image_of(folder, name, pixels, *, is_color, **changes):
    write_image(pixels, folder / name, color=is_color, bits=8)
    return ChannelImage((folder / name).read_bytes(), name, **changes)


def material_of(mesh, **sources):
    channels = {name.replace("_", "-"): source for name, source in sources.items()}
    return Materials(
        face_materials=np.zeros(mesh.n_faces, np.int32),
        materials=(MeshMaterial(name="a", channels=channels),),
    )


def baked(mesh, materials, *maps, low=None, **changes):
    options = BakeOptions(maps=maps, size=N, padding=0, **changes)
    return bake(mesh, low or mesh, options, materials=materials)


def bent_normals(rng, n):
    """Unit normals that lean by up to 40 degrees, with an 8-bit image of them."""
    slopes = 1.6 * smooth_noise(rng, n, 2) - 0.8
    normals = np.dstack([slopes, np.ones((n, n), np.float32)])
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


def angles_deg(a, b):
    a, b = a.astype(np.float64), b.astype(np.float64)
    return np.degrees(2.0 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2.0, 0.0, 1.0)))


@pytest.mark.parametrize("mesh", [plane(4, 4), uv_sphere(24, 48)], ids=["plane", "sphere"])
def test_a_normal_map_baked_onto_its_own_mesh_comes_back(tmp_path, mesh):
    normals = bent_normals(np.random.default_rng(1), N)
    codes = encode_normals(normals.astype(np.float32), bits=8, convention="opengl")
    image = image_of(tmp_path, "n.png", codes, is_color=False)
    materials = material_of(mesh, normal=ChannelSource((1.0, 1.0, 1.0), image))
    result = baked(mesh, materials, "normal")
    off = angles_deg(result.maps["normal"].values, decode_normals(codes))[result.has_data]
    # Half a level of 8 bits is 0.2 degrees; texels at the poles reach beyond the mesh's triangles.
    assert np.percentile(off, 99) < 0.5
    flat = baked(mesh, materials, "normal", high_normal_maps=False).maps["normal"].values
    # Without it the normals are those of the mesh, which is the low-poly mesh too.
    assert np.percentile(angles_deg(flat, np.array([0.0, 0.0, 1.0]))[result.has_data], 99) < 1e-2


def test_the_scale_of_a_normal_map_flattens_it(tmp_path):
    mesh = plane(4, 4)
    normals = bent_normals(np.random.default_rng(2), N).astype(np.float32)
    codes = encode_normals(normals, bits=8, convention="opengl")
    image = image_of(tmp_path, "n.png", codes, is_color=False)
    materials = material_of(mesh, normal=ChannelSource((0.5, 0.5, 1.0), image))
    values = baked(mesh, materials, "normal").maps["normal"].values
    expected = codes / 255.0 * 2.0 - 1.0
    expected = expected * [0.5, 0.5, 1.0]
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    assert angles_deg(values, expected).max() < 0.1


def test_a_turned_normal_map_leans_as_its_image_does(tmp_path):
    """An image turned by a quarter: its u runs along v of the mesh, and so do its normals."""
    mesh = plane(4, 4)
    codes = np.full((8, 8, 3), (200, 128, 220), np.uint8)
    turned = ((0.0, 1.0, 0.0), (-1.0, 0.0, 1.0))
    image = image_of(tmp_path, "n.png", codes, is_color=False, placing=turned)
    materials = material_of(mesh, normal=ChannelSource((1.0, 1.0, 1.0), image))
    x, y, _ = baked(mesh, materials, "normal").maps["normal"].values[N // 2, N // 2]
    assert y > 0.5
    assert abs(x) < 0.01


def test_every_channel_comes_back_within_a_level(tmp_path):
    mesh = uv_sphere(24, 48)
    rng = np.random.default_rng(3)
    sources, codes = {}, {}
    for name, channel in CHANNELS.items():
        if name == "normal":
            continue
        width = len(channel.default)
        pixels = np.rint(255.0 * smooth_noise(rng, N, 3)).astype(np.uint8)
        codes[name] = pixels[:, :, :width]
        image = image_of(
            tmp_path, f"{name}.png", pixels, is_color=channel.is_color,
            components=tuple(range(width)),
        )  # fmt: skip
        sources[name.replace("-", "_")] = ChannelSource((1.0,) * width, image)
    result = baked(mesh, material_of(mesh, **sources), *codes)
    for name, expected in codes.items():
        path = tmp_path / f"{name}_baked.png"
        result.maps[name].write(path)
        stored = np.rint(255.0 * read_image(path, color=False).pixels)
        off = np.abs(stored.reshape(expected.shape) - expected)[result.has_data]
        assert off.max() <= 1.0, name


def test_occlusion_of_less_strength_is_nearer_to_one(tmp_path):
    mesh = plane(4, 4)
    image = image_of(
        tmp_path, "o.png", np.full((4, 4, 3), 102, np.uint8), is_color=False, components=(0,)
    )
    materials = material_of(mesh, occlusion=ChannelSource((0.25,), image, 0.75))
    assert baked(mesh, materials, "occlusion").maps["occlusion"].values == pytest.approx(
        0.25 * 0.4 + 0.75
    )


def test_wrapping_may_differ_along_u_and_v(tmp_path):
    """White at the right edge and at the top: clamped along u, mirrored along v."""
    pixels = np.zeros((4, 4, 3), np.uint8)
    pixels[:, 3, 0] = 255
    pixels[0, :, 1] = 255
    image = image_of(
        tmp_path, "w.png", pixels, is_color=True, wraps=("clamp", "mirror"),
        placing=((2.0, 0.0, 0.0), (0.0, 2.0, 0.0)), is_nearest=True,
    )  # fmt: skip
    mesh = plane(4, 4)
    color = ChannelSource((1.0, 1.0, 1.0), image)
    values = baked(mesh, material_of(mesh, base_color=color), "base-color")
    red, green, _ = np.moveaxis(values.maps["base-color"].values, 2, 0)
    column, row = red[N // 2], green[::-1, N // 8]  # up
    assert (column[: N * 3 // 8] == 0.0).all() and (column[N * 3 // 8 + 1 :] == 1.0).all()
    lit = np.zeros(N, bool)
    lit[N * 3 // 8 : N * 5 // 8] = True  # the top row, and its mirror image
    np.testing.assert_array_equal(row, lit)


def test_colors_of_vertices_are_factors_of_a_gltf_base_color(tmp_path):
    colors = np.random.default_rng(7).random((8, 4))
    write_mesh(cube().replace(colors=colors), tmp_path / "a.glb")
    path = tmp_path / "a.glb"
    mesh = read_mesh(path)
    materials = read_materials(path, mesh)
    assert materials.has_vertex_colors
    low = plane(1, 1)
    values = bake(
        mesh,
        low.replace(positions=(low.positions - 0.5) * 0.9 + [0, 0, 0.5]),
        BakeOptions(maps=("base-color", "vertex-color", "roughness"), size=16, front=1.0, back=1.0),
        materials=materials,
    ).maps
    assert np.ptp(values["base-color"].values) > 0.3
    np.testing.assert_allclose(
        values["base-color"].values, values["vertex-color"].values, atol=1e-6
    )
    assert np.ptp(values["roughness"].values) == 0.0


@pytest.mark.parametrize(("channel", "is_color"), [("roughness", False), ("emissive", True)])
def test_an_image_that_the_file_does_not_name_is_baked_for_any_channel(tmp_path, channel, is_color):
    codes = np.random.default_rng(3).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    if not is_color:
        codes[:] = codes[:, :, :1]
    write_image(codes, tmp_path / "a.png")
    write_mesh(plane(), tmp_path / "a.obj")
    done = bake_files(
        tmp_path / "a.obj", tmp_path / "a.obj", {channel: tmp_path / "b.png"},
        BakeOptions(size=16, padding=0, bits=8), files=BakeFiles(high_texture=tmp_path / "a.png"),
    )  # fmt: skip
    assert done.files == (tmp_path / "b.png",)
    found = read_image(tmp_path / "b.png", color=False)
    assert found.pixels.shape[2] == (3 if is_color else 1)
    expected = codes if is_color else codes[:, :, :1]
    np.testing.assert_allclose(255.0 * found.pixels, expected, atol=0.51)


def test_one_image_is_for_one_channel(tmp_path):
    write_image(np.zeros((2, 2, 3), np.uint8), tmp_path / "a.png")
    write_mesh(plane(), tmp_path / "a.obj")
    files = {name: tmp_path / f"{name}.png" for name in ("normal", "base-color", "roughness")}
    with pytest.raises(OptionError, match="is the image of one map, and base-color, rough"):
        bake_files(
            tmp_path / "a.obj", tmp_path / "a.obj", files,
            files=BakeFiles(high_texture=tmp_path / "a.png"),
        )  # fmt: skip
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.obj", "a.png"]
