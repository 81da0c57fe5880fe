"""Files that third-party libraries read, each in a process of its own.

Some damaged files crash usd-core, trimesh and DracoPy, keep them busy forever, or make them take
memory without limit. So a child process reads such files, with limits of time and memory, and
whatever happens to it becomes an error of one line.

The child is this module, run as a script. An answer is a pair: "answer", with the result and the
warnings; the name of an error, with its message; or "bug", with a traceback.
"""

from __future__ import annotations

import os
import signal
import traceback
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from texbake import errors
from texbake.child import LIMITS, Child, ChildError, serve
from texbake.errors import FileFormatError, TexbakeError, heard_warnings, warn_of
from texbake.files import PathLike, require_file
from texbake.limits import ALLOW_OUTSIDE
from texbake.mesh.files.usd_stage import layers_of_stage, require_usd
from texbake.messages import Classes

# Requests, and the module and function that answer each, given the path.
_REQUESTS = {
    "mesh": ("usd", "mesh_of_stage"),
    "materials": ("usd_materials", "materials_of_stage"),
    "contents": ("usd_materials", "contents_of_stage"),
    "files": ("usd_stage", "files_of_stage"),
    "trimesh": ("trimesh_read", "mesh_of_trimesh"),
    "draco": ("gltf_primitives", "decode_draco"),
}
# One thread reads as fast as several here, and its memory can be limited.
_ONE_THREAD = {"PXR_WORK_THREAD_LIMIT": "1", "MALLOC_ARENA_MAX": "1"}
_OUT_OF_TIME = [-getattr(signal, name, 0) for name in ("SIGXCPU", "SIGALRM")]


def read_in_child(path: PathLike, request: str, classes: Classes) -> Any:
    """Return the answer of a child about a file, and pass on the warnings of its reader."""
    require_file(path)
    child = Child("texbake.mesh.files.reader_process", environment=_ONE_THREAD)
    try:
        kind, answer = child.ask((request, os.fspath(path)), classes=classes)
    except ChildError as error:
        raise FileFormatError(f"{path}: {_ending(error)}") from None
    except (TypeError, ValueError):  # not a pair
        raise FileFormatError(f"{path}: the process that reads it gave an invalid answer") from None
    finally:
        child.end()
    if kind == "bug":
        raise RuntimeError(f"{path}: {answer}")
    if kind != "answer":
        error_class = getattr(errors, str(kind), None)
        if isinstance(error_class, type) and issubclass(error_class, TexbakeError):
            raise error_class(str(answer))
        raise FileFormatError(str(answer))
    value, warnings = answer
    for line in warnings:
        warn_of(path, str(line).removeprefix(f"{os.fspath(path)}: "))
    return value


def _ending(error: ChildError) -> str:
    """Return why a child gave no answer."""
    if error.is_from_others:
        return "the process that reads it was ended twice; read it again"
    if error.code and error.code in _OUT_OF_TIME:
        return (
            "reading it takes longer than a file of its size may; export it again, or, if you "
            "trust it, read it with texbake --allow-outside"
        )
    return f"the library that reads it stopped ({error.how}); the file is damaged; export it again"


def answer_request(request: tuple[str, str]) -> tuple[str, Any]:
    """Answer a request about a file, in the child."""
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
    module, name = _REQUESTS[request]
    answer: Callable[[str], Any] = getattr(import_module(f"texbake.mesh.files.{module}"), name)
    is_usd = module.startswith("usd")
    if is_usd:
        require_usd(path)
    if os.environ.get(ALLOW_OUTSIDE) == "1":
        return answer(path)
    LIMITS.start()
    LIMITS.allow(Path(path).stat().st_size)
    # As long as layers are held, they are not read a second time.
    held = list(layers_of_stage(path)) if is_usd else []
    found = answer(path)
    del held
    return found


if __name__ == "__main__":
    serve(answer_request)
