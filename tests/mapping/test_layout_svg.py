import re
import xml.etree.ElementTree as ET
from collections import Counter

import numpy as np
import pytest

from texbake.errors import UvError
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.layout_svg import layout_svg
from texbake.mapping.seams import border_edges
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, plane, uv_sphere

SVG = "{http://www.w3.org/2000/svg}"
UNITS = 32  # a pixel


def layers(document: str) -> dict[str, list[ET.Element]]:
    root = ET.fromstring(document)
    return {layer.attrib["id"]: list(layer) for layer in root.iter(f"{SVG}g")}


def walks(path: ET.Element) -> list[np.ndarray]:
    """Points of each part of a path, in pixels; closed ones end where they begin."""
    parts = []
    for start, steps, end in re.findall(r"M([^lzM]*)l([^zM]*)(z?)", path.attrib["d"]):
        numbers = [np.array(re.findall(r"-?\d+", text), float) for text in (start, steps)]
        points = np.cumsum(np.concatenate([numbers[0][None], numbers[1].reshape(-1, 2)]), axis=0)
        parts.append((np.concatenate([points, points[:1]]) if end else points) / UNITS)
    return parts


def area(path: ET.Element) -> float:
    """Signed, y down, so that it is negative for loops that are counter-clockwise to the eye."""
    total = 0.0
    for x, y in (walk.T for walk in walks(path)):
        total += float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum()) / 2.0
    return total


def grid_with_a_hole() -> Mesh:
    mesh = plane(4, 4)
    kept = np.ones(32, dtype=bool)
    kept[[12, 13, 20]] = False
    return mesh.replace(faces=mesh.faces[kept], uv_faces=mesh.faces[kept])


def test_a_chart_is_one_outline_with_its_holes() -> None:
    found = layers(layout_svg(grid_with_a_hole(), 256))
    (chart,) = found["charts"]
    assert chart.attrib["id"] == "chart-0"
    assert len(walks(chart)) == 2
    assert area(chart) == pytest.approx(-(256.0**2) * 29 / 32)


def test_each_inner_edge_is_drawn_once_and_outlines_too() -> None:
    mesh = grid_with_a_hole()
    found = layers(layout_svg(mesh, 256))
    n_borders = int(border_edges(mesh).sum())
    counts = {"outlines": n_borders, "edges": (3 * 29 - n_borders) // 2}
    for layer, n_edges in counts.items():
        (path,) = found[layer]
        drawn = Counter(
            frozenset((tuple(a), tuple(b)))
            for walk in walks(path)
            for a, b in zip(walk[:-1].tolist(), walk[1:].tolist(), strict=True)
        )
        assert len(drawn) == n_edges
        assert set(drawn.values()) == {1}
    assert "seams" not in found


def test_a_surface_folded_in_the_texture_is_a_chart_and_red_where_it_lies_face_down() -> None:
    # Seen from above a closed surface has no border in the texture; its sides have no area there.
    mesh = cube()
    uvs = mesh.positions[:, :2] - mesh.bounds[0, :2]
    folded = mesh.replace(uvs=uvs / uvs.max() * 0.5, uv_faces=mesh.faces)
    found = layers(layout_svg(folded, 256))
    (chart,), (mirrored,) = found["charts"], found["mirrored"]
    assert area(chart) == pytest.approx(-(128.0**2))
    assert area(mirrored) == pytest.approx(128.0**2)
    assert mirrored.attrib["fill"] != chart.attrib["fill"]


def test_colors_of_a_heat_map_share_all_of_the_area() -> None:
    mesh = uv_sphere(24, 48)
    assert mesh.uvs is not None
    found = layers(layout_svg(mesh, 512, heat=True))
    # 1 %: points are rounded to 1/32 pixel, on triangles of about 10.
    expected = -(512.0**2) * np.abs(signed_areas(mesh.corner_uvs())).sum()
    assert sum(area(path) for path in found["charts"]) == pytest.approx(expected, rel=0.01)
    colors = [path.attrib["fill"] for path in found["charts"]]
    assert 8 < len(set(colors)) == len(colors) < 132
    labels = [text.text for text in found["scale"] if text.tag == f"{SVG}text"]
    assert {"0.5", "1", "2", "compressed", "stretched"} <= set(labels)


def test_tiles_are_named() -> None:
    mesh = plane()
    assert mesh.uvs is not None
    document = layout_svg(mesh.replace(uvs=mesh.uvs + np.array([1.0, 1.0])), 512)
    found = layers(document)
    texts = [text.text for text in found["tiles"] if text.tag == f"{SVG}text"]
    assert texts == ["1001", "1002", "1011", "1012"]
    (chart,) = found["charts"]
    corners = walks(chart)[0]
    assert (corners.min(axis=0).tolist(), corners.max(axis=0).tolist()) == ([256, 0], [512, 256])


def test_a_hundred_thousand_triangles_take_few_megabytes() -> None:
    mesh = uv_sphere(224, 224)
    assert mesh.n_faces > 99_000
    for heat in False, True:
        assert len(layout_svg(mesh, 2048, heat=heat)) < 2_500_000


def test_coordinates_as_large_as_a_float32_end_in_a_document() -> None:
    mesh = plane()
    assert mesh.uvs is not None
    found = layers(layout_svg(mesh.replace(uvs=mesh.uvs * 1e38), 64))
    assert "tiles" not in found
    assert area(found["charts"][0]) == pytest.approx(-(64.0**2))


def test_names_cannot_break_the_document() -> None:
    name = "<a & 'b'>\x00\udcff.obj"
    root = ET.fromstring(layout_svg(plane().replace(name=name)).encode())
    title = root.find(f"{SVG}title")
    assert title is not None
    assert title.text == "<a & 'b'>.obj"


def test_without_area_or_coordinates() -> None:
    blank = plane().replace(uvs=np.zeros((1, 2)), uv_faces=np.zeros((2, 3), dtype=np.int32))
    assert ET.fromstring(layout_svg(blank)).tag == f"{SVG}svg"
    with pytest.raises(UvError, match="no texture coordinates"):
        layout_svg(cube())
