"""`-` as the name of a mesh: standard input or standard output.

The mesh passes through a file in a temporary folder, whose name no message shows. With `-o -` only
the mesh goes to standard output; everything else that is printed goes to stderr.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import click

from texbake import FileError, OptionError
from texbake.errors import FileFormatError
from texbake.files import scratch_folder
from texbake.mesh.files import MESH_SUFFIXES, WRITABLE_MESH_SUFFIXES
from texbake.verbs.verb import Reads, Verb, Writes, paths_of

from .messages import STREAMS

_STREAM = Path("-")
# What files of a format begin with; OBJ files begin with any statement.
_BEGINNINGS = {
    b"glTF": ".glb", b"ply": ".ply", b"OFF": ".off", b"solid": ".stl", b"Kaydara": ".fbx",
    b"PXR-USDC": ".usdc", b"#usda": ".usda",
}  # fmt: skip
_FORMATS = "from_format", "to_format"
_STL_HEAD, _STL_FACE = 84, 50


@contextmanager
def standard_streams(verb: Verb, values: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield values in which files stand for `-`; write the output once the block has ended."""
    reads, writes = (
        [part for part in verb.of_kind(kind) if _STREAM in paths_of(values.get(part.name))]
        for kind in (Reads, Writes)
    )
    if not (reads or writes):
        _check_used(values, *_FORMATS)
        yield dict(values)
        return
    _check_streams(values, reads, writes)
    chosen = dict(values) | {name: None for name in _FORMATS if name in values}
    with scratch_folder() as folder:
        click.get_current_context().meta[STREAMS] = f"{folder}/"
        if reads:
            path = _received(folder, values.get("from_format"))
            chosen[reads[0].name] = (path,) if reads[0].many else path
        if not writes:
            _check_used(values, "to_format")
            yield chosen
            return
        output = folder / f"stdout{_suffix_of_output(values, chosen, verb)}"
        stream = sys.stdout.buffer
        if stream.isatty():
            raise OptionError("output: standard output is a terminal; redirect it to a file")
        click.get_current_context().with_resource(redirect_stdout(sys.stderr))
        yield {**chosen, writes[0].name: output}
        try:
            with output.open("rb") as file:
                shutil.copyfileobj(file, stream)
            stream.flush()
        except BrokenPipeError:  # the reader has closed the pipe, as `head` does
            raise
        except OSError as error:
            raise FileError(f"standard output: cannot be written: {error.strerror}") from error


def _check_streams(values: Mapping[str, Any], reads: list[Reads], writes: list[Writes]) -> None:
    """Raise `OptionError` unless the one mesh of a command, or its output, is a stream."""
    if len(reads) > 1:
        raise OptionError("two meshes cannot both come from standard input; name a file for one")
    parts: list[Reads | Writes] = [*reads, *writes]
    for part in parts:
        format_name = "from_format" if isinstance(part, Reads) else "to_format"
        if part.kind != "mesh" or format_name not in values:
            raise OptionError(f"{part.name}: - is not possible here; name a file")
        if len(paths_of(values[part.name])) > 1:
            raise OptionError(f"{part.name}: - is not possible together with other files")


def _check_used(values: Mapping[str, Any], *names: str) -> None:
    for name in names:
        if values.get(name) is not None:
            raise OptionError(f"{name}: this is only for -; the suffix of a file gives its format")


def _received(folder: Path, suffix: str | None) -> Path:
    """Return a file with the content of standard input."""
    path = folder / "stdin"
    with path.open("wb") as file:
        shutil.copyfileobj(sys.stdin.buffer, file)
    if path.stat().st_size == 0:
        raise FileFormatError("standard input: it is empty; pipe a mesh into it")
    return path.rename(path.with_suffix(f".{suffix}" if suffix else _sniffed(path)))


def _sniffed(path: Path) -> str:
    """Return the suffix of a mesh by how it begins."""
    with path.open("rb") as file:
        head = file.read(_STL_HEAD)
    n_faces = int.from_bytes(head[-4:], "little")
    if len(head) == _STL_HEAD and path.stat().st_size == _STL_HEAD + _STL_FACE * n_faces:
        return ".stl"
    for beginning, suffix in _BEGINNINGS.items():
        if head.startswith(beginning):
            return suffix
    if b"\0" in head or head.startswith(b"{"):
        raise FileFormatError("standard input: the format is not clear; name it with --from FORMAT")
    return ".obj"


def _suffix_of_output(values: Mapping[str, Any], chosen: Mapping[str, Any], verb: Verb) -> str:
    """Return the suffix that is asked for, or else that of the input."""
    if values.get("to_format") is not None:
        return f".{values['to_format']}"
    inputs = [path for part in verb.of_kind(Reads) for path in paths_of(chosen.get(part.name))]
    suffix = inputs[0].suffix.lower() if inputs else ""
    if suffix in WRITABLE_MESH_SUFFIXES:
        return suffix
    raise OptionError(
        f"output: {suffix or 'the format'} cannot be written; choose one: --to FORMAT"
    )


def format_options(verb: Verb) -> list[click.Option]:
    """Return the options of a command that takes a mesh and writes one, or only prints."""
    reads = [part for part in verb.of_kind(Reads) if part.name in ("mesh", "meshes")]
    outputs = [part.kind for part in verb.of_kind(Writes) if part.name == "output"]
    if not reads or outputs not in ([], ["mesh"]):
        return []
    text = "Format of the mesh from standard input (-).  [default: found from the data]"
    options = [_format_option("--from", text, MESH_SUFFIXES)]
    if outputs:
        text = "Format of the mesh to standard output (-).  [default: that of the input]"
        options.append(_format_option("--to", text, WRITABLE_MESH_SUFFIXES))
    return options


def _format_option(flag: str, text: str, suffixes: tuple[str, ...]) -> click.Option:
    words = click.Choice([suffix.removeprefix(".") for suffix in suffixes])
    name = f"{flag.removeprefix('--')}_format"
    return click.Option([flag, name], type=words, metavar="FORMAT", help=text)
