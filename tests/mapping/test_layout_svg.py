import itertools
import re
import xml.etree.ElementTree as ET
from collections import Counter

import numpy as np
import pytest

from texbake.errors import UvError
from texbake.mapping.layout import LayoutWindow, draw_layout, heat_color
from texbake.mapping.layout_svg import layout_svg
from texbake.mapping.seams import border_edges, seam_edges
from texbake.mesh.shapes import cube, plane, uv_sphere

SVG = "{http://www.w3.org/2000/svg}"
UNITS = 32  # a pixel


def layers(document):
    root = ET.fromstring(document)
    return {layer.attrib["id"]: list(layer) for layer in root.iter(f"{SVG}g")}


def walks(path):
    """Points of each part of a path, in pixels; closed ones end where they begin."""
    parts = []
    for start, steps, end in re.findall(r"M([^lzM]*)l([^zM]*)(z?)", path.attrib["d"]):
        numbers = [np.array(re.findall(r"-?\d+", text), float) for text in (start, steps)]
        points = np.cumsum(np.concatenate([numbers[0][None], numbers[1].reshape(-1, 2)]), axis=0)
        parts.append((np.concatenate([points, points[:1]]) if end else points) / UNITS)
    return parts


def area(path):
    """Signed, y down, so that it is negative for loops that are counter-clockwise to the eye."""
    total = 0.0
    for x, y in (walk.T for walk in walks(path)):
        total += float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum()) / 2.0
    return total


def grid_with_a_hole():
    mesh = plane(4, 4)
    kept = np.ones(32, dtype=bool)
    kept[[12, 13, 20]] = False
    return mesh.replace(faces=mesh.faces[kept], uv_faces=mesh.faces[kept])


def test_a_chart_is_one_outline_with_its_holes():
    found = layers(layout_svg(grid_with_a_hole(), 256))
    (chart,) = found["charts"]
    assert (chart.attrib["id"], len(walks(chart))) == ("chart-0", 2)
    assert area(chart) == pytest.approx(-(256.0**2) * 29 / 32)


def sides_of_a_brick():
    """Six charts of different sizes, one of them mirrored, and two with a seam to each neighbor."""
    mesh = cube()
    corners = (
        np.tile(plane().corner_uvs(), (6, 1, 1)) * np.repeat(np.arange(8, 14), 2)[:, None, None]
    )
    corners = (
        corners / 50.0 + np.repeat([(i % 3, i // 3) for i in range(6)], 2, axis=0)[:, None] * 0.33
    )
    corners[4:6, :, 0] = 0.95 - corners[4:6, :, 0] + 0.6
    each = np.arange(36, dtype=np.int32).reshape(-1, 3)
    return mesh.replace(uvs=corners.reshape(-1, 2), uv_faces=each)


def edges_of(corners):
    """Edges between points in units of the document, whichever way they are walked."""
    points = np.rint(corners * UNITS).astype(int).tolist()
    return Counter(frozenset(map(tuple, (p[i], p[i - 1]))) for p in points for i in range(3))


@pytest.mark.parametrize("heat", [False, True])
def test_faces_have_the_colors_of_the_picture(heat):
    mesh = sides_of_a_brick()
    picture = draw_layout(mesh, 200, heat=heat)[:200] ** (1 / 2.2)
    found = layers(layout_svg(mesh, 200, heat=heat))
    y, x = np.mgrid[:200, :200] + 0.5
    shown, far = np.full((200, 200, 3), 0.96), np.ones((200, 200), dtype=bool)
    for path in found["charts"] + found.get("mirrored", []):
        turns = np.zeros_like(x)
        for (x0, y0), (x1, y1) in ((a, b) for w in walks(path) for a, b in itertools.pairwise(w)):
            side = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
            turns += ((y0 <= y) & (y < y1) & (side > 0)) * 1 - ((y1 <= y) & (y < y0) & (side < 0))
        color = [int(path.attrib["fill"][i : i + 2], 16) / 255 for i in (1, 3, 5)]
        shown[turns != 0] = color
    edges = LayoutWindow.around(mesh.corner_uvs(), 200).pixels(mesh.corner_uvs())
    for start, end in zip(edges.reshape(-1, 2), np.roll(edges, -1, 1).reshape(-1, 2), strict=True):
        way = end - start
        along = np.clip(((x - start[0]) * way[0] + (y - start[1]) * way[1]) / (way @ way), 0, 1)
        far &= np.hypot(x - start[0] - along * way[0], y - start[1] - along * way[1]) > 2.0
    assert 0.4 < far.mean() < 0.9
    np.testing.assert_allclose(picture[far], shown[far], atol=0.6 / 255)


@pytest.mark.parametrize("mesh", [grid_with_a_hole(), sides_of_a_brick()], ids=["hole", "brick"])
def test_each_edge_is_one_stroke_of_its_kind(mesh):
    found = layers(layout_svg(mesh, 256))
    pixels = LayoutWindow.around(mesh.corner_uvs(), 256).pixels(mesh.corner_uvs())
    ends = np.stack([pixels, np.roll(pixels, -1, axis=1)], axis=2)
    borders, seams = border_edges(mesh), seam_edges(mesh)
    kinds = {"edges": ~borders, "outlines": borders & ~seams, "seams": seams}
    for layer, chosen in kinds.items():
        expected = edges_of(np.concatenate([ends[chosen], ends[chosen][:, :1]], axis=1))
        expected = {edge for edge in expected if len(edge) == 2}
        drawn = Counter(
            frozenset(map(tuple, np.rint([a * UNITS, b * UNITS]).astype(int).tolist()))
            for path in found.get(layer, [])
            for walk in walks(path)
            for a, b in itertools.pairwise(walk)
        )
        assert set(drawn) == expected
        assert set(drawn.values()) <= {1}
    document = ET.fromstring(layout_svg(mesh, 256))
    looks = {g.attrib["id"]: g.attrib for g in document.iter(f"{SVG}g")}
    assert {name: looks[name]["stroke-opacity"] for name in kinds if name in looks} == {
        name: opacity
        for name, opacity in (("edges", "0.45"), ("outlines", "0.55"), ("seams", "0.85"))
        if name in looks
    }
    assert looks["edges"]["stroke-width"] == "22.4"  # 0.7 of 32 units


def test_edges_are_left_out_where_triangles_are_too_small_to_see_them():
    # Faces of side a have an opacity of 0.45 a / 12: below 0.03 where a is less than 0.8 pixels.
    assert "edges" in layers(layout_svg(plane(75, 75), 64))
    assert "edges" not in layers(layout_svg(plane(85, 85), 64))


def test_the_scale_lies_below_the_picture_with_its_figures_at_their_places():
    for size, left in ((960, 140), (200, 9)):  # without words where there is no room
        document = ET.fromstring(layout_svg(plane(2, 2), size, heat=True))
        letters = max(9, size // 48)
        assert document.attrib["height"] == str(size + 3 * letters)
        scale = layers(ET.tostring(document, encoding="unicode"))["scale"]
        (bar,) = (item for item in scale if item.tag == f"{SVG}rect")
        x, y, width, height = (int(bar.attrib[n]) / UNITS for n in ("x", "y", "width", "height"))
        assert (x, y, width, height) == (left, size + letters / 2, size - 2 * left, letters)
        texts = {item.text: float(item.attrib["x"]) / UNITS for item in scale if item.text}
        for label, share in (("0.5", 0.0), ("0.7", 0.25), ("1", 0.5), ("1.4", 0.75), ("2", 1.0)):
            assert texts[label] == pytest.approx(left + share * width, abs=0.5 / UNITS)
        assert ("compressed" in texts) == (size == 960)
        heights = [float(item.attrib["y"]) / UNITS for item in scale if item.text]
        assert size < min(heights) and max(heights) < size + 3 * letters
        stops = [stop.attrib["stop-color"] for item in scale for stop in item]
        assert [stops[i] for i in (0, 8, 16)] == [
            "#" + "".join(f"{round(255 * c):02x}" for c in heat_color(s)) for s in (0.5, 1.0, 2.0)
        ]


def test_a_surface_folded_in_the_texture_is_a_chart_and_red_where_it_lies_face_down():
    # Seen from above a closed surface has no border in the texture; its sides have no area there.
    mesh = cube()
    uvs = mesh.positions[:, :2] - mesh.bounds[0, :2]
    folded = mesh.replace(uvs=uvs / uvs.max() * 0.5, uv_faces=mesh.faces)
    found = layers(layout_svg(folded, 256))
    (chart,), (mirrored,) = found["charts"], found["mirrored"]
    assert area(chart) == pytest.approx(-(128.0**2))
    assert area(mirrored) == pytest.approx(128.0**2)
    assert mirrored.attrib["fill"] != chart.attrib["fill"]


def test_the_heat_of_a_mirrored_copy_is_that_of_its_original():
    mesh = plane()
    corners = np.concatenate([mesh.corner_uvs(), mesh.corner_uvs()[:, ::-1]])
    both = mesh.replace(
        faces=np.concatenate([mesh.faces, mesh.faces[:, ::-1]]),
        uvs=corners.reshape(-1, 2),
        uv_faces=np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
    )
    whole, alone = (draw_layout(each, 64, heat=True)[:60] for each in (both, mesh))
    assert np.allclose(whole[20:24, 36:40], alone[20:24, 36:40])
    found = layers(layout_svg(both, 64, heat=True))
    assert "mirrored" not in found
    assert sorted(map(area, found["charts"])) == pytest.approx([-(64.0**2), 64.0**2])


def test_tiles_are_named():
    mesh = plane()
    document = layout_svg(mesh.replace(uvs=mesh.uvs + np.array([1.0, 1.0])), 512)
    found = layers(document)
    texts = [text.text for text in found["tiles"] if text.tag == f"{SVG}text"]
    assert texts == ["1001", "1002", "1011", "1012"]
    boxes = [item.attrib for item in found["tiles"] if item.tag == f"{SVG}rect"]
    sides = [[int(box[name]) // 8192 for name in ("x", "y", "width", "height")] for box in boxes]
    assert sides == [[0, 1, 1, 1], [1, 1, 1, 1], [0, 0, 1, 1], [1, 0, 1, 1]]
    words = [text.attrib for text in found["tiles"] if text.tag == f"{SVG}text"]
    corners = [[int(word[name]) / 8192 for name in ("x", "y")] for word in words]
    assert [[int(place) for place in corner] for corner in corners] == [s[:2] for s in sides]
    assert np.min(np.array(corners) % 1.0) > 0.0
    (chart,) = found["charts"]
    corners = walks(chart)[0]
    assert (corners.min(axis=0).tolist(), corners.max(axis=0).tolist()) == ([256, 0], [512, 256])


def test_a_hundred_thousand_triangles_take_few_megabytes():
    mesh = uv_sphere(224, 224)
    assert mesh.n_faces > 99_000
    for heat in False, True:
        assert len(layout_svg(mesh, 2048, heat=heat)) < 2_500_000


def test_coordinates_as_large_as_a_float32_end_in_a_document():
    mesh = plane()
    found = layers(layout_svg(mesh.replace(uvs=mesh.uvs * 1e38), 64))
    assert "tiles" not in found
    assert area(found["charts"][0]) == pytest.approx(-(64.0**2))


def test_names_cannot_break_the_document():
    name = "<a & 'b'>\x00\udcff.obj"
    root = ET.fromstring(layout_svg(plane().replace(name=name)).encode())
    title = root.find(f"{SVG}title")
    assert title.text == "<a & 'b'>.obj"


def test_without_area_or_coordinates():
    blank = plane().replace(uvs=np.zeros((1, 2)), uv_faces=np.zeros((2, 3), dtype=np.int32))
    assert ET.fromstring(layout_svg(blank)).tag == f"{SVG}svg"
    with pytest.raises(UvError, match="no texture coordinates"):
        layout_svg(cube())
