"""Places for files: folders of this machine, and URLs through fsspec; the lock of a build.

Based on: fsspec, "Filesystem interfaces for Python", https://filesystem-spec.readthedocs.io.
"""

from __future__ import annotations

import glob
import os
import secrets
import shutil
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from texbake.errors import FileError, TexbakeError, require_library
from texbake.files import make_folder, replacing


def is_url(place: str) -> bool:
    """Whether a place is a URL, not a path."""
    return "://" in place


def file_signature(path: str | os.PathLike[str]) -> tuple[int, ...] | None:
    """Size, times and inode of a local file, which programs cannot all set; None if missing."""
    try:
        status = os.stat(path)  # noqa: PTH116  # of many thousands
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino


class LocalFolder:
    """A folder, which several machines may share; names of files in it have `/` between folders."""

    def __init__(self, place: str) -> None:
        self.place = place

    def path(self, name: str) -> str:
        """Return the full path of a name."""
        return f"{self.place}/{name}"

    def read(self, name: str) -> bytes | None:
        """Return the content of a file, None if it is missing."""
        try:
            return Path(self.path(name)).read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise FileError(f"{self.path(name)}: cannot be read: {error.strerror}") from error

    def signature(self, name: str) -> tuple[int, ...] | None:
        """Return the size, times and inode of a file; None if it is missing."""
        return file_signature(self.path(name))

    def fetch(self, name: str, folder: Path) -> Path:
        """Return the file itself."""
        return Path(self.path(name))

    def put(self, source: Path, name: str) -> None:
        """Copy a file, sharing its blocks if the file system can."""
        target = Path(self.path(name))
        with file_errors(target):
            make_folder(target.parent)
            with replacing(target) as temporary:
                copy_file(source, temporary)

    def put_folder(self, source: Path, name: str, last: str) -> None:
        """Rename a folder of the same file system; an existing one is kept."""
        target = Path(self.path(name))
        with file_errors(target):
            make_folder(target.parent)
            try:
                source.rename(target)
            except OSError:
                if (target / last).is_file():  # another worker was first with the same
                    shutil.rmtree(source)
                else:  # an incomplete entry is in the way, or something else is wrong
                    self.remove(name)
                    source.rename(target)

    def remove(self, name: str) -> None:
        """Remove a folder: rename it first, so that it is gone at once, and then delete it."""
        target = Path(self.path(name))
        with file_errors(target):
            doomed = target.with_name(f"{target.name}.{secrets.token_hex(4)}")
            with suppress(FileNotFoundError):
                target.rename(doomed)
                shutil.rmtree(doomed)


class RemoteFolder:
    """A folder behind a URL, through fsspec."""

    def __init__(self, place: str) -> None:
        self.place = place.rstrip("/")
        fs, self._root = _file_system(self.place)
        self._fs = fs

    def path(self, name: str) -> str:
        """Return the URL of a name."""
        return f"{self.place}/{name}"

    def read(self, name: str) -> bytes | None:
        """Return the content of a file, None if it is missing."""
        with file_errors(self.path(name)):
            try:
                content: bytes = self._fs.cat_file(self._at(name))
            except (FileNotFoundError, NotADirectoryError, KeyError):
                return None
            return content

    def signature(self, name: str) -> tuple[str, ...] | None:
        """Return what the file system reports on a file, as one word; None if it is missing."""
        with file_errors(self.path(name)):
            try:
                self._fs.invalidate_cache()
                return (str(self._fs.ukey(self._at(name))),)
            except (FileNotFoundError, NotADirectoryError, KeyError):
                return None

    def fetch(self, name: str, folder: Path) -> Path:
        """Copy the file into a folder of this machine."""
        with file_errors(self.path(name)):
            copy = folder / secrets.token_hex(4) / name.rsplit("/", 1)[-1]
            copy.parent.mkdir(parents=True)
            self._fs.get_file(self._at(name), str(copy))
            return copy

    def put(self, source: Path, name: str) -> None:
        """Upload a file under a temporary name and rename it."""
        with file_errors(self.path(name)):
            self._fs.makedirs(self._at(name).rsplit("/", 1)[0], exist_ok=True)
            temporary = f"{self._at(name)}.{secrets.token_hex(4)}.part"
            try:
                self._fs.put_file(str(source), temporary)
                self._fs.mv(temporary, self._at(name))
            except BaseException:
                with suppress(Exception):
                    self._fs.rm_file(temporary)
                raise

    def put_folder(self, source: Path, name: str, last: str) -> None:
        """Upload the files of a folder, `last` after all others, and remove the folder."""
        files = [path for path in source.rglob("*") if path.is_file()]
        for path in sorted(files, key=lambda path: path.name == last):
            self.put(path, f"{name}/{path.relative_to(source).as_posix()}")
        shutil.rmtree(source)

    def remove(self, name: str) -> None:
        """Remove a folder if it exists."""
        with file_errors(self.path(name)), suppress(FileNotFoundError):
            self._fs.rm(self._at(name), recursive=True)

    def _at(self, name: str) -> str:
        return f"{self._root}/{name}"


Location = LocalFolder | RemoteFolder


def location_of(place: str | os.PathLike[str]) -> Location:
    """Return the place of a path or a URL."""
    text = os.fspath(place)
    return RemoteFolder(text) if is_url(text) else LocalFolder(text)


def matches(pattern: str, folder: Path) -> list[str]:
    """Files below a folder, or URLs, that match a pattern, or that it names, sorted."""
    if is_url(pattern):
        fs, root = _file_system(pattern)
        with file_errors(pattern):
            found = [fs.unstrip_protocol(name) for name in fs.glob(root) if fs.isfile(name)]
        return sorted(found)
    full = os.path.join(folder, pattern)  # noqa: PTH118
    if os.path.isfile(full):  # noqa: PTH113
        return [full]
    names = glob.iglob(pattern, root_dir=folder, recursive=True)  # noqa: PTH207
    paths = (os.path.join(folder, name) for name in names)  # noqa: PTH118
    return sorted(path for path in paths if os.path.isfile(path))  # noqa: PTH113


def _file_system(url: str) -> tuple[Any, str]:
    """Return the file system of a URL, and the path in it."""
    fsspec = require_library("fsspec", url, '"texbake[dask]"')
    with file_errors(url):
        try:
            fs, path = fsspec.core.url_to_fs(url)
        except (ImportError, ValueError) as error:
            raise FileError(f"{url}: cannot be reached: {error}") from error
    return fs, str(path).rstrip("/")


@contextmanager
def file_errors(place: object) -> Iterator[None]:
    """Turn any error at a place into a `FileError`; each file system has its own types of them."""
    try:
        yield
    except TexbakeError:
        raise
    except Exception as error:
        reason = getattr(error, "strerror", None)
        if reason is None:
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise FileError(f"{place}: cannot be used: {reason}; nothing in it was changed") from error


_POLL_SECONDS = 0.2
_FICLONE = 0x40049409  # linux/fs.h: share the blocks of another file


@contextmanager
def locked(
    path: Path, *, wait: bool = True, note: Callable[[str], None] | None = None
) -> Iterator[None]:
    """Hold a lock within the block, which the system releases however the process ends."""
    lock = FileLock(path)
    holder = path.with_name(f"{path.name}.holder")
    try:
        try:
            lock.acquire(blocking=False)
        except Timeout:
            by = "just started"
            with suppress(OSError, UnicodeDecodeError):
                by = holder.read_text(encoding="utf-8").strip() or by
            message = f"{path.parent.parent}: another build is running in this folder ({by})"
            if not wait:
                raise FileError(f"{message}; wait for it, or build in another folder") from None
            if note is not None:
                note(f"{message}; waiting for it")
            lock.acquire(poll_interval=_POLL_SECONDS)
    except FileError:
        raise
    except OSError as error:
        raise FileError(
            f"{path}: cannot be locked: {error.strerror or error}; "
            "give a `folder` on a file system that has locks"
        ) from error
    try:
        holder.write_text(f"process {os.getpid()} on {socket.gethostname()}", encoding="utf-8")
        yield
    finally:
        with suppress(OSError):
            holder.unlink()
        lock.release()


def copy_file(source: Path, target: Path) -> None:
    """Copy a file, sharing its blocks if the file system can."""
    with source.open("rb") as reader, target.open("wb") as writer:
        try:
            import fcntl

            fcntl.ioctl(writer.fileno(), _FICLONE, reader.fileno())
        except (ImportError, OSError):
            shutil.copyfileobj(reader, writer, 1 << 20)
