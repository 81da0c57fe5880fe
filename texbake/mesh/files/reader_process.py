"""Files that third-party libraries read, each in a process of its own.

usd-core, Pixar's library, is written for files that one trusts: some damaged files crash it or keep
it busy forever. trimesh makes node instances without limit. So a child process reads such files,
with limits of time and memory, and whatever happens to it becomes an error of one line.
"""

from __future__ import annotations

import os
import signal
from typing import Any

from texbake import errors
from texbake.child import Child, ChildError
from texbake.errors import FileFormatError, TexbakeError, warn_of
from texbake.files import PathLike, require_file
from texbake.messages import Classes

_CHILD = "texbake.mesh.files.reader_child"
# One thread reads as fast as several here, and its memory can be limited.
_ONE_THREAD = {"PXR_WORK_THREAD_LIMIT": "1", "MALLOC_ARENA_MAX": "1"}
_OUT_OF_TIME = [-getattr(signal, name, 0) for name in ("SIGXCPU", "SIGALRM")]


def read_in_child(path: PathLike, request: str, classes: Classes) -> Any:
    """Return the answer of `reader_child` about a file, and pass on the warnings of its reader."""
    require_file(path)
    child = Child(_CHILD, environment=_ONE_THREAD)
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
        raise _error(str(kind), str(answer))
    found, heard = answer
    for line in heard:
        warn_of(path, str(line).removeprefix(f"{os.fspath(path)}: "))
    return found


def _error(kind: str, message: str) -> TexbakeError:
    """Return the error of a name."""
    found = getattr(errors, kind, None)
    if isinstance(found, type) and issubclass(found, TexbakeError):
        return found(message)
    return FileFormatError(message)


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
