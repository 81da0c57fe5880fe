"""Every stage on every image of the catalog."""

import numpy as np
import pytest

import texbake
from texbake.rendering.scene.textures import WRAPS
from texbake.texture.cube_files import (
    cross_picture,
    cube_of_cross,
    face_files,
    in_convention,
    read_faces,
)
from texbake.texture.cube_map import CubeMap, from_latitude_longitude, to_latitude_longitude
from texbake.texture.encoding import (
    decode_heights,
    decode_normals,
    encode_heights,
    encode_normals,
    height_range,
    quantize_unsigned,
)
from texbake.texture.mipmaps import mip_chain
from texbake.texture.options import CONVENTIONS, PackOptions
from texbake.texture.pack import pack_textures
from texbake.texture.padding import push_pull
from texbake.texture.sample import sample_texture

# Coordinates at the ends of the range of floats.
PLACES = np.array(
    [0.0, 1.0, -1e-20, 1.0 - 2**-53, 0.5, 1e9, -1e9, 1e300, np.nan, np.inf, -np.inf, 1e-320]
)
UVS = np.stack(np.meshgrid(PLACES, PLACES), axis=-1).reshape(-1, 2)
CHANGES = np.array([0.0, 1e-3, 1.0, 1e30, np.inf, np.nan, 1e-30, -0.5], np.float32)


def decoded(normals):
    lengths = np.linalg.norm(normals.astype(np.float64), axis=-1)
    assert np.abs(lengths - 1.0).max() < 2e-7
    return normals


@pytest.mark.pairwise(wrap=WRAPS, kind=("color", "data", "normal"), mip_filter=("box", "kaiser"))
def test_mip_levels_go_down_to_one_texel(image_case, kind, mip_filter, wrap):
    image = image_case.make()
    chain = mip_chain(image, kind=kind, wrap=wrap, filter=mip_filter)
    assert chain.sizes[0].tolist() == list(image.shape[:2])
    assert chain.sizes[-1].tolist() == [1, 1]
    if kind == "normal":
        return
    if "constant" in image_case.traits:
        assert (chain.texels == image[0, 0]).all()
    if "finite" in image_case.traits:
        assert np.isfinite(chain.texels).all()
    if "color" in image_case.traits and mip_filter == "box":
        last = chain.level(len(chain.sizes) - 1)
        np.testing.assert_allclose(last[0, 0], image.mean(axis=(0, 1), dtype=np.float64), rtol=1e-5)


@pytest.mark.pairwise(
    image_filter=("nearest", "bilinear", "bicubic", "trilinear", "ewa", "supersampled"), wrap=WRAPS
)
def test_lookups_read_nothing_outside_the_image(image_case, image_filter, wrap):
    image = image_case.make()
    changes = np.resize(CHANGES, (len(UVS), 4))
    if image_filter == "supersampled":
        changes = np.nan_to_num(changes, posinf=1.0)
    chain = mip_chain(image)
    values = sample_texture(chain, UVS, changes, filter=image_filter, wrap=wrap, border=0.25)
    if "finite" not in image_case.traits:
        return
    assert np.isfinite(values).all()
    if "constant" in image_case.traits and wrap != "border":
        assert (values == image[0, 0]).all()
    if image_filter in ("nearest", "bilinear"):
        low, high = min(image.min(), 0.25), max(image.max(), 0.25)
        assert values.min() >= low and values.max() <= high


@pytest.mark.pairwise(derivative=("central", "sobel", "scharr"), wrap=("repeat", "clamp"))
def test_normals_of_heights_are_unit(image_case, wrap, derivative):
    heights = image_case.make()[..., 0]
    options = texbake.HeightToNormalOptions(scale=1.0, wrap=wrap, derivative=derivative)
    normals = decoded(texbake.height_to_normal(heights, options))
    if "constant" in image_case.traits:
        np.testing.assert_array_equal(normals, np.broadcast_to([0, 0, 1], normals.shape))
    # Heights turned by a quarter: so are the normals.
    if heights.shape[0] == heights.shape[1] and "finite" in image_case.traits:
        turned = texbake.height_to_normal(np.rot90(heights), options)
        expected = np.rot90(normals)[..., [1, 0, 2]] * np.float32([-1.0, 1.0, 1.0])
        np.testing.assert_allclose(turned, expected, atol=1e-6)


@pytest.mark.pairwise(method=("frankot-chellappa", "poisson"), wrap=("repeat", "clamp"))
def test_heights_of_normals_are_finite_and_of_mean_0(image_case, method, wrap):
    field = texbake.normal_to_height(
        image_case.make(), texbake.NormalToHeightOptions(method=method, wrap=wrap)
    )
    assert np.isfinite(field.heights).all()
    assert abs(field.heights.mean(dtype=np.float64)) <= 1e-6 * max(1.0, np.abs(field.heights).max())


def fitted(heights, wrap):
    """Heights whose steps fit the means of central differences best, by plain least squares."""
    height, width = heights.shape
    places = np.arange(heights.size).reshape(height, width)
    rows, steps = [], []
    for axis in (0, 1):
        n = heights.shape[axis]
        if n == 1:
            continue
        field, ids = np.moveaxis(heights, axis, 0), np.moveaxis(places, axis, 0)
        slopes = (np.roll(field, -1, axis=0) - np.roll(field, 1, axis=0)) / 2
        if wrap == "clamp":  # a parabola through the last three
            slopes[0] = (-3 * field[0] + 4 * field[1] - field[2]) / 2
            slopes[-1] = (3 * field[-1] - 4 * field[-2] + field[-3]) / 2
        last = n if wrap == "repeat" else n - 1
        for i in range(last):
            j = (i + 1) % n
            steps.append((slopes[i] + slopes[j]).ravel() / 2)
            row = np.zeros((ids[i].size, heights.size))
            row[np.arange(len(row)), ids[i].ravel()] -= 1.0
            row[np.arange(len(row)), ids[j].ravel()] += 1.0
            rows.append(row)
    if not rows:
        return np.zeros(heights.shape)
    found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(steps), rcond=None)[0]
    return (found - found.mean()).reshape(heights.shape)


@pytest.mark.parametrize("wrap", ["repeat", "clamp"])
def test_heights_to_normals_and_back(color_case, wrap):
    heights = color_case.make()[..., 0].astype(np.float64)
    width = float(heights.shape[1])
    normals = texbake.height_to_normal(
        heights,
        texbake.HeightToNormalOptions(scale=0.1, width=width, wrap=wrap, derivative="central"),
    )
    back = texbake.normal_to_height(
        normals, texbake.NormalToHeightOptions(method="poisson", wrap=wrap, width=width)
    )
    # Noise from texel to texel is what central differences cannot see, and what they can comes back
    # blurred. Normals are float32, and rounding of a slope adds up over the texels of a side.
    rounding = 2.0**-23 * max(heights.shape)
    np.testing.assert_allclose(back.heights, fitted(0.1 * heights, wrap), rtol=0.0, atol=rounding)


@pytest.mark.parametrize("bits", [8, 16])
def test_codes_of_heights_come_back_to_half_a_step_and_never_wrap_around(image_case, bits):
    heights = image_case.make()[..., 0]
    covered = np.ones(heights.shape, bool)
    mid, scale = height_range(heights, covered, bits=bits)
    codes = encode_heights(heights, bits=bits, mid=mid, scale=scale)
    back = decode_heights(codes, mid=mid, scale=scale)
    assert np.isfinite(back).all()
    finite = np.isfinite(heights)
    step = scale / ((1 << bits) - 1)
    off = np.abs(back[finite].astype(np.float64) - heights[finite])
    # Half a step, and float32 rounding of what is decoded (a subnormal has one bit).
    assert (off <= step / 2 * (1 + 1e-4) + np.abs(heights[finite]) * 2.0**-23 + 1e-44).all()
    image = image_case.make()
    codes = quantize_unsigned(image, bits)
    top = (1 << bits) - 1
    expected = np.floor(np.clip(np.nan_to_num(image.astype(np.float64)), 0, 1) * top + 0.5)
    np.testing.assert_array_equal(codes, expected)


@pytest.mark.pairwise(bits=(8, 16, 32), convention=("opengl", "directx"))
def test_codes_of_normals_come_back(image_case, bits, convention):
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        image = image_case.make().astype(np.float64)
        normals = image / np.linalg.norm(image, axis=2, keepdims=True)
    normals[~np.isfinite(normals).all(axis=2)] = (0.0, 0.0, 1.0)
    codes = encode_normals(normals.astype(np.float32), bits=bits, convention=convention)
    back = decoded(decode_normals(codes, convention=convention))
    cosines = np.clip(np.einsum("ijk,ijk->ij", back.astype(np.float64), normals), -1.0, 1.0)
    # The largest angle that rounding three codes can make: half a step along each axis.
    limit = {8: 0.39, 16: 0.0016, 32: 1e-4}[bits]
    sines = np.linalg.norm(np.cross(back, normals), axis=2)
    assert np.degrees(np.arctan2(sines, cosines)).max() < limit


@pytest.mark.parametrize(
    ("suffix", "bits"), [("png", 8), ("png", 16), ("exr", 32), ("tif", 16), ("tif", 32), ("tga", 8)]
)
def test_files_come_back(image_case, suffix, bits, tmp_path):
    image = image_case.make()
    path = tmp_path / f"image.{suffix}"
    texbake.write_image(image, path, bits=bits)
    back = texbake.read_image(path, color=False).pixels
    if bits == 32:
        np.testing.assert_array_equal(back, image)
        return
    top = (1 << bits) - 1
    expected = np.floor(np.clip(np.nan_to_num(image.astype(np.float64)), 0, 1) * top + 0.5)
    np.testing.assert_array_equal(np.rint(back * top), expected)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_padding_keeps_owned_texels_and_invents_none(image_case, share):
    image = image_case.make()
    height, width = image.shape[:2]
    owned = np.random.default_rng(3).random((height, width)) < share
    if "background" in image_case.traits:
        owned[:] = False
    filled = push_pull(image, owned)
    np.testing.assert_array_equal(filled[owned], image[owned])
    usable = image[owned][np.isfinite(image[owned]).all(axis=1)]
    if not len(usable):
        return
    added = filled[~owned]
    assert np.isfinite(added).all()
    slack = 1e-6 * np.abs(usable).max()
    assert (added >= usable.min() - slack).all() and (added <= usable.max() + slack).all()


def test_images_are_packed_as_they_are(image_case):
    image = image_case.make()
    packed = pack_textures([image, image[::-1]], PackOptions(padding=1))
    assert packed.pixels.shape[2] == 3


@pytest.mark.pairwise(convention=CONVENTIONS, layout=("cross", "faces"))
def test_cube_files_come_back_bit_for_bit(image_case, layout, convention, tmp_path):
    """Six different squares of the image's values, through float files of either form."""
    image = image_case.make()
    cube = CubeMap(np.stack([np.resize(np.roll(image, i, axis=0), (4, 4, 3)) for i in range(6)]))
    if layout == "cross":
        path = tmp_path / "cube.exr"
        texbake.write_image(cross_picture(cube, convention=convention), path, bits=32)
        pixels = texbake.read_image(path, color=False).pixels
        back = cube_of_cross(pixels, convention=convention)
    else:
        for path, face in zip(
            face_files(tmp_path, ".exr"), in_convention(cube.faces, convention), strict=True
        ):
            texbake.write_image(np.ascontiguousarray(face), path, bits=32)
        back, _ = read_faces(tmp_path, convention=convention, color=False)
    np.testing.assert_array_equal(back.faces, cube.faces)


def test_cube_maps_of_panoramas_are_finite(image_case):
    cube = from_latitude_longitude(image_case.make(), size=4)
    back = to_latitude_longitude(cube, height=8)
    assert np.isfinite(back).all()
    if "constant" in image_case.traits:
        np.testing.assert_allclose(
            back, np.broadcast_to(image_case.make()[0, 0], back.shape), rtol=1e-5
        )
