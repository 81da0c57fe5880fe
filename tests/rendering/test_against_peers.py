"""Pictures held against OpenGL (Mesa's llvmpipe) and three.js (Chromium on SwiftShader).

Peers run as programs of `tests/benchmarks`, each once for all pictures. Where one cannot be had,
its tests are skipped with its own word for why. `pytest -rP` tells how many pixels agree.
"""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from skimage.data import astronaut

from tests.models import model, moved
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.shapes import plane, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Ambient, Light, Lighting
from texbake.rendering.scene.material import Material, NormalMap
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.encoding import decode_srgb, encode_srgb

PROGRAMS = Path(__file__).parents[1] / "benchmarks"
PEERS = {"llvmpipe": "peer_llvmpipe.py", "three.js": "peer_threejs.py"}
UNAVAILABLE = 3  # exit code of a peer that is not here
WIDTH, HEIGHT = 400, 300
TO_LIGHT = np.array([0.6, 0.64, 0.48])
LIGHT, AMBIENT = (0.8, 0.75, 0.7), (0.1, 0.12, 0.15)
# Most that a channel may differ, in codes of 255, and the least share of pixels that must not.
CODES, SHARE = 2, 0.99


@dataclass(kw_only=True)
class Case:
    """One mesh with one material, seen by one camera."""

    mesh: Mesh
    camera: Camera
    shading: str = "unlit"
    base_map: np.ndarray | None = None  # (H, W, 3) uint8, sRGB
    normal_map: np.ndarray | None = None  # (H, W, 3) uint8
    base_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    filter: str = "trilinear"


def camera_at(eye, target):
    return Camera.looking_at(eye, target, fov=np.radians(40.0), near=0.05)


def checks(size=64):
    y, x = np.mgrid[:size, :size] * 8 // size
    return np.where(((x + y) % 2 == 0)[..., None], [230, 60, 30], [25, 90, 200]).astype(np.uint8)


def dents(size=256):
    """Normals of egg-box bumps, 12 a side."""
    y, x = np.mgrid[:size, :size] / size * 2 * np.pi * 12
    normals = np.stack([0.4 * np.cos(x), 0.4 * np.sin(y), np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.rint(127.5 + 127.5 * normals).astype(np.uint8)


def ground(squares, length):
    """A ground of `length` in x and z, one texture repeat per unit."""
    mesh = plane(squares, squares)
    x, y, _ = mesh.positions.T
    positions = np.stack([(x - 0.5) * length, np.zeros_like(x), -y * length], axis=-1)
    return mesh.replace(positions=positions, uvs=mesh.uvs * length)


def made_cases():
    ball = uv_sphere(64, 128)
    ball = ball.replace(positions=ball.positions @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]))
    unlit = {"mesh": ball, "camera": camera_at((1.2, 1.0, 2.6), (0, 0, 0))}
    lit = {**unlit, "shading": "lambert"}
    color, photo = (0.7, 0.3, 0.1), astronaut()
    figure = moved(model("figure with coordinates"), scale=1.2)
    return {
        "ball": Case(**lit, base_color=color),
        "dented ball": Case(**lit, base_color=color, normal_map=dents()),
        "photo on a ball": Case(**unlit, base_map=photo),
        "photo on a lit ball": Case(**lit, base_map=photo),
        "nearest": Case(**unlit, base_map=checks(), filter="nearest"),
        "bilinear": Case(**lit, base_map=photo, filter="bilinear"),
        "photo on a lit figure": Case(**{**lit, "mesh": figure}, base_map=photo),
    }


def grounds():
    """Textured ground to the horizon, where the mip level changes fast."""
    view = {"mesh": ground(4, 200.0), "camera": camera_at((0.0, 1.2, 0.5), (0.0, 0.0, -4.0))}
    return {"photos": Case(**view, base_map=astronaut()), "checks": Case(**view, base_map=checks())}


def write_job(case, path, *, exact_levels):
    """A case as the peers' programs take it: corners as vertices."""
    mesh, camera = case.mesh, case.camera
    normals, normal_faces = shading_normals(mesh)
    arrays = {
        "positions": mesh.positions[mesh.faces].reshape(-1, 3),
        "faces": np.arange(3 * mesh.n_faces).reshape(-1, 3),
        "normals": normals[normal_faces].reshape(-1, 3), "uvs": mesh.corner_uvs().reshape(-1, 2),
        "clip_from_world": camera.clip_from_world(WIDTH / HEIGHT), "eye": camera.eye,
        "axes": camera.axes, "base_map": case.base_map, "normal_map": case.normal_map,
    }  # fmt: skip
    if case.normal_map is not None:
        arrays["tangents"] = corner_tangents(mesh).reshape(-1, 4)
    np.savez(
        path, **{name: values for name, values in arrays.items() if values is not None},
        width=WIDTH, height=HEIGHT, shading=case.shading, filter=case.filter,
        base_color=case.base_color, to_light=TO_LIGHT, light=LIGHT, ambient=AMBIENT,
        exact_levels=exact_levels,
    )  # fmt: skip


def drawn_by_peer(peer, cases, folder, *, exact_levels=False):
    jobs = [folder / f"{place}.npz" for place in range(len(cases))]
    for case, job in zip(cases.values(), jobs, strict=True):
        write_job(case, job, exact_levels=exact_levels)
    done = subprocess.run(
        [sys.executable, PROGRAMS / PEERS[peer], *jobs, "-o", folder],
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    if done.returncode == UNAVAILABLE:
        pytest.skip(f"{peer}: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    return {name: np.load(job.with_suffix(".npy")) for name, job in zip(cases, jobs, strict=True)}


def drawn_by_texbake(case):
    def texture(linear):
        return ImageTexture(image=linear.astype(np.float32), filter=case.filter, wrap="repeat")

    base_color, normal_map = case.base_color, None
    if case.base_map is not None:
        base_color = texture(decode_srgb(case.base_map / 255.0))
    if case.normal_map is not None:
        normal_map = NormalMap(texture=texture(case.normal_map / 127.5 - 1.0))
    material = Material(shading=case.shading, base_color=base_color, normal_map=normal_map)
    scene = Scene(
        objects=(SceneObject(mesh=case.mesh, material=material),),
        lighting=Lighting(
            lights=(Light(direction=tuple(-TO_LIGHT), color=LIGHT),), ambient=Ambient(color=AMBIENT)
        ),
    )
    options = RenderOptions(width=WIDTH, height=HEIGHT, supersampling=1, background=None)
    return draw(prepare(scene, options), case.camera)


def codes_of(picture):
    return np.rint(255.0 * encode_srgb(picture[..., :3])).astype(int)


def inside(covered):
    """Pixels that are covered, and all eight about them too."""
    padded = np.pad(covered, 1)
    height, width = covered.shape
    windows = [padded[j : j + height, i : i + width] for j in range(3) for i in range(3)]
    return np.logical_and.reduce(windows)


def differences(case, theirs):
    """Codes by which texbake's picture differs, and which pixels neither draws an outline in."""
    frame = drawn_by_texbake(case)
    ours, covered = frame.coverage > 0.5, theirs[..., 3] > 0.5
    # The outlines themselves are the same, but for what falls between two grids of sub-pixels.
    assert (ours != covered).mean() < 0.001
    assert covered.mean() > 0.2
    return np.abs(codes_of(frame.color) - codes_of(theirs)).max(axis=-1), inside(ours & covered)


def share_alike(codes, counted):
    share = (codes[counted] <= CODES).mean()
    print(f"{100 * share:.2f} %, at most {codes[counted].max()} codes apart")
    return share


@pytest.fixture(scope="module", params=PEERS)
def made(request, tmp_path_factory):
    return drawn_by_peer(request.param, made_cases(), tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="module")
def defined(tmp_path_factory):
    cases = grounds() | made_cases()
    folder = tmp_path_factory.mktemp("defined")
    return drawn_by_peer("llvmpipe", cases, folder, exact_levels=True)


@pytest.mark.parametrize("name", made_cases())
def test_made_shapes_look_as_the_peers_draw_them(made, name):
    assert share_alike(*differences(made_cases()[name], made[name])) >= SHARE


@pytest.mark.parametrize("name", grounds() | made_cases())
def test_mip_levels_are_those_that_opengl_defines(defined, name):
    """Left alone, graphics cards choose a level for four pixels and round its logarithm.

    So does llvmpipe, and on ground to the horizon no two peers agree within the reach. Told the
    level of the definition, it agrees on all but a few pixels: outlines count here as well, and
    its levels of a normal map are rounded to 8 bits.
    """
    codes, _ = differences((grounds() | made_cases())[name], defined[name])
    assert share_alike(codes, defined[name][..., 3] > 0.5) >= 0.995
