"""Read files whole, and write them atomically: to a temporary file beside them, then rename it.

Files that belong together appear together: those of a job, or of any `appearing_together` block.
"""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sized
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from itertools import chain
from pathlib import Path
from typing import TypeVar

from texbake.errors import FileError, FileFormatError
from texbake.unfinished import MOVING, PREFIX, scratch_prefix, unfinished_name

PathLike = str | os.PathLike[str]
Content = TypeVar("Content", bound=Sized)


class _Waiting:
    """Finished temporary files by their targets, None for one to remove; folders made for them."""

    def __init__(self) -> None:
        self.files: dict[Path, Path | None] = {}
        self.folders: list[Path] = []


_WAITING: ContextVar[_Waiting | None] = ContextVar("waiting files", default=None)
_SCRATCH_FOLDERS: set[Path] = set()


def require_file(path: PathLike) -> None:
    """Raise `FileError` where there is no regular file; opening a pipe might wait forever."""
    try:
        mode = Path(path).stat().st_mode
    except (FileNotFoundError, NotADirectoryError) as error:
        raise FileError(f"{path}: there is no such file; check its name") from error
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read: {_reason(error)}") from error
    if stat.S_ISDIR(mode):
        raise FileError(f"{path}: it is a folder; give the name of a file in it")
    if not stat.S_ISREG(mode):
        raise FileError(f"{path}: it is not a regular file; copy its content to one")


def check_name(path: PathLike) -> None:
    """Raise `FileError` for a name that no file or folder can have, wherever it may be missing."""
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: it cannot be the name of a file: {_reason(error)}") from error


def _reason(error: OSError | ValueError) -> str:
    """Return what is wrong with a name; a ValueError is of one that has a null character."""
    return getattr(error, "strerror", None) or str(error)


def is_file(path: PathLike) -> bool:
    """Whether there is a regular file of this name; False for a name that no file can have."""
    try:
        return Path(path).is_file()
    except OSError:  # such as a name that is too long
        return False


def is_folder(path: PathLike) -> bool:
    """Whether there is a folder of this name; False for a name that no folder can have."""
    try:
        return Path(path).is_dir()
    except OSError:  # such as a name that is too long
        return False


def read_bytes(path: PathLike) -> bytes:
    """Read the bytes of a file."""
    return read_whole(path, Path.read_bytes)


def read_whole(path: PathLike, read: Callable[[Path], Content]) -> Content:
    """Return what `read` makes of a file; raise where it cannot be read, or is empty."""
    require_file(path)
    try:
        content = read(Path(path))
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(content) == 0:
        raise FileFormatError(f"{path}: the file is empty")
    return content


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Yield a temporary path next to `path`, of its suffix; move the file if the block succeeds.

    If the block raises, `path` is unchanged; a link stays one. Within `appearing_together` the file
    is found at `written_file(path)` until that block ends.
    """
    target = _target_of(path)
    waiting = _WAITING.get()
    soon_gone = target.name.startswith(PREFIX) or _is_scratch(target)
    # The name does not contain that of `path`: some writers accept only names that are UTF-8.
    temporary = target.parent / unfinished_name(target.parent, target.suffix)
    try:
        # Create the file first, so that an unwritable folder fails before the work, not after it.
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, _mode_for(target)))
        yield temporary
        if soon_gone:
            temporary.replace(target)
        elif waiting is None:
            _put_in_place({target: temporary})
        else:
            before = waiting.files.get(target)
            waiting.files[target] = temporary
            if before is not None:
                before.unlink(missing_ok=True)
    except OSError as error:
        if isinstance(error, FileError):
            raise
        raise _unwritable(path, error, "nothing was changed") from error
    finally:
        if waiting is None or waiting.files.get(target) != temporary:
            temporary.unlink(missing_ok=True)


def _unwritable(path: PathLike, error: OSError, state: str) -> FileError:
    return FileError(f"{path}: cannot be written: {error.strerror or error}; {state}")


@contextmanager
def appearing_together() -> Iterator[None]:
    """Let the files that a block writes appear when it ends, all of them, or none if it raises.

    A block within another one belongs to it. Also a decorator of functions.
    """
    if _WAITING.get() is not None:
        yield
        return
    waiting = _Waiting()
    token = _WAITING.set(waiting)
    try:
        yield
        _put_in_place(waiting.files)
        waiting.folders.clear()
    finally:
        _WAITING.reset(token)
        for temporary in waiting.files.values():
            if temporary is not None:
                temporary.unlink(missing_ok=True)
        for folder in reversed(waiting.folders):
            with suppress(OSError):  # it is not empty
                folder.rmdir()


def remove_file(path: PathLike) -> None:
    """Remove a file if it exists; within `appearing_together`, when that block ends."""
    target = _target_of(path)
    waiting = _WAITING.get()
    if waiting is None or _is_scratch(target):
        try:
            target.unlink(missing_ok=True)
        except OSError as error:
            raise FileError(f"{path}: cannot be removed: {error.strerror or error}") from error
        return
    before = waiting.files.get(target)
    waiting.files[target] = None
    if before is not None:
        before.unlink(missing_ok=True)


def _put_in_place(waiting: Mapping[Path, Path | None]) -> None:
    """Move finished files, already on the disk, to their targets, not divided by signals."""
    moved = {target: temporary for target, temporary in waiting.items() if temporary is not None}
    removed = [str(target) for target in waiting if target not in moved and target.is_file()]
    for target, temporary in moved.items():
        try:
            _write_to_disk(temporary)
        except OSError as error:  # such as a disk that is full only now
            raise _unwritable(target, error, "nothing was changed") from error
    moves = map(os.replace, [*map(str, moved.values())], [*map(str, moved)])
    try:
        with MOVING:
            # One call that runs no Python, and so delivers no signal: Ctrl-C comes before or after.
            deque(chain(moves, map(os.unlink, removed)), maxlen=0)
    except OSError as error:
        state = "nothing was changed" if len(waiting) == 1 else "some files of this job are older"
        raise _unwritable(error.filename2 or error.filename, error, state) from error


def written_file(path: PathLike) -> Path:
    """Return where the content of a file is: at its temporary path while it waits for others."""
    waiting = _WAITING.get()
    return (waiting.files.get(_target_of(path)) if waiting else None) or Path(path)


def new_scratch_folder() -> Path:
    """Make a temporary folder, which the caller removes."""
    return Path(tempfile.mkdtemp(prefix=scratch_prefix(Path(tempfile.gettempdir()))))


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make a temporary folder, which is removed after the block."""
    # Named before it is made: a signal while it is being made must leave nothing.
    parent = Path(os.path.realpath(tempfile.gettempdir()))
    folder = parent / f"{scratch_prefix(parent)}{os.urandom(6).hex()}"
    _SCRATCH_FOLDERS.add(folder)
    try:
        folder.mkdir(mode=0o700)
        yield folder
    finally:
        _SCRATCH_FOLDERS.discard(folder)
        # Where open files cannot be removed, the system clears its own folder for them.
        shutil.rmtree(folder, ignore_errors=True)


def _write_to_disk(path: Path) -> None:
    """Write the content of a file to the disk before anything else is written."""
    descriptor = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _is_scratch(path: Path) -> bool:
    return not _SCRATCH_FOLDERS.isdisjoint(path.parents)


def _mode_for(target: Path) -> int:
    """Return the permissions of the file that is replaced, or those of the umask for a new one."""
    try:
        return target.stat().st_mode & 0o777
    except OSError:
        return 0o666


def check_writable(path: PathLike) -> None:
    """Raise `FileError` before a long job if a file cannot be written at `path`."""
    target = _target_of(path)
    if not os.access(target.parent, os.W_OK):
        raise FileError(f"{path}: the folder {target.parent} cannot be written to")


def _target_of(path: PathLike) -> Path:
    """Resolve the symbolic links of a path; raise `FileError` if no file can be written there."""
    try:
        target = Path(os.path.realpath(path))
        with suppress(FileNotFoundError, NotADirectoryError):
            target.lstat()
    except (OSError, ValueError) as error:  # such as a name that is too long
        raise FileError(f"{path}: cannot be written: {_reason(error)}") from error
    if target.is_dir():
        raise FileError(f"{path}: it is a folder; give the name of a file in it")
    if target.is_symlink():
        raise FileError(f"{path}: its links form a circle; give another name")
    if target.exists() and not target.is_file():
        # Renaming a file to a device such as /dev/full would remove it for the whole machine.
        raise FileError(f"{path}: it is a device or a pipe; give the name of a file")
    if not target.parent.is_dir():
        raise FileError(f"{path}: there is no folder {target.parent}; create it first")
    return target


def check_folder(folder: PathLike) -> None:
    """Raise `FileError` if files cannot be written to `folder`, existing or not."""
    try:
        there = Path(os.path.realpath(folder))
        while not there.exists():
            there = there.parent
    except (OSError, ValueError) as error:  # such as a name that is too long
        raise FileError(f"{folder}: cannot be made: {_reason(error)}") from error
    if not there.is_dir():
        raise FileError(f"{folder}: {there} is a file; give the name of a folder")
    if not os.access(there, os.W_OK):
        raise FileError(f"{folder}: the folder {there} cannot be written to")


def make_folder(folder: PathLike) -> Path:
    """Create a folder and its missing parents, and return its path."""
    path, waiting = Path(folder), _WAITING.get()
    try:
        if waiting is not None:
            missing = [there for there in (path, *path.parents) if not there.exists()]
            waiting.folders += missing[::-1]
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: the folder cannot be made: {_reason(error)}") from error
    return path


def write_files(folder: PathLike, files: Mapping[str, bytes]) -> list[Path]:
    """Write files into a folder, all or none of them, and return their paths."""
    there = make_folder(folder)
    with appearing_together():
        for name, content in files.items():
            with replacing(there / name) as path:
                path.write_bytes(content)
    return [there / name for name in files]
