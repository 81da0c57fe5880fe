"""`finish`: what it takes, what it asks a function for, and how it ends early."""

import threading

import numpy as np
import pytest

import texbake
from texbake import TexbakeError, finish
from texbake.errors import CancelledError, MeshError, OptionError
from texbake.mesh.shapes import icosphere
from texbake.mesh.topology import face_components, find_edges
from texbake.texture.model_materials import model_materials

SMALL = {"n_faces": 300, "size": 64}


class Tensor:
    """A tensor like those of torch: on a device, with a gradient, or of a type that NumPy lacks."""

    class Device:
        def __init__(self, kind):
            self.type = kind

        def __str__(self):
            return f"{self.type}:0"

    def __init__(self, values, device="cpu", *, has_gradient=False, dtype="float32"):
        self.values, self.device = np.asarray(values), self.Device(device)
        self.has_gradient, self.dtype = has_gradient, dtype

    def detach(self):
        return Tensor(self.values, self.device.type, dtype=self.dtype)

    def __array__(self, dtype=None, copy=None):
        if self.device.type != "cpu":
            raise TypeError("can't convert cuda:0 device type tensor to numpy.")
        if self.has_gradient:
            raise RuntimeError("Can't call numpy() on Tensor that requires grad.")
        if self.dtype == "bfloat16":
            raise TypeError("Got unsupported ScalarType BFloat16")
        return self.values.astype(dtype or self.values.dtype)


class OnlyNumpy:
    """An array of a library that has `numpy` alone."""

    def __init__(self, values):
        self.numpy = lambda: values


@pytest.fixture(scope="module")
def ball():
    mesh = icosphere(4)
    return mesh.positions * [1.0, 2.0, 1.0] + [10.0, 0.0, 0.0], np.array(mesh.faces)


@pytest.fixture(scope="module")
def plain(ball):
    return finish(*ball, **SMALL)


def notes(done):
    """Warnings but of thin triangles between the 64 texels of a side."""
    return [warning for warning in done.warnings if "own no texel" not in warning]


def by_height(points, normals):
    return np.repeat((points[:, 1:2] + 2.0) / 4.0, 3, axis=1)


def test_a_raw_mesh_becomes_a_model_with_maps(plain, ball, tmp_path):
    assert plain.mesh.n_faces <= 300 and plain.mesh.uvs is not None
    assert set(plain.maps) == {"normal", "displacement"}
    assert repr(plain) == "<Finished mesh: 5,120 to 300 faces, normal, displacement>"
    assert notes(plain) == [] and plain.report["faces"] == [5120, 300]
    path = plain.write(tmp_path / "ball.glb")
    again = texbake.read_mesh(path)
    np.testing.assert_allclose(np.sort(again.bounds), np.sort(plain.mesh.bounds), rtol=1e-6)
    channels = model_materials(path, again).materials[0].channels
    assert channels["normal"].image is not None and channels["base-color"].image is None
    assert channels["metallic"].factor == (0.0,)


CHANGED = {
    "float32": lambda v, f: (v.astype(np.float32), f.astype(np.int64)),
    "lists": lambda v, f: (v.tolist(), f.tolist()),
    "not contiguous": lambda v, f: (np.asfortranarray(v), np.repeat(f, 2, axis=0)[::2]),
    "big-endian": lambda v, f: (v.astype(">f8"), f.astype(">u4")),
    "tensors": lambda v, f: (Tensor(v, has_gradient=True), Tensor(f)),
    "numpy()": lambda v, f: (OnlyNumpy(v), OnlyNumpy(f)),
}


def test_arrays_of_any_kind_give_the_same_model(ball, tmp_path):
    rounded, faces = ball[0].astype(np.float32).astype(np.float64), ball[1]
    expected = finish(rounded, faces, **SMALL).write(tmp_path / "a.glb").read_bytes()
    for name, change in CHANGED.items():
        done = finish(*change(rounded, faces), **SMALL)
        assert done.write(tmp_path / "a.glb").read_bytes() == expected, name


def test_float16_and_read_only_arrays_are_taken_and_kept(ball):
    vertices, faces = ball[0].astype(np.float16), ball[1].copy()
    before = vertices.copy(), faces.copy()
    vertices.flags.writeable = faces.flags.writeable = False
    assert finish(vertices, faces, **SMALL).mesh.n_faces <= 300
    np.testing.assert_array_equal(vertices, before[0])
    np.testing.assert_array_equal(faces, before[1])


@pytest.mark.parametrize("change, message", [
    (lambda v, f: (Tensor(v, "cuda"), f), r"vertices: it is a tensor on cuda:0; .*\.cpu\(\)"),
    (lambda v, f: (v, Tensor(f, "mps")), r"faces: it is a tensor on mps:0; .*\.cpu\(\)"),
    (lambda v, f: (Tensor(v, dtype="bfloat16"), f), "vertices: .* unsupported ScalarType"),
    (lambda v, f: ("mesh.obj", f), "vertices: it is not an array of numbers"),
    (lambda v, f: (None, f), "vertices: it is not an array of numbers"),
    (lambda v, f: (np.where(v > 10.9, np.nan, v), f), "a position is not finite"),
    (lambda v, f: (v[:, :2], f), r"positions has the shape \(2562, 2\), not \(n, 3\)"),
    (lambda v, f: (v, f.astype(float)), "faces must be integers"),
    (lambda v, f: (v, f[:, :2]), r"faces has the shape \(5120, 2\)"),
    (lambda v, f: (v, f[:0]), "it has no faces"),
    (lambda v, f: (v, f + len(v)), "a position index is out of range"),
    (lambda v, f: (v, -f), "a position index is out of range"),
    (lambda v, f: (0 * v, f), "no face has an area"),
])  # fmt: skip
def test_arrays_that_are_no_mesh_are_one_clear_error(change, message, ball):
    with pytest.raises(TexbakeError, match=message) as caught:
        finish(*change(*ball), **SMALL)
    assert "\n" not in str(caught.value)


def test_the_function_gets_points_of_the_raw_mesh_and_their_normals(ball):
    batches = []

    def sample(points, normals):
        batches.append((points, normals))
        points += 0.0  # they may be changed
        return np.zeros((len(points), 3))

    finish(*ball, sample=sample, **SMALL)
    assert 1 <= len(batches[0][0]) <= 16  # it is tried first
    assert max(len(points) for points, _ in batches) <= 262_144
    vertices, faces = ball
    # On the triangles of the raw mesh, which lie just within the ellipsoid.
    corners = vertices[faces]
    heights = np.linalg.norm((corners.mean(axis=1) - [10, 0, 0]) / [1, 2, 1], axis=1)
    for points, normals in batches:
        assert points.dtype == normals.dtype == np.float64
        assert points.shape == normals.shape == (len(points), 3)
        radii = np.linalg.norm((points - [10, 0, 0]) / [1, 2, 1], axis=1)
        assert heights.min() - 1e-6 <= radii.min() and radii.max() <= 1 + 1e-6
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
        outwards = (points - [10, 0, 0]) / [1, 4, 1]
        outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
        assert (normals * outwards).sum(axis=1).min() > 0.99


def test_colors_lie_where_the_function_puts_them(ball):
    done = finish(*ball, sample=by_height, linear=True, n_faces=300, size=128)
    colors = done.maps["base-color"]
    points = texbake.atlas_points(done.mesh, 128)
    expected = (points.positions[..., 1] + 2) / 4
    error = np.abs(colors.values[..., 0] - expected)[points.mask & colors.has_data]
    assert error.max() < 0.05 and error.mean() < 0.005


def test_the_same_for_any_number_of_threads_and_samples(ball, tmp_path):
    for samples in (1, 4, "adaptive"):
        files = []
        for threads in (1, 3):
            heard = set()

            def sample(points, normals, heard=heard):
                heard.add(threading.get_ident())
                assert len(points) <= 262_144
                return {"color": by_height(points, normals), "metallic": points[:, 0] > 10}

            done = finish(*ball, sample=sample, threads=threads, samples=samples, **SMALL)
            files.append(done.write(tmp_path / "a.glb").read_bytes())
            assert heard == {threading.get_ident()}
        assert files[0] == files[1]


def test_colors_are_srgb_unless_they_are_linear(ball):
    def gray(points, normals):
        return np.full((len(points), 3), 128, np.uint8)

    (srgb,) = finish(*ball, sample=gray, **SMALL).materials.materials
    (linear,) = finish(*ball, sample=gray, linear=True, **SMALL).materials.materials
    assert srgb.channels["base-color"].factor == pytest.approx((0.2158605,) * 3, abs=1e-4)
    assert linear.channels["base-color"].factor == pytest.approx((128 / 255,) * 3, abs=1e-4)


@pytest.mark.parametrize("answer, names", [
    (lambda p: p[:, 0] * 0, {"base-color"}),
    (lambda p: Tensor(p[:, :3] * 0), {"base-color"}),
    (lambda p: np.zeros((len(p), 4)), {"base-color", "alpha"}),
    (lambda p: {"base_color": p * 0, "opacity": p[:, :1] * 0}, {"base-color", "alpha"}),
    (lambda p: {"roughness": p[:, 0] * 0, "emissive": p * 0}, {"roughness", "emissive"}),
])  # fmt: skip
def test_any_channels_of_a_material(answer, names, ball):
    done = finish(*ball, sample=lambda points, normals: answer(points), **SMALL)
    assert set(done.maps) - {"normal", "displacement"} == names
    assert done.materials.materials[0].alpha_mode == ("blend" if "alpha" in names else "opaque")


def test_an_opacity_of_one_all_over_is_opaque(ball):
    done = finish(*ball, sample=lambda p, n: np.ones((len(p), 4)), **SMALL)
    assert done.materials.materials[0].alpha_mode == "opaque"


def test_values_that_were_clipped_are_counted_in_a_warning(ball):
    def finished(value):
        return finish(*ball, **SMALL, sample=lambda p, n: np.full((len(p), 1), value))

    assert notes(finished(1.0 + 1e-4)) == []
    (warning,) = notes(finished(1.5))
    assert warning.endswith(" values of base-color were out of range and clipped")


@pytest.mark.parametrize("answer, message", [
    (lambda p: p[:-1], r"sample: it returned the shape \(15, 3\) for 16 points, not \(16, 1\)"),
    (lambda p: p[:, :2], r"the shape \(16, 2\) for 16 points"),
    (lambda p: p[None], r"the shape \(1, 16, 3\)"),
    (lambda p: 0.5, r"the shape \(\) for 16 points"),
    (lambda p: None, "sample: it is not an array of numbers, but None"),
    (lambda p: "red", "sample: it is not an array of numbers, but 'red'"),
    (lambda p: [[1], [2, 3]], "sample: it is not an array of numbers"),
    (lambda p: p * np.nan, "sample: it returned NaN or infinity at 16 of 16 points"),
    (lambda p: p * 0 + 255.0, r"base-color has values from 255 to 255; .* \[0, 1\], or be uin"),
    (lambda p: Tensor(p, "cuda"), r"sample: it is a tensor on cuda:0; .*\.cpu\(\)"),
    (lambda p: {}, "sample: it returned no channel"),
    (lambda p: {"colour": p}, "sample: 'colour' is not a channel; return some of base-color"),
    (lambda p: {"normal": p}, "sample: 'normal' is not a channel"),
    (lambda p: {"alpha": 0 * p[:, 0], "opacity": 0 * p[:, 1]},
     "sample: it returned alpha under two"),
    (lambda p: {"metallic": p}, r"sample: metallic: it returned the shape \(16, 3\)"),
    (lambda p: {"roughness": p[:, 0] / 0}, "sample: roughness: it returned NaN or infinity"),
])  # fmt: skip
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_a_wrong_answer_is_one_clear_error_before_the_work(answer, message, ball):
    heard = []
    with pytest.raises(TexbakeError, match=message) as caught:
        finish(*ball, sample=lambda points, normals: answer(points),
               progress=lambda stage, share: heard.append(stage), **SMALL)  # fmt: skip
    assert "\n" not in str(caught.value) and set(heard) == {"repair"}


@pytest.mark.parametrize(("least", "message"), [(-0.5, None), (-9.0, "they must be 0 or more")])
def test_linear_light_has_no_upper_bound_and_is_not_negative(least, message, ball):
    def sample(points, normals):
        return {"emissive": np.where(points[:, 1:2] > 0.0, 5.0, least) + 0.0 * points}

    if message is None:
        glow = finish(*ball, sample=sample, linear=True, **SMALL).maps["emissive"].values
        assert glow.min() == 0.0 and glow.max() == 5.0
    else:
        with pytest.raises(OptionError, match=message):
            finish(*ball, sample=sample, linear=True, **SMALL)


@pytest.mark.parametrize("later", ["shape", "channels", "nan"])
def test_a_wrong_answer_to_a_later_batch_is_an_error_too(later, ball):
    def sample(points, normals):
        if len(points) <= 16:
            return points * 0
        changed = {"shape": points[1:], "channels": {"metallic": points[:, 0]}}
        return changed.get(later, points * np.nan)

    with pytest.raises(OptionError, match=r"^sample: "):
        finish(*ball, sample=sample, **SMALL)


class Unusual(BaseException):
    pass


# Every error twice, and every moment with one sample and with four.
@pytest.mark.parametrize(("error", "when", "samples"), [
    (KeyError("density"), "at first", 1), (KeyError("density"), "later", 4),
    (Unusual("stop"), "later", 1), (Unusual("stop"), "progress", 4),
    (MeshError("mine"), "progress", 1), (MeshError("mine"), "at first", 4),
])  # fmt: skip
def test_what_a_function_raises_passes_through(error, when, samples, ball, tmp_path):
    def sample(points, normals):
        if when == "at first" or (when == "later" and len(points) > 16):
            raise error
        return points * 0

    def progress(stage, share):
        if when == "progress" and stage == "bake":
            raise error

    output = tmp_path / "out.glb"
    with pytest.raises(type(error)) as caught:
        finish(*ball, sample=sample, progress=progress, samples=samples, output=output, **SMALL)
    assert caught.value is error
    assert list(tmp_path.iterdir()) == []


def test_progress_names_stages_and_shares(ball):
    heard = []
    finish(*ball, progress=lambda stage, share: heard.append((stage, share)), **SMALL)
    stages = list(dict.fromkeys(stage for stage, _ in heard))
    assert stages[0] == "repair" and stages[-1] == "encode images" and "bake" in stages
    assert {share for _, share in heard} >= {None, 0.0, 1.0}
    assert all(share is None or 0.0 <= share <= 1.0 for _, share in heard)


@pytest.mark.parametrize("stage", ["repair", "cut charts", "bake", "encode images"])
def test_false_cancels(stage, ball, tmp_path):
    before = threading.active_count()
    with pytest.raises(CancelledError, match=f"cancelled while {stage} was running"):
        finish(*ball, progress=lambda name, share: np.bool_(name != stage),
               output=tmp_path / "out.glb", **SMALL)  # fmt: skip
    assert threading.active_count() == before
    assert list(tmp_path.iterdir()) == []


def test_the_output_is_checked_before_the_work(ball, tmp_path):
    for output in (tmp_path / "a.obj", tmp_path / "none" / "a.glb"):
        with pytest.raises(TexbakeError, match=r"a\.obj|none"):
            finish(*ball, output=output, progress=lambda *_: pytest.fail("it began"), **SMALL)
    finish(*ball, output=tmp_path / "a.glb", **SMALL)
    assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]


def test_further_maps_are_baked_and_levels_are_not(ball):
    assert "curvature" in finish(*ball, maps=("curvature",), **SMALL).maps
    with pytest.raises(OptionError, match="levels: a finished model is one mesh"):
        finish(*ball, levels=(100,), **SMALL)
    with pytest.raises(OptionError, match="compare: finish compares nothing"):
        finish(*ball, compare="full", **SMALL)


def test_a_preset_chooses_options_that_are_not_given(ball):
    done = finish(*ball, n_faces=300, size=64, preset="unreal")
    assert done.maps["normal"].options.convention == "directx"


@pytest.mark.parametrize("radius, options, n_kept", [
    (0.01, {}, 1),  # 30 parts with less than a triangle's area each
    (0.05, {}, 31),
    (0.05, {"least_part": 0.01}, 1),
    (0.01, {"least_part": 0.0}, 31),
    (1.0, {"least_part": 1.0}, 31),  # all are as large as the largest
])  # fmt: skip
def test_flying_bits_are_left_out(radius, options, n_kept):
    ball, bit = icosphere(4), icosphere(1)
    ball = ball if radius < 1.0 else bit
    places = np.concatenate([np.mgrid[0:6, 0:5].reshape(2, -1).T, np.full((30, 1), 2)], axis=1) * 3
    bits = bit.positions[None] * radius + places[:, None]
    vertices = np.concatenate([ball.positions, bits.reshape(-1, 3)])
    starts = ball.n_vertices + bit.n_vertices * np.arange(30)[:, None, None]
    faces = np.concatenate([ball.faces, (bit.faces + starts).reshape(-1, 3)])
    done = finish(vertices, faces, **{"n_faces": 1000, "size": 256}, **options)
    assert face_components(done.high.faces, done.high.n_vertices)[1] == n_kept
    said = [line for line in done.warnings if "left out 30 parts" in line]
    assert len(said) == (n_kept == 1)


@pytest.mark.parametrize("scale, offset", [(1e-25, 0.0), (1e30, 0.0), (1.0, 1e6)])
def test_a_model_of_any_size_and_place(scale, offset, ball):
    def sample(points, normals):
        heights = (points[:, 1:2] / scale - offset + 2.0) / 4.0
        return np.repeat(heights, 3, axis=1)

    done = finish((ball[0] + offset) * scale, ball[1], sample=sample, linear=True, **SMALL)
    colors = done.maps["base-color"]
    points = texbake.atlas_points(done.mesh, 64)
    expected = (points.positions[..., 1] / scale - offset + 2.0) / 4.0
    assert np.abs(colors.values[..., 0] - expected)[points.mask & colors.has_data].max() < 0.06


@pytest.mark.parametrize("options, message", [
    ({"least_part": -1}, "least_part: -1 is too small"),
    ({"least_part": "x"}, "least_part: 'x' is not a number"),
    ({"least_part": np.ones(2)}, "least_part: array.* is not a number"),
    ({"sample": 3}, "sample: 3 is not a function"),
    ({"n_facess": 3}, r"n_facess: there is no such option; did you mean 'n_faces'\?"),
    ({"zzz": 3}, "zzz: there is no such option; see RunOptions"),
    ({"progress": 3}, "progress: 3 is not a function, True or None"),
    ({"maps": "ao"}, "maps: ao is one name; give a tuple"),
])  # fmt: skip
def test_wrong_arguments_are_one_clear_error(options, message, ball):
    with pytest.raises(OptionError, match=message):
        finish(*ball, **options)


def n_borders(mesh):
    return int(np.count_nonzero(find_edges(mesh.faces).boundary))


def test_open_stays_open_and_closed_stays_closed(ball, plain):
    vertices, faces = ball
    assert n_borders(plain.mesh) == 0
    cut = faces[(vertices[faces][:, :, 1] < 1.0).all(axis=1)]
    assert n_borders(finish(vertices, cut, **SMALL).mesh) > 10


def test_a_soup_with_doubled_and_flipped_faces_is_repaired(ball):
    vertices, faces = ball
    soup = vertices[faces].reshape(-1, 3)
    indices = np.arange(len(soup)).reshape(-1, 3)
    indices[::50] = indices[::50, ::-1]
    indices = np.concatenate([indices, indices[:100], [[0, 0, 1]]])
    done = finish(soup, indices, **SMALL)
    assert done.high.n_faces == len(faces) and done.high.n_vertices == len(vertices)
    assert n_borders(done.mesh) == 0


def test_fewer_faces_than_requested_are_kept(ball):
    done = finish(*ball, n_faces=10_000, size=256)
    assert done.mesh.n_faces == len(ball[1])


def test_many_separate_parts_finish_although_the_number_is_not_reached():
    part = icosphere(1)
    places = np.mgrid[0:5, 0:5, 0:5].reshape(3, -1).T * 3.0
    vertices = (part.positions[None] + places[:, None]).reshape(-1, 3)
    faces = (part.faces[None] + part.n_vertices * np.arange(125)[:, None, None]).reshape(-1, 3)
    assert finish(vertices, faces, n_faces=100, size=256).mesh.n_faces > 0
