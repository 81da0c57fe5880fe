"""Displacement of the renderer: exact, closed, as fine as the picture needs and no finer."""

from dataclasses import replace

import numpy as np
import pytest

from texbake.errors import OptionError, UvError
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import smooth_normals
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.effect import Activation, Effect
from texbake.rendering.effects import EFFECTS
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Light, Lighting
from texbake.rendering.scene.material import Displacement, Material
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.image import Image
from texbake.texture.lookup import lookup

SMALL = RenderOptions(width=96, height=72, supersampling=1, view=(30.0, 40.0), background=None)
NOISE = np.random.default_rng(1).uniform(-1, 1, (48, 64)).astype(np.float32)
LIT = Lighting(lights=(Light(direction=(-0.3, -0.6, -1.0)),))


def image(values, **fields):
    return ImageTexture(image=np.asarray(values, np.float32), **{"filter": "bilinear"} | fields)


def displaced(mesh, holder, *, options=SMALL, camera=None, transform=None, threads=1, **fields):
    """The object as it is drawn, and the frame."""
    kept = []
    probe = Effect(
        name="probe", does="looks",
        activations=lambda request: [Activation(i, "the test", "it looks") for i in request.shaded],
        left_out="nothing is shaded", load=lambda state, target: kept.append(state.drawn(target)),
    )  # fmt: skip
    material = Material(**{"shading": "unlit", "displacement": holder} | fields)
    scene = Scene(
        objects=(SceneObject(mesh=mesh, material=material, transform=transform),), lighting=LIT
    )
    camera = camera or Camera.framing(mesh, options=options)
    prepared = prepare(scene, options, effects=(*EFFECTS, probe), threads=threads)
    frame = draw(prepared, camera)
    return kept[0], frame


def directed_edges(faces):
    """(E, 2) edges of all faces in their order, without those from a vertex to itself."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return edges[edges[:, 0] != edges[:, 1]]


def are_closed(edges):
    """Whether directed edges (E, 2) are of a closed surface: each as often as its opposite."""
    forward, counts = np.unique(edges, axis=0, return_counts=True)
    backward, counts_back = np.unique(edges[:, ::-1], axis=0, return_counts=True)
    return np.array_equal(forward, backward) and np.array_equal(counts, counts_back)


def euler(drawn):
    pairs = np.unique(np.sort(directed_edges(drawn.faces), axis=1), axis=0)
    return len(drawn.positions) - len(pairs) + len(drawn.faces)


def texel_edges(drawn, size):
    """(F, 3) texels that each edge of each piece spans."""
    w = drawn.base_weights.astype(np.float64)
    shares = np.stack([1 - w.sum(axis=-1), w[..., 0], w[..., 1]], axis=-1)
    uvs = np.einsum("fpc,fck->fpk", shares, drawn.mesh.corner_uvs()[drawn.base_faces])
    return np.linalg.norm((uvs - np.roll(uvs, -1, axis=1)) * size, axis=-1)


def pixel_edges(drawn, camera, options):
    """(F, 3) pixels between the corners of each piece; and whether all of it is in the picture."""
    matrix = camera.clip_from_world(options.width / options.height)
    clip = np.c_[drawn.positions, np.ones(len(drawn.positions))] @ matrix.T
    inside = (np.abs(clip[:, :2]) <= clip[:, 3:]).all(axis=1) & (clip[:, 3] > camera.near)
    with np.errstate(all="ignore"):
        pixels = clip[:, :2] / clip[:, 3:] * (options.width / 2, options.height / 2)
    corners = pixels[drawn.faces]
    return np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=-1), inside[drawn.faces].all(
        axis=1
    )


def test_a_plane_is_moved_by_its_map_exactly():
    drawn, _ = displaced(plane(2, 2), Displacement(texture=image(0.2 * NOISE), edge_px=1.0))
    x, y, z = drawn.positions.T
    expected = lookup(0.2 * NOISE[..., None], np.stack([x, y], axis=1), wrap="clamp")[:, 0]
    np.testing.assert_allclose(z, expected, atol=1e-7)  # float32 heights
    assert len(drawn.faces) > 5000


@pytest.mark.parametrize("mid", [None, 0.25])
@pytest.mark.parametrize("height", [None, -0.3])
def test_what_the_material_says_goes_before_what_the_file_says(mid, height):
    told = Image(np.full((4, 4, 1), 0.75, np.float32), {
        "texbake:displacement_mid": 0.5, "texbake:displacement_scale": 2.0,
    })  # fmt: skip
    holder = Displacement(texture=ImageTexture(image=told), mid=mid, height=height)
    drawn, _ = displaced(plane(), holder)
    expected = (0.75 - (0.5 if mid is None else mid)) * (2.0 if height is None else height)
    np.testing.assert_allclose(drawn.positions[:, 2], expected, rtol=1e-6)


@pytest.mark.parametrize("filtered", [True, False])
def test_a_procedure_moves_the_surface_by_its_formula(filtered):
    waves = ProcedureTexture(
        procedure="marble", parameters={"amount": 0.0, "frequency": 5.0}, filtered=filtered
    )
    drawn, _ = displaced(plane(), Displacement(texture=waves, height=0.4, mid=0.5, edge_px=1.0))
    x, _, z = drawn.positions.T
    # Where it is filtered, waves 100 pixels long lose next to nothing.
    np.testing.assert_allclose(z, 0.2 * np.sin(5.0 * x), atol=2e-3 if filtered else 1e-7)
    assert len(drawn.faces) > 5000


@pytest.mark.parametrize("edge_px", [0.7, 2.0, 6.0, 1000.0])
@pytest.mark.parametrize("near", [False, True])
def test_no_edge_in_the_picture_is_longer_than_asked_for_or_than_a_texel(edge_px, near):
    mesh = uv_sphere(8, 16)
    camera = (
        Camera.looking_at((0.2, -1.3, 0.3), (0.4, 0.0, 0.2), up=(0, 0, 1), fov=1.2, near=1e-3)
        if near
        else Camera.framing(mesh, options=SMALL)
    )
    holder = Displacement(texture=image(0.03 * NOISE), edge_px=edge_px)
    drawn, _ = displaced(mesh, holder, camera=camera)
    texels = texel_edges(drawn, (64, 48))
    pixels, inside = pixel_edges(drawn, camera, SMALL)
    assert inside.sum() > 20
    judged = inside[:, None] & (texels > 1.0)
    # Of an edge at a seam it is the longer of its two spans that counts: none is left out here.
    assert (pixels[judged] <= edge_px).all()
    if edge_px == 6.0:
        assert judged.any()
    if edge_px == 0.7:
        assert texels[inside].max() <= 1.0


def test_nothing_is_cut_that_cannot_get_into_the_picture():
    mesh = plane(1, 1)
    mesh = mesh.replace(positions=mesh.positions * 100 - (50, 50, 0), uvs=mesh.uvs)
    camera = Camera.looking_at((0, 0, 2), (0, 0, 0), up=(0, 1, 0), fov=0.8, near=0.01)
    heights = np.zeros((4096, 4096), np.float32)
    holder = Displacement(texture=image(heights))
    few, _ = displaced(mesh, holder, camera=camera)
    centers = few.positions[few.faces].mean(axis=1)
    areas = np.linalg.norm(
        np.cross(*np.moveaxis(np.diff(few.positions[few.faces], axis=1), 1, 0)), axis=1
    )
    far = np.linalg.norm(centers, axis=1) > 5
    assert far.any() and areas[far].min() > 20 * areas[~far].min()
    # Most of the surface by far is outside, few of the pieces.
    assert len(few.faces) < 30_000 and areas[far].sum() > 100 * areas[~far].sum()
    # What is tall enough to be moved into the picture is cut.
    tall, _ = displaced(mesh, replace(holder, texture=image(heights + 1.5)), camera=camera)
    assert len(tall.faces) > 1.2 * len(few.faces)


def test_edges_seen_from_the_end_are_cut_as_well():
    # A plane seen edge-on, with a ridge across the line of sight: it must stand out of it.
    heights = np.zeros((64, 64), np.float32)
    heights[:, 30:34] = 0.3
    camera = Camera.looking_at((-2.0, 0.5, 0.0), (0, 0.5, 0), up=(0, 0, 1), fov=0.6, near=0.01)
    drawn, frame = displaced(
        plane(), Displacement(texture=image(heights)), camera=camera, double_sided=True
    )
    assert drawn.positions[:, 2].max() > 0.29
    assert (frame.coverage > 0).sum() > 300


@pytest.mark.parametrize("edge_px", [0.5, 2.0, 9.0])
def test_uneven_cuts_leave_no_crack(edge_px):
    # From close by, parts are cut finely that lie next to others which are not in the picture.
    mesh = uv_sphere(8, 16)
    camera = Camera.looking_at((0.2, -1.3, 0.3), (0.4, 0.0, 0.2), up=(0, 0, 1), fov=1.2, near=1e-3)
    holder = Displacement(texture=image(0.05 * NOISE), edge_px=edge_px)
    drawn, _ = displaced(mesh, holder, camera=camera)
    ends = drawn.positions[directed_edges(drawn.faces)]
    sizes = np.linalg.norm(np.diff(ends, axis=1)[:, 0], axis=1)
    assert edge_px > 5 or sizes.max() > 10 * np.median(sizes)
    assert are_closed(directed_edges(drawn.faces)) and euler(drawn) == 2


def split_cube():
    """Cube whose sides are charts of their own, so that every edge between sides is a seam."""
    mesh = cube()
    sides = np.repeat(np.arange(6), 2)
    side_faces = mesh.faces.reshape(6, 6)
    uvs = np.zeros((6, 8, 2))
    for side, used in enumerate(side_faces):
        flat = [a for a in range(3) if np.ptp(mesh.positions[used, a]) > 0]
        uvs[side] = (mesh.positions[:, flat] + 0.6) / 1.2 / 3 + (side % 3 / 3, side // 3 / 3)
    return mesh.replace(uvs=uvs.reshape(-1, 2), uv_faces=mesh.faces + 8 * sides[:, None])


def by_texels(mesh, values):
    """A mesh that is cut to the texels of its map alone."""
    holder = Displacement(texture=image(values), edge_px=None)
    return displaced(mesh, holder, camera=around())[0]


def test_seams_stay_closed_and_those_that_a_file_split_are_welded():
    """The same cube with a vertex of its own for each corner of each face, as STL has it."""
    mesh = split_cube()
    soup = mesh.replace(
        positions=mesh.positions[mesh.faces].reshape(-1, 3),
        faces=np.arange(36, dtype=np.int32).reshape(12, 3),
    )
    whole, split = (by_texels(each, 0.05 * NOISE) for each in (mesh, soup))
    for drawn in whole, split:
        assert are_closed(directed_edges(drawn.faces)) and euler(drawn) == 2
    # Angle-weighted normals and means are summed in another order.
    sizes = [np.sort(np.linalg.norm(each.positions, axis=1)) for each in (whole, split)]
    np.testing.assert_allclose(*sizes, atol=1e-14)


def test_at_a_seam_a_vertex_moves_by_the_mean_of_its_heights():
    # Two triangles side by side in space, one on the black half of the map, one on the white.
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],
        faces=[[0, 1, 2], [2, 1, 3]],
        uvs=[[0.1, 0.1], [0.4, 0.1], [0.1, 0.4], [0.6, 0.1], [0.9, 0.1], [0.6, 0.4]],
        uv_faces=[[0, 1, 2], [3, 4, 5]],
    )
    heights = np.repeat(np.float32([[0] * 8 + [1] * 8]), 16, axis=0)
    x, y, z = by_texels(mesh, heights).positions.T
    np.testing.assert_array_equal(z, np.where(x + y == 1, 0.5, np.where(x + y < 1, 0.0, 1.0)))
    assert np.count_nonzero(x + y == 1) > 4


def test_a_vertex_without_normal_stays():
    # A triangle without area, and one beside it.
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0], [0, 3, 0]],
        faces=[[0, 1, 2], [3, 4, 5]],
        uvs=[[0, 0], [0.5, 0], [1, 0], [0, 0], [1, 0], [0, 1]],
        uv_faces=[[0, 1, 2], [3, 4, 5]],
    )
    _, y, z = by_texels(mesh, np.ones((4, 4))).positions.T
    np.testing.assert_array_equal(z, np.where(y == 0, 0.0, 1.0))
    assert np.count_nonzero(y == 0) > 3


def icosphere_with_uvs():
    mesh = icosphere(2)
    return mesh.replace(uvs=mesh.positions[:, :2] / 2 + 0.5, uv_faces=mesh.faces)


def test_one_pixel_moves_everything_alike():
    mesh = icosphere_with_uvs()
    drawn, _ = displaced(mesh, Displacement(texture=image([[[0.5]]])))
    # No edge spans more than the one texel, so that nothing is cut.
    np.testing.assert_array_equal(drawn.faces, mesh.faces)
    np.testing.assert_allclose(
        drawn.positions, mesh.positions + 0.5 * smooth_normals(mesh), atol=1e-15
    )


def turned():
    """A map that turns, mirrors, stretches alike and moves."""
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    turn[:, 0] *= -np.sign(np.linalg.det(turn))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = 3.0 * turn, (1.0, 2.0, 3.0)
    return matrix


@pytest.mark.parametrize("vector", [False, True])
def test_an_object_is_displaced_before_it_is_placed(vector):
    mesh, matrix = uv_sphere(6, 12), turned()
    values = np.random.default_rng(2).uniform(-0.2, 0.2, (16, 16, 3 if vector else 1))
    holder = Displacement(texture=image(values), vector=vector, edge_px=1e-3)  # by texels alone
    plain, _ = displaced(mesh, holder, camera=around())
    placed, _ = displaced(mesh, holder, transform=matrix, camera=around(), shading="lambert")
    expected = plain.positions @ matrix[:3, :3].T + matrix[:3, 3]
    assert len(placed.positions) == len(expected) > 500
    order = np.lexsort(np.round(expected, 9).T), np.lexsort(np.round(placed.positions, 9).T)
    # MikkTSpace's tangents are float32.
    np.testing.assert_allclose(
        placed.positions[order[1]], expected[order[0]], atol=3e-6 if vector else 1e-12
    )
    # Fronts are still outside.
    a, b, c = np.moveaxis(placed.positions[placed.faces], 1, 0)
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - matrix[:3, 3])
    assert np.mean(outward > 0) > 0.9
    normals = placed.normals[placed.normal_faces[:, 0]]
    assert np.mean(np.einsum("ij,ij->i", np.cross(b - a, c - a), normals) > 0) > 0.95


def around():
    """A camera that has everything in its picture, so that texels alone decide."""
    return Camera.looking_at((0, 0, 60.0), (0, 0, 0), fov=1.0, near=0.1)


@pytest.mark.parametrize(("space", "told", "expected"), [
    ("object", {}, (0.1, 0.2, 0.3)),
    ("tangent", {}, (-0.2, 0.1, 0.3)),  # u runs along y, v along -x
    (None, {}, (-0.2, 0.1, 0.3)),
    (None, {"texbake:space": "object"}, (0.1, 0.2, 0.3)),
    ("tangent", {"texbake:space": "object"}, (-0.2, 0.1, 0.3)),
])  # fmt: skip
def test_vectors_move_in_their_space(space, told, expected):
    mesh = plane()
    mesh = mesh.replace(uvs=np.stack([mesh.uvs[:, 1], 1 - mesh.uvs[:, 0]], axis=1))
    pixels = Image(np.full((4, 4, 3), (0.1, 0.2, 0.3), np.float32), told)
    holder = Displacement(texture=ImageTexture(image=pixels), vector=True, space=space)
    drawn, _ = displaced(mesh, holder)
    w = drawn.base_weights.astype(np.float64)
    shares = np.stack([1 - w.sum(axis=-1), w[..., 0], w[..., 1]], axis=-1)
    base = np.einsum("fpc,fck->fpk", shares, mesh.positions[mesh.faces][drawn.base_faces])
    moved = drawn.positions[drawn.faces] - base
    np.testing.assert_allclose(moved, np.broadcast_to(expected, moved.shape), atol=1e-7)


def test_normals_are_those_of_the_displaced_surface():
    n = 256
    u = (np.arange(n) + 0.5) / n
    waves = np.broadcast_to(0.02 * np.sin(2 * np.pi * 3 * u), (n, n))
    options = replace(SMALL, width=320, height=240)
    drawn, _ = displaced(
        plane(), Displacement(texture=image(waves)), options=options, shading="lambert"
    )
    x, y, _ = drawn.positions.T
    slope = 0.02 * 2 * np.pi * 3 * np.cos(2 * np.pi * 3 * x)
    expected = np.stack([-slope, 0 * x, 1 + 0 * x], axis=1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    inner = (np.minimum(x, y) > 0.02) & (np.maximum(x, y) < 0.98)
    # Pieces are 1/150 long, over which the slope turns by 0.05.
    np.testing.assert_allclose(drawn.normals[inner], expected[inner], atol=0.03)


def test_maps_finer_than_pieces_are_averaged_and_not_picked_from():
    # Stripes of one texel: seen as coarsely as here, they are flat, at their mean.
    stripes = np.zeros((512, 512), np.float32)
    stripes[:, ::2] = 1.0
    for name, spread in ("trilinear", 0.02), ("bilinear", 0.5):
        holder = Displacement(texture=image(stripes, filter=name), height=0.05, edge_px=8.0)
        drawn, _ = displaced(plane(), holder)
        z = drawn.positions[:, 2] / 0.05
        assert (np.ptp(z) < spread) == (name == "trilinear")
        if name == "trilinear":
            np.testing.assert_allclose(z, 0.5, atol=0.02)


def test_threads_change_nothing():
    noise = 0.1 * np.random.default_rng(9).uniform(-1, 1, (256, 256))
    holder = Displacement(texture=image(noise, filter="trilinear"), edge_px=0.5)
    one, first = displaced(uv_sphere(8, 16), holder, shading="lambert")
    several, second = displaced(uv_sphere(8, 16), holder, shading="lambert", threads=5)
    for name in "positions", "faces", "base_faces", "base_weights", "normals":
        assert getattr(one, name).tobytes() == getattr(several, name).tobytes()
    assert first.color.tobytes() == second.color.tobytes()
    assert len(one.faces) > 2 << 16  # more than a band of everything


def test_what_cannot_displace_is_one_line():
    holes = image(np.where(NOISE > 0.9, np.nan, NOISE))
    for mesh, holder, error, words in (
        (plane(), Displacement(texture=holes), OptionError, "a height is not finite"),
        (cube(), Displacement(texture=image(NOISE)), UvError, "texture coordinates"),
        (
            plane(), Displacement(texture=image(NOISE), vector=True), OptionError,
            r"\(height, width, 3\)",
        ),
    ):  # fmt: skip
        with pytest.raises(error, match=words):
            displaced(mesh, holder)
    with pytest.raises(OptionError, match="a procedure has one height"):
        Displacement(texture=ProcedureTexture(procedure="noise"), vector=True)
