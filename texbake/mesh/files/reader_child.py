"""The process that reads a file with a third-party library, and answers requests about it.

`reader_process` starts it. An answer is a pair: "answer", with the result and the warnings; the
name of an error, with its message; or "bug", with a traceback.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from texbake.child import LIMITS, serve
from texbake.errors import FileFormatError, TexbakeError, heard_warnings
from texbake.limits import ALLOW_OUTSIDE, is_within
from texbake.mesh.files.usd_stage import require_usd

REQUESTS = {
    "mesh": ("texbake.mesh.files.usd", "mesh_of_stage"),
    "materials": ("texbake.mesh.files.usd_materials", "materials_of_stage"),
    "contents": ("texbake.mesh.files.usd_materials", "contents_of_stage"),
    "files": (__name__, "files_of_stage"),
    "trimesh": ("texbake.mesh.files.trimesh_read", "mesh_of_trimesh"),
}
"""Requests, and the module and function that answer each, given the path."""


def answer_request(request: tuple[str, str]) -> tuple[str, Any]:
    """Answer a request about a file."""
    name, path = request
    heard: list[str] = []
    try:
        with heard_warnings(heard.append):
            return "answer", (_answer(name, path), heard)
    except MemoryError:
        return (
            FileFormatError.__name__,
            f"{path}: reading it takes more memory than a file of its size may; export it again, "
            "or, if you trust it, read it with texbake --allow-outside",
        )
    except TexbakeError as error:
        return type(error).__name__, str(error)
    except Exception:
        return "bug", traceback.format_exc()


def _answer(request: str, path: str) -> Any:
    module, name = REQUESTS[request]
    answer: Callable[[str], Any] = getattr(import_module(module), name)
    is_usd = request != "trimesh"
    if is_usd:
        require_usd(path)
    if os.environ.get(ALLOW_OUTSIDE) == "1":
        return answer(path)
    LIMITS.start()
    LIMITS.allow(Path(path).stat().st_size)
    # As long as layers are held, they are not read a second time.
    held = list(_layers(path)) if is_usd else []
    found = answer(path)
    del held
    return found


def _layers(path: str) -> Iterator[Any]:
    """Layers that a file is composed of, and lie in its folder; the limits grow with each."""
    from pxr import Sdf, Tf

    folder = Path(path).parent
    seen = {os.path.realpath(path)}
    waiting = [str(path)]
    while waiting:
        with suppress(Tf.ErrorException, UnicodeDecodeError):  # is reported when it is read
            layer = Sdf.Layer.FindOrOpen(waiting.pop())
            if layer is None:
                continue
            yield layer
            for name in layer.GetCompositionAssetDependencies():
                place = layer.ComputeAbsolutePath(name)
                file = place.partition("[")[0]  # of a package, the package itself
                real = os.path.realpath(file)
                if place and is_within(folder, file) and Path(file).is_file():
                    if real not in seen:
                        LIMITS.allow(Path(file).stat().st_size)
                    if place not in seen:
                        waiting.append(place)
                    seen |= {real, place}


def files_of_stage(path: str) -> list[str]:
    """Files that a USD file is composed of, and those that it names; its own name is left out.

    Images in tiles are those that exist.
    """
    from pxr import Tf, UsdUtils

    unheard = UsdUtils.CoalescingDiagnosticDelegate()  # silences warnings of missing files
    try:
        layers, assets, missing = UsdUtils.ComputeAllDependencies(path)
    except Tf.ErrorException:
        return []
    finally:
        del unheard
    names = [*(layer.realPath for layer in layers), *assets, *missing]
    return [str(name) for name in names if name and Path(name) != Path(path)]


if __name__ == "__main__":
    serve(answer_request)
