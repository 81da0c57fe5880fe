"""glTF 2.0 files: their JSON document, their buffers, and the arrays that accessors describe.

Whatever a damaged file says, no more memory is taken than the file has bytes, and parts that do not
fit together give one clear error.

Based on: Khronos Group, "glTF 2.0 Specification", version 2.0.1, 2021.
"""

from __future__ import annotations

import base64
import json
import re
from contextlib import suppress
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from texbake.errors import FileError, FileFormatError, quoted, shortened
from texbake.files import PathLike
from texbake.limits import file_beside, real_path
from texbake.mesh.files.gltf_compression import DRACO, EXTENSION, decode_view
from texbake.mesh.files.reader_process import read_in_child
from texbake.mesh.files.source import Cursor, parsed, read_array, without_cycle_search
from texbake.mesh.mesh import AnyArray, ByteArray, FloatArray
from texbake.records import dataclass

MAGIC = b"glTF"
JSON_CHUNK = 0x4E4F534A
BINARY_CHUNK = 0x004E4942
# Required extensions that change nothing about where triangles are, or only the component types
# of attributes, which accessors carry anyway. Any other may hide the mesh itself.
_HARMLESS = re.compile(r"[A-Z]+_(?:materials|texture|lights|animation)_")
INSTANCING = "EXT_mesh_gpu_instancing"
_READ = (
    EXTENSION,
    INSTANCING,
    "MSFT_lod",
    "KHR_mesh_quantization",
    DRACO,
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
)

COMPONENTS: dict[int, np.dtype[Any]] = {
    5120: np.dtype("i1"),
    5121: np.dtype("u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
NEAREST, LINEAR = 9728, 9729
# v down to v up, and back.
FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])


# Attributes (n, width) by the numbers that the file gives them, and the (3 F,) uint32 corners.
DracoMesh = tuple[dict[int, AnyArray], npt.NDArray[np.uint32]]


@dataclass(frozen=True)
class Document:
    """A glTF document, its parts looked up and checked one at a time."""

    path: Path  # of the file, for messages and for what lies beside it
    content: dict[str, Any]  # the JSON object
    binary: ByteArray  # (n,) uint8; the binary chunk of a GLB file, empty where there is none
    # Lists of objects that were checked; thousands of items are looked up in one.
    _checked: set[int] = field(default_factory=set, repr=False, compare=False)
    _lists: dict[str, list[dict[str, Any]]] = field(default_factory=dict, repr=False, compare=False)
    # Compressed views that were read.
    _decoded: dict[int, ByteArray] = field(default_factory=dict, repr=False, compare=False)

    def fail(self, what: str) -> NoReturn:
        """Raise `FileFormatError` that says what is wrong with the file."""
        raise FileFormatError(f"{self.path}: {what}; export it again")

    def items(self, kind: str) -> list[dict[str, Any]]:
        """All objects of a kind, such as "nodes"."""
        return self.objects(self.content, kind)

    def item(self, kind: str, index: Any) -> dict[str, Any]:
        """One object of a kind by its index, checked."""
        items = self._lists.get(kind)
        if items is None:
            items = self._lists[kind] = self.items(kind)
        if type(index) is not int or not 0 <= index < len(items):
            self.fail(f"it has no {kind}[{quoted(index)}]")
        return items[index]

    def objects(self, owner: dict[str, Any], key: str) -> list[dict[str, Any]]:
        """A list of objects that an object holds; empty where there is none."""
        values = owner.get(key, [])
        if id(values) in self._checked:
            return values  # type: ignore[no-any-return]
        if not isinstance(values, list) or set(map(type, values)) - {dict}:
            self.fail(f"{quoted(key)} is not a list of objects")
        if key in owner:
            self._checked.add(id(values))
        return values

    def mapping(self, owner: dict[str, Any], key: str) -> dict[str, Any]:
        """An object that an object holds; empty where there is none."""
        value = owner.get(key, {})
        if not isinstance(value, dict):
            self.fail(f"{quoted(key)} is not an object")
        return value

    def integer(self, owner: dict[str, Any], key: str, default: int | None = None) -> int:
        """A count or an offset: an integer, not negative."""
        value = owner.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 48:
            self.fail(f"{quoted(key)} is {quoted(value)}, not a count")
        return value

    def number(
        self, owner: dict[str, Any], key: str, default: float, *, is_signed: bool = False
    ) -> float:
        """Return a number that an object holds: 0 or more, unless it may be signed."""
        value = owner.get(key, default)
        # Integers of JSON have any length, and those that no float holds are compared all the same.
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not abs(value) < 1e300 or (value < 0.0 and not is_signed):
            self.fail(f"{quoted(key)} is {quoted(value)}, which is not a valid number")
        return float(value)

    def numbers(self, owner: dict[str, Any], key: str, n: int) -> FloatArray | None:
        """Return n numbers that an object holds, or None where it does not."""
        values = owner.get(key)
        if values is None:
            return None
        if (
            not isinstance(values, list)
            or len(values) != n
            or not all(isinstance(value, int | float) and abs(value) < 1e300 for value in values)
        ):
            self.fail(f"{quoted(key)} is not {n} numbers")
        return np.array([float(value) for value in values])

    def texts(self, key: str) -> list[str]:
        """Return a list of strings of the document; empty where there is none."""
        values = self.content.get(key, [])
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            self.fail(f"{quoted(key)} is not a list of names")
        return values

    def accessor(self, index: Any) -> AnyArray:
        """(count, width) values: floats as they are, normalized integers as float64."""
        accessor = self.item("accessors", index)
        count = self.integer(accessor, "count")
        dtype = self._component(accessor)
        width = WIDTHS.get(str(accessor.get("type")), 0)
        if width == 0:
            self.fail(f"accessors[{index}] has the unknown type {quoted(accessor.get('type'))}")
        if "bufferView" in accessor:
            values = self._read(accessor, count, dtype, width)
        else:
            # Zeros, to be replaced in part. A sound mesh has more bytes than vertices.
            if count > self.n_bytes:
                self.fail(f"accessors[{index}] counts {count}, more than the file has bytes")
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._replaced(values.copy(), self.mapping(accessor, "sparse"))
        return self.denormalized(accessor, values)

    def denormalized(self, accessor: dict[str, Any], values: AnyArray) -> AnyArray:
        """Values of an accessor as float64 where it calls its integers normalized."""
        if accessor.get("normalized") is True and values.dtype.kind in "iu":
            return np.maximum(values / float(np.iinfo(values.dtype).max), -1.0)
        return values

    def view_bytes(self, index: Any) -> ByteArray:
        """Bytes of a buffer view, such as an image's file."""
        view = self.item("bufferViews", index)
        packing = self.mapping(self.mapping(view, "extensions"), EXTENSION)
        if not packing:
            return self._stored(view)
        if index not in self._decoded:  # many accessors may share one
            decoded = decode_view(
                self._stored(packing),
                mode=str(packing.get("mode")),
                filter_name=str(packing.get("filter", "NONE")),
                count=self.integer(packing, "count"),
                stride=self.integer(packing, "byteStride"),
            )
            if isinstance(decoded, str):
                self.fail(decoded)
            self._decoded[index] = decoded
        return self._decoded[index]

    def _stored(self, view: dict[str, Any]) -> ByteArray:
        """Bytes of a place in a buffer."""
        buffer_index = self.integer(view, "buffer")
        if buffer_index >= len(self.buffers):
            self.fail(f"it has no buffers[{buffer_index}]")
        start = self.integer(view, "byteOffset", 0)
        stop = start + self.integer(view, "byteLength")
        if stop > len(self.buffers[buffer_index]):
            self.fail("it is cut short: a view reaches past the end of its buffer")
        return self.buffers[buffer_index][start:stop]

    @cached_property
    def buffers(self) -> list[ByteArray]:
        """Bytes of each buffer, as many as it claims."""
        files: dict[str, ByteArray] = {}
        return [self._buffer(i, buffer, files) for i, buffer in enumerate(self.items("buffers"))]

    @cached_property
    def draco(self) -> dict[int, DracoMesh | None]:
        """Meshes that Draco has compressed, by their views; None for one that is damaged."""
        found: dict[int, DracoMesh | None] = read_in_child(self.path, "draco", {})
        return found

    @cached_property
    def n_bytes(self) -> int:
        """Bytes of all buffers together."""
        return sum(map(len, self.buffers))

    def _buffer(self, index: int, buffer: dict[str, Any], files: dict[str, ByteArray]) -> ByteArray:
        """Bytes of a buffer; `files` has those that were read, by their real paths."""
        n_bytes = self.integer(buffer, "byteLength")
        uri = buffer.get("uri")
        if uri is None and self.mapping(self.mapping(buffer, "extensions"), EXTENSION):
            return self.binary[:0]  # its place is taken by compressed views
        if uri is None:
            data = self.binary if index == 0 else self.binary[:0]
        elif not isinstance(uri, str):
            self.fail(f"buffers[{index}] has no readable uri")
        elif uri.startswith("data:"):
            try:
                data = np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8)
            except ValueError:
                self.fail(f"the data of buffers[{index}] is not base64")
        elif "://" in uri:
            self.fail(f"buffers[{index}] is at {quoted(uri)}, and only local files are read")
        else:
            place, source = file_beside(self.path, unquote(uri)), real_path(self.path, unquote(uri))
            if source not in files:  # many buffers may name one
                files[source] = read_array(place)
            data = files[source]
        if len(data) < n_bytes:
            self.fail(f"it is cut short: buffers[{index}] has {len(data)} of {n_bytes} bytes")
        return data[:n_bytes]

    def _component(self, owner: dict[str, Any]) -> np.dtype[Any]:
        component = owner.get("componentType")
        if not isinstance(component, int) or component not in COMPONENTS:
            self.fail(f"the component type {quoted(component)} is not known")
        return COMPONENTS[component]

    def _read(
        self, place: dict[str, Any], count: int, dtype: np.dtype[Any], width: int
    ) -> AnyArray:
        """(count, width) view of values at a place in a buffer view, also with others between."""
        index = place.get("bufferView")
        data = self.view_bytes(index)
        offset = self.integer(place, "byteOffset", 0)
        n_item = dtype.itemsize * width
        stride = self.integer(self.item("bufferViews", index), "byteStride", 0) or n_item
        n_needed = offset + (stride * (count - 1) + n_item if count else 0)
        if n_needed > len(data):
            self.fail("it is cut short: an accessor reaches past the end of its data")
        if count == 0:
            return np.zeros((0, width), dtype)
        return np.ndarray((count, width), dtype, data, offset, strides=(stride, dtype.itemsize))

    def _replaced(self, values: AnyArray, sparse: dict[str, Any]) -> AnyArray:
        count = self.integer(sparse, "count")
        places = self.mapping(sparse, "indices")
        rows = self._read(places, count, self._component(places), 1)[:, 0]
        if count and (rows.dtype.kind == "f" or rows.min() < 0 or rows.max() >= len(values)):
            self.fail("an index of a sparse accessor is out of range")
        replacements = self.mapping(sparse, "values")
        values[rows] = self._read(replacements, count, values.dtype, values.shape[1])
        return values


def read_document(path: PathLike) -> Document:
    """Read the document of a .gltf or .glb file, which differ in their first bytes."""
    return parsed(path, _read_document)


def bytes_beside(document: Document) -> int:
    """Return the bytes of the files of buffers and images beside a document, each counted once."""
    files = set()
    for item in (*document.items("buffers"), *document.items("images")):
        uri = item.get("uri")
        if isinstance(uri, str) and not uri.startswith("data:"):
            with suppress(FileError):  # an image that is not read
                files.add(file_beside(document.path, unquote(uri)))
    return sum(file.stat().st_size for file in files if file.is_file())


def _read_document(path: PathLike) -> Document:
    data = read_array(path)
    binary = data[:0]
    text = data
    if data[:4].tobytes() == MAGIC:
        text, binary = _chunks(path, data)
    try:
        with without_cycle_search():
            content = json.loads(text.tobytes().decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: it is not a glTF file; its JSON does not parse") from error
    if not isinstance(content, dict) or "asset" not in content:
        raise FileFormatError(f"{path}: it is not a glTF file; its JSON names no asset")
    document = Document(Path(path), content, binary)
    version = document.mapping(content, "asset").get("version")
    if not isinstance(version, str | float) or not str(version).startswith("2."):
        document.fail(f"it is glTF {quoted(version)}, and only 2.0 is read")
    for extension in document.texts("extensionsRequired"):
        if extension not in _READ and not _HARMLESS.match(extension):
            document.fail(f"it needs {shortened(extension)}, which is not read")
    return document


def _chunks(path: PathLike, data: ByteArray) -> tuple[ByteArray, ByteArray]:
    """JSON and binary chunk of a GLB file."""
    cursor = Cursor(path, data)
    _, version, n_bytes = cursor.unpack("4sII")
    if version != 2:
        raise FileFormatError(f"{path}: it is GLB version {version}; only 2 is read")
    if n_bytes > len(data):
        raise FileFormatError(
            f"{path}: the GLB file is cut short, {len(data)} of {n_bytes} bytes; export it again"
        )
    found: dict[int, ByteArray] = {}
    while cursor.at + 8 <= n_bytes:
        n_chunk, kind = cursor.unpack("II")
        found.setdefault(kind, cursor.take(n_chunk))
    if JSON_CHUNK not in found:
        raise FileFormatError(f"{path}: the GLB file has no JSON chunk; export it again")
    return found[JSON_CHUNK], found.get(BINARY_CHUNK, data[:0])
