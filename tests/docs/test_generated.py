"""The Python code of the pages about generated meshes runs, with stand-ins for generators."""

import re
import sys
import types
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import texbake
from texbake.errors import TexbakeError
from texbake.mesh.shapes import icosphere

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
_BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


class Tensor(np.ndarray):
    """As much of a tensor of torch as the pages use, on a GPU until it is copied."""

    gpu = True

    def __array_finalize__(self, other):
        self.gpu = getattr(other, "gpu", True)

    @property
    def device(self):
        return types.SimpleNamespace(type="cuda" if self.gpu else "cpu")

    def detach(self):
        return self

    def to(self, device, dtype):
        moved = self.astype(dtype)
        moved.gpu = device != "cpu"
        return moved

    def cpu(self):
        copied = self.copy()
        copied.gpu = False
        return copied

    def numpy(self):
        assert not self.gpu
        return np.asarray(self)


def tensor(values):
    return np.asarray(values, np.float32).view(Tensor)


def code_of(page, *, size=64):
    """The blocks of a page as one program, with few faces and texels."""
    code = "\n".join(_BLOCK.findall((HOW_TO / page).read_text("utf-8")))
    code = re.sub(r"\bsize=\d+", f"size={size}", code)
    code = re.sub(r"(points\(done\.mesh|resolution = 4), \d+", rf"\1, {size}", code)
    code = re.sub(r"\bn_faces=[\d_]+,\s*", "", code)
    return code.replace("texbake.finish(", "finish(")


@pytest.fixture
def ball():
    mesh = icosphere(3)
    return mesh.positions * [1.0, 2.0, 1.5], np.array(mesh.faces)


def run(code, **names):
    def finish(*arguments, **options):
        return texbake.finish(*arguments, **{"n_faces": 300, **options})

    scope = {"finish": finish, **names}
    exec(compile(code, "page", "exec"), scope)
    return scope


def test_finish_a_generated_mesh(ball, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    torch = types.ModuleType("torch")
    torch.no_grad, torch.from_numpy, torch.float32 = nullcontext, tensor, np.float32
    monkeypatch.setitem(sys.modules, "torch", torch)
    vertices, faces = ball
    rng = np.random.default_rng(0)
    matrix = np.array([[100.0, 0, 0, 128], [0, 100, 0, 128], [0, 0, 0, 1]])
    scope = run(
        code_of("generated-meshes.md"), vertices=vertices, faces=faces,
        voxels=rng.random((8, 8, 8, 3)), centers=vertices, opacities=np.ones(len(vertices)),
        colors=rng.random((len(vertices), 3)),
        field=lambda points: tensor(np.abs(np.tile(points, 2)[:, :5]) / 4),
        photographs=[(rng.random((256, 256, 3)), matrix, np.array([0.0, 0.0, 9.0]))],
    )  # fmt: skip
    assert texbake.read_mesh("model.glb").n_faces <= 300
    for name in "displacement.exr", "texture.png", "model.obj":
        assert Path(name).stat().st_size > 100
    assert scope["points"].mask.any() and len(scope["uvs"]) == len(scope["mapping"])


def test_trellis(ball, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "xatlas", None)
    vertices, faces = ball
    gaussian = types.SimpleNamespace(
        get_xyz=tensor(vertices),
        get_features=tensor(vertices[:, None, :]),
        get_opacity=tensor(np.ones((len(vertices), 1))),
    )
    mesh = types.SimpleNamespace(vertices=tensor(vertices), faces=faces.view(Tensor))
    run(code_of("trellis.md"), outputs={"mesh": [mesh], "gaussian": [gaussian]})
    low = texbake.read_mesh("model.glb")
    np.testing.assert_allclose(np.ptp(low.bounds, axis=0), [2, 3, 4], rtol=0.1)  # upright
    assert sys.modules["xatlas"] is texbake.compat.xatlas


def test_hunyuan3d(ball, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "xatlas", None)
    vertices, faces = ball
    mesh = trimesh.Trimesh(vertices, faces)
    mapping, indices, uvs = texbake.parametrize(vertices, faces)
    painted = trimesh.Trimesh(vertices[mapping], indices, process=False)
    painted.visual = trimesh.visual.TextureVisuals(
        uv=uvs,
        material=trimesh.visual.material.PBRMaterial(
            baseColorTexture=Image.new("RGB", (64, 64), (200, 100, 50))
        ),
    )
    scope = run(code_of("hunyuan3d.md"), mesh=mesh, painted=painted)
    assert texbake.read_mesh("shape.glb").n_faces <= 300
    (material,) = scope["done"].materials.materials
    linear = pytest.approx((0.5776, 0.1274, 0.0319), abs=1e-3)
    assert material.channels["base-color"].factor == linear


@pytest.fixture
def comfyui(tmp_path, monkeypatch):
    """Modules of ComfyUI, as far as the node uses them."""
    paths, management = types.ModuleType("folder_paths"), types.ModuleType("comfy.model_management")
    comfy, utils = types.ModuleType("comfy"), types.ModuleType("comfy.utils")
    paths.get_output_directory = lambda: str(tmp_path)
    paths.get_save_image_path = lambda prefix, folder: (folder, "texbake", 7, "", prefix)
    management.throw_exception_if_processing_interrupted = lambda: None
    utils.shown = []
    utils.ProgressBar = lambda total: types.SimpleNamespace(update_absolute=utils.shown.append)
    comfy.utils, comfy.model_management = utils, management
    modules = {"folder_paths": paths, "comfy": comfy}
    modules |= {"comfy.utils": utils, "comfy.model_management": management}
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    scope = {}
    (code,) = _BLOCK.findall((HOW_TO / "comfyui.md").read_text("utf-8"))
    exec(compile(code, "node", "exec"), scope)
    return scope["NODE_CLASS_MAPPINGS"]["TexbakeFinish"](), management, utils


def test_the_comfyui_node_writes_a_file_per_mesh(comfyui, ball, tmp_path):
    node, _, utils = comfyui
    vertices, faces = ball
    batch = types.SimpleNamespace(
        vertices=[tensor(vertices), tensor(2 * vertices)], faces=[faces.view(Tensor)] * 2
    )
    kinds = node.INPUT_TYPES()["required"]
    assert kinds["mesh"] == ("MESH",)
    options = {name: kind[1]["default"] for name, kind in kinds.items() if len(kind) > 1}
    answer = getattr(node, node.FUNCTION)(batch, **options | {"triangles": 200, "size": 64})
    names = [f"texbake_0000{i}_.glb" for i in (7, 8)]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert [file["filename"] for file in answer["ui"]["3d"]] == names
    assert answer["result"] == (str(tmp_path / names[0]),)
    assert texbake.read_mesh(tmp_path / names[1]).n_faces <= 200
    assert 100 in utils.shown and all(0 <= share <= 100 for share in utils.shown)


def test_the_comfyui_node_can_be_interrupted_and_shows_errors(comfyui, ball, tmp_path):
    node, management, _ = comfyui
    vertices, faces = ball

    class InterruptedByUserError(Exception):
        pass

    def interrupt():
        raise InterruptedByUserError

    mesh = types.SimpleNamespace(vertices=[tensor(vertices)], faces=[faces.view(Tensor)])
    empty = types.SimpleNamespace(vertices=[tensor(vertices)], faces=[faces[:0].view(Tensor)])
    with pytest.raises(TexbakeError, match="it has no faces"):
        node.finish(empty, 200, 64, "x")
    management.throw_exception_if_processing_interrupted = interrupt
    with pytest.raises(InterruptedByUserError):
        node.finish(mesh, 200, 64, "x")
    assert list(tmp_path.iterdir()) == []
