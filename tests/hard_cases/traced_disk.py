"""What a disk may hold after a power cut, from the system calls that a command made.

Content that was not synced may be missing, short or zeros. Names that were made, moved or removed
are on the disk once the folder is synced; until then each of these changes may be there or not, in
any combination. Real file systems keep more of an order.
"""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

_CALLS = (
    "open,openat,creat,write,pwrite64,writev,lseek,ftruncate,truncate,rename,renameat,renameat2,"
    "unlink,unlinkat,rmdir,mkdir,mkdirat,link,linkat,symlink,symlinkat,fsync,fdatasync,"
    "copy_file_range,sendfile,fallocate"
)
_NAMES = ",".join(f"?{call}" for call in _CALLS.split(","))
# A process, a call, its arguments and its result.
_LINE = re.compile(r"(\d+) +(\w+)\((.*)\) += (\d+)(?:<(.*)>)?$")
_BEGUN = re.compile(r"(\d+) +(\w+\(.*) <unfinished \.\.\.>$")
_RESUMED = re.compile(r"(\d+) +<\.\.\. \w+ resumed>(.*)$")
_HEX = re.compile(r"(?:\\x[0-9a-f]{2})+")
_TEXT = re.compile(r'"((?:\\x[0-9a-f]{2})*)"')
_OPENED = re.compile(r"(?:\d+|AT_FDCWD)<([^>]*)>")


def tracing(log: Path) -> list[str]:
    """Return the words that trace a command, whose words follow."""
    return [
        "strace", "-f", "--seccomp-bpf", "-y", "-xx", "-s", "100000000", "-qqq", "-o", str(log),
        "-e", "signal=none", "-e", f"trace={_NAMES}", "-e", "status=successful",
    ]  # fmt: skip


def can_trace() -> bool:
    """Whether strace is installed, and may trace here."""
    if not shutil.which("strace"):
        return False
    done = subprocess.run([*tracing(Path("/dev/null")), "true"], capture_output=True)
    return done.returncode == 0


@dataclass
class Call:
    """A system call that succeeded."""

    name: str
    arguments: str
    result: int
    opened: str
    texts: list[bytes]
    paths: list[str]


def calls(log: Path) -> Iterator[Call]:
    """Read the calls of a trace, in the order in which they ended."""
    begun: dict[str, str] = {}
    for line in log.read_text(encoding="ascii").splitlines():
        if found := _BEGUN.match(line):
            begun[found[1]] = found[2]
            continue
        if found := _RESUMED.match(line):
            line = f"{found[1]} {begun.pop(found[1])}{found[2]}"
        if found := _LINE.match(line):
            _, name, arguments, result, opened = found.groups()
            yield Call(
                name,
                arguments,
                int(result),
                _plain(opened or "").decode(),
                [_plain(text) for text in _TEXT.findall(arguments)],
                [_plain(path).decode() for path in _OPENED.findall(arguments)],
            )


def _plain(text: str) -> bytes:
    return b"".join(bytes.fromhex(run.replace("\\x", "")) for run in _HEX.findall(text))


@dataclass(eq=False)
class File:
    """A file: its content, and what of it was synced."""

    content: bytearray = field(default_factory=bytearray)
    synced: bytes = b""
    offset: int = 0

    def after(self, luck: random.Random) -> bytes:
        """Return a content that it may have after a power cut."""
        now = bytes(self.content)
        if now == self.synced:
            return now
        kind = luck.choice(["synced", "zeros", "short", "whole"])
        return {
            "synced": self.synced,
            "zeros": bytes(len(now)),
            "short": now[: luck.randrange(len(now) + 1)],
            "whole": now,
        }[kind]


@dataclass(eq=False)
class Folder:
    """A folder: its entries, and those that are on the disk."""

    entries: dict[str, File | Folder] = field(default_factory=dict)
    lasting: dict[str, File | Folder] = field(default_factory=dict)


Change = list[tuple[Folder, str, "File | Folder | None"]]
State = dict[str, bytes]


class Disk:
    """A folder of a disk on which calls are replayed.

    Attributes
    ----------
    root : Folder
    pending : list of Change
        Changes of names that are not on the disk.
    versions : dict of str to set
        Contents that files had as they were renamed to their names, whole.
    """

    def __init__(self, folder: Path) -> None:
        self.root = Folder()
        self.pending: list[Change] = []
        self.versions: dict[str, set[bytes]] = {}
        self._top = f"{folder}/"
        self._place = str(folder)
        for path in sorted(folder.rglob("*")):
            parent, name = self._parent(str(path))
            assert parent is not None
            content = b"" if path.is_dir() else path.read_bytes()
            made = Folder() if path.is_dir() else File(bytearray(content), content)
            parent.entries[name] = parent.lasting[name] = made

    def _parent(self, path: str) -> tuple[Folder | None, str]:
        """Return the folder of a path and its name there; None for other places."""
        if not path.startswith(self._top):
            return None, ""
        *folders, name = path.removeprefix(self._top).split("/")
        there: File | Folder | None = self.root
        for folder in folders:
            there = there.entries.get(folder) if isinstance(there, Folder) else None
        return (there, name) if isinstance(there, Folder) else (None, "")

    def _at(self, path: str) -> File | Folder | None:
        if path == self._place:
            return self.root
        parent, name = self._parent(path)
        return None if parent is None else parent.entries.get(name)

    def _change(self, change: Change) -> bool:
        for folder, name, node in change:
            if node is None:
                folder.entries.pop(name, None)
            else:
                folder.entries[name] = node
        self.pending.append(change)
        return True

    def replay(self, call: Call) -> bool:
        """Replay a call; return whether it changed anything in the folder."""
        name = call.name
        if name in ("open", "openat", "creat"):
            return self._open(call)
        if name in ("rename", "renameat", "renameat2"):
            return self._rename(*self._named(call))
        if name in ("mkdir", "mkdirat", "unlink", "unlinkat", "rmdir"):
            parent, there = self._parent(self._named(call)[0])
            made = Folder() if name.startswith("mkdir") else None
            return parent is not None and self._change([(parent, there, made)])
        if name in ("fsync", "fdatasync"):
            return self._sync(self._at(call.paths[0]))
        if name == "truncate":
            file = self._at(self._named(call)[0])
        else:
            file = self._at(call.paths[-1 if name == "copy_file_range" else 0])
        if isinstance(file, File):
            return self._write(file, call)
        return False

    def _named(self, call: Call) -> list[str]:
        """Return the absolute paths that a call names."""
        bases = call.paths if call.name.endswith(("at", "at2")) else []
        names = [text.decode() for text in call.texts]
        bases = bases + [self._place] * (len(names) - len(bases))
        return [
            name if name.startswith("/") else f"{base}/{name}"
            for base, name in zip(bases, names, strict=False)
        ]

    def _open(self, call: Call) -> bool:
        parent, name = self._parent(call.opened)
        if parent is None or "O_DIRECTORY" in call.arguments:
            return False
        node = parent.entries.get(name)
        changed = False
        if node is None and ("O_CREAT" in call.arguments or call.name == "creat"):
            node = File()
            changed = self._change([(parent, name, node)])
        if isinstance(node, File) and ("O_WRONLY" in call.arguments or "O_RDWR" in call.arguments):
            node.offset = len(node.content) if "O_APPEND" in call.arguments else 0
            if "O_TRUNC" in call.arguments and node.content:
                node.content.clear()
                changed = True
        return changed

    def _rename(self, source: str, target: str) -> bool:
        before, old = self._parent(source)
        after, new = self._parent(target)
        if before is None or after is None:
            return False
        node = before.entries[old]
        if isinstance(node, File):
            self.versions.setdefault(target.removeprefix(self._top), set()).add(bytes(node.content))
        return self._change([(before, old, None), (after, new, node)])

    def _sync(self, node: File | Folder | None) -> bool:
        if isinstance(node, File):
            node.synced = bytes(node.content)
        elif node is not None:
            done = [change for change in self.pending if any(f is node for f, _, _ in change)]
            for change in done:
                self.pending.remove(change)
                for folder, name, made in change:
                    if made is None:
                        folder.lasting.pop(name, None)
                    else:
                        folder.lasting[name] = made
        return node is not None

    def _write(self, file: File, call: Call) -> bool:
        numbers = [int(found) for found in re.findall(r", (\d+)", call.arguments)]
        if call.name == "lseek":
            file.offset = call.result
            return False
        if call.name in ("truncate", "ftruncate"):
            size = numbers[-1]
            file.content[:] = file.content[:size] + bytes(max(0, size - len(file.content)))
            return True
        if call.name not in ("write", "pwrite64", "writev"):
            raise NotImplementedError(f"{call.name}({call.arguments[:200]})")
        data = b"".join(call.texts)[: call.result]
        start = numbers[-1] if call.name == "pwrite64" else file.offset
        if len(file.content) < start:
            file.content += bytes(start - len(file.content))
        file.content[start : start + len(data)] = data
        if call.name != "pwrite64":
            file.offset = start + len(data)
        return True

    def now(self) -> State:
        """Return what programs see."""
        return _walked(self.root, lambda folder: folder.entries, lambda f: bytes(f.content))[0]

    def after_a_cut(self, luck: random.Random, share: float) -> tuple[State, set[str]]:
        """Return files and folders as they may be after a power cut now.

        Parameters
        ----------
        luck
        share
            Of the pending changes that are on the disk; 0 for none, 1 for all.
        """
        seen = {}
        for change in self.pending:
            if luck.random() < share:
                for folder, name, node in change:
                    entries = seen.setdefault(folder, dict(folder.lasting))
                    if node is None:
                        entries.pop(name, None)
                    else:
                        entries[name] = node
        return _walked(
            self.root, lambda folder: seen.get(folder, folder.lasting), lambda f: f.after(luck)
        )


def _walked(
    root: Folder,
    entries: Callable[[Folder], dict[str, File | Folder]],
    content: Callable[[File], bytes],
) -> tuple[State, set[str]]:
    files: State = {}
    folders = set()
    waiting = [("", root)]
    while waiting:
        above, folder = waiting.pop()
        for name, node in entries(folder).items():
            if isinstance(node, File):
                files[above + name] = content(node)
            else:
                folders.add(above + name)
                waiting.append((f"{above}{name}/", node))
    return files, folders
