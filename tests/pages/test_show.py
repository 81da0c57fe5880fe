"""What a notebook shows of meshes, maps and images."""

import io

import numpy as np
import pytest
from PIL import Image

import texbake
from texbake.errors import OptionError, UvError
from texbake.mesh.shapes import grid_sphere, uv_sphere
from texbake.texture.image import Image as TexbakeImage, write_image
from texbake.texture.png_files import picture_png

READY = "document.querySelector('#view').dataset.state === 'ready'"
MAPS_READY = "document.querySelector('#maps').dataset.state === 'ready'"
DARK = [0x26, 0x29, 0x2D]


def drawn(picture):
    """Share of a picture that is not the background of the view."""
    return (np.abs(picture.astype(int) - DARK) > 12).any(axis=2).mean()


def test_a_mesh_with_maps_is_drawn_with_and_without_them(browser, pair, baked, tmp_path):
    texbake.show(pair[1], baked).write(tmp_path / "page.html")
    browser.open(tmp_path / "page.html")
    browser.wait(f"{READY} && {MAPS_READY}")
    with_maps = browser.picture_with("#view canvas", lambda picture: 0.08 < drawn(picture) < 0.9)
    browser.set("[name=right][value=low]", True)
    bare = browser.picture("#view canvas")
    assert (np.abs(with_maps.astype(int) - bare) > 12).any(axis=2).mean() > 0.01
    assert browser.value(
        "[...document.querySelectorAll('.tabs span')].map(e => e.textContent)"
    ) == ["normal", "displacement"]
    assert browser.complaints() == []


@pytest.mark.parametrize("has_uvs", [False, True])
def test_a_mesh_alone_is_drawn_with_a_checker_if_it_has_uvs(browser, tmp_path, has_uvs):
    mesh = uv_sphere(12, 12) if has_uvs else grid_sphere(12, 12, lambda t, p: 1.0 + 0.0 * t)
    texbake.show(mesh, up="z").write(tmp_path / "page.html")
    browser.open(tmp_path / "page.html")
    browser.wait(READY)
    browser.picture_with("#view canvas", lambda picture: 0.08 < drawn(picture) < 0.9)
    assert browser.value("document.querySelector('#maps') !== null") is has_uvs
    assert browser.value("document.querySelector('[name=up]').value") == "z"
    assert browser.complaints() == []


def test_a_cell_of_a_notebook_draws_the_mesh(browser, pair, tmp_path):
    cell = pair[1].replace(name="<b>")._repr_html_()
    (tmp_path / "cell.html").write_text(f"<!DOCTYPE html><meta charset=utf-8>{cell}")
    browser.open(tmp_path / "cell.html")

    def shows_the_mesh(picture):
        below, middle = 400, picture.shape[1] // 2
        is_mesh = np.abs(picture[below].astype(int) - DARK).max(axis=1) > 12
        return is_mesh[middle] and not is_mesh[middle // 4]

    browser.picture_with("iframe", shows_the_mesh)
    assert browser.complaints() == []


def test_maps_need_texture_coordinates(pair, baked):
    with pytest.raises(UvError, match="texture coordinates"):
        texbake.show(pair[0].replace(uvs=None, uv_faces=None), baked)


def test_maps_by_name_are_those_of_a_bake_or_files(pair, baked, tmp_path):
    baked.maps["displacement"].write(tmp_path / "heights.png")
    maps = {"normal": baked.maps["normal"], "displacement": tmp_path / "heights.png"}
    html = texbake.show(pair[1], maps).html
    assert "normal map" in html and "displacement map" in html
    for wrong in "normal.png", 3, baked.maps["normal"]:
        with pytest.raises(OptionError, match="what `bake` returned"):
            texbake.show(pair[1], wrong)


def test_printing_takes_one_line(pair, baked):
    for value in (*pair, baked, baked.maps["normal"], texbake.show(pair[1])):
        assert "\n" not in repr(value) and len(repr(value)) < 120
    assert repr(pair[1]).startswith("<Mesh low.obj: 264 faces, 134 vertices, ")
    assert (
        repr(baked) == f"<BakeResult normal, displacement: 96 x 96, {baked.missed.sum():,} missed>"
    )


def test_maps_and_images_are_arrays_and_pictures(baked):
    for baked_map in baked.maps.values():
        assert np.asarray(baked_map) is baked_map.values
        assert np.array(baked_map, np.float64).dtype == np.float64
        with Image.open(io.BytesIO(baked_map._repr_png_())) as picture:
            assert picture.size == (96, 96)
    image = TexbakeImage(np.full((4, 6, 3), 0.5, np.float32), bits=8, is_float=False, is_color=True)
    assert np.asarray(image).shape == (4, 6, 3)
    with Image.open(io.BytesIO(image._repr_png_())) as picture:
        assert picture.getpixel((0, 0)) == (188, 188, 188)
    assert repr(image) == "<Image image: 6 x 4, 3 channels, 8-bit codes>"
    assert baked._repr_html_().count("<img") == 2


def test_large_pictures_become_means_of_blocks_and_ids_do_not():
    codes = np.random.default_rng(0).integers(0, 256, (1500, 2100, 3), np.uint8)
    blocks = codes.reshape(500, 3, 700, 3, 3)
    for is_averaged, expected in (
        (True, blocks.astype(float).mean(axis=(1, 3)).astype(np.uint8)),
        (False, blocks[:, 0, :, 0]),
    ):
        png = picture_png(codes, is_color=False, is_averaged=is_averaged)
        with Image.open(io.BytesIO(png)) as picture:
            assert np.array_equal(np.asarray(picture), expected)
    thin = picture_png(np.zeros((5000, 1, 1), np.float32), is_color=False)
    with Image.open(io.BytesIO(thin)) as picture:
        assert picture.size == (1, 1000)


def test_arrays_are_maps(pair, baked, tmp_path):
    baked.maps["normal"].write(tmp_path / "normal.png", bits=8)
    with Image.open(tmp_path / "normal.png") as picture:
        normal = np.asarray(picture)
    page = texbake.show(pair[1], {"normal": normal, "color": np.full((8, 8, 3), 0.2)})
    assert "normal map" in page.html and "color map" in page.html
    with pytest.raises(OptionError, match=r"maps: normal: the shape \(\) is no image"):
        texbake.show(pair[1], {"normal": 3})
    with pytest.raises(OptionError, match=r"maps: color: it is not an array of numbers"):
        texbake.show(pair[1], {"color": [[1, 2], [3]]})


def test_heights_of_an_array_are_scaled_as_those_of_a_file(pair, tmp_path):
    heights = np.linspace(-3.0, 5.0, 64, dtype=np.float32).reshape(8, 8)
    write_image(heights, tmp_path / "heights.exr", color=False)
    of_array, of_file = (
        texbake.show(pair[1], {"displacement": item}).html
        for item in (heights, tmp_path / "heights.exr")
    )
    assert of_array == of_file
