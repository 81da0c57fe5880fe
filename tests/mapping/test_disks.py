import numpy as np

from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cutting.disks import disk_charts
from texbake.mapping.atlas.cutting.parts import Part
from texbake.mapping.seams import opposite_half_edges
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import _geodesic_sphere, plane


def laid(mesh: Mesh, most_l2: float) -> tuple[list[Charts], int]:
    solid = np.ones(mesh.n_faces, dtype=bool)
    opposite = opposite_half_edges(mesh.faces, solid=solid)
    part = Part(face_ids=np.arange(mesh.n_faces, dtype=np.int32), opposite=opposite)
    pieces, left = disk_charts(mesh.positions, mesh.faces, [part], most_l2=most_l2)
    return [charts for _, charts in pieces], len(left)


def test_a_developable_part_is_one_chart_with_its_own_lengths() -> None:
    mesh = plane(16, 16, lambda x, y: np.sqrt(1.0 - (x - 0.5) ** 2))  # on a cylinder
    (charts,), n_left = laid(mesh, 1.001)
    assert (charts.n_charts, n_left) == (1, 0)
    flat, space = (
        np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        for corners in (charts.uvs[charts.faces], mesh.positions[mesh.faces])
    )
    assert np.abs(flat / space - 1.0).max() < 1e-3


def test_a_closed_part_is_divided_until_it_is_flat_enough() -> None:
    positions, faces = _geodesic_sphere(16)
    few, many = (laid(Mesh(positions=positions, faces=faces), l2) for l2 in (1.2, 1.01))
    assert few[1] == many[1] == 0
    assert 2 <= few[0][0].n_charts < many[0][0].n_charts <= 32


def test_noise_does_not_divide_a_chart() -> None:
    mesh = plane(40, 40)
    noise = 0.012 * np.random.default_rng(1).standard_normal(mesh.n_vertices)
    rough = mesh.replace(positions=mesh.positions + noise[:, None] * [0.0, 0.0, 1.0])
    (charts,), n_left = laid(rough, 1.001)  # less than its layout in one piece has
    assert charts.n_charts - charts.n_split == 1
    assert n_left == 0


def test_few_faces_that_close_up_are_left() -> None:
    tetrahedron = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        faces=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    )
    assert laid(tetrahedron, 1.1) == ([], 4)
