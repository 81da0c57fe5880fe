"""Mutations that keep a file's container whole: lengths, checksums and packed streams fit again.

Plain bytes hardly get past the checksum of a PNG chunk or the lengths of a GLB file, so that what
lies behind them would go unread.
"""

from __future__ import annotations

import base64
import json
import struct
import zlib
from collections.abc import Callable

import numpy as np
from mutants import mutant, zip_mutant

Change = Callable[[bytes], bytes]
_URI = "data:application/octet-stream;base64,"
_PNG = b"\x89PNG\r\n\x1a\n"


def changed(data: bytes, change: Change, rng: np.random.Generator) -> bytes:
    """Return a file with one change inside of its container, or anywhere.

    Parameters
    ----------
    change
        What changes a piece of the file: a fuzzer's own mutation.
    """
    if rng.random() < 0.3:
        return mutant(data, rng)
    if rng.random() < 0.3:
        return change(data)
    try:
        if data.startswith(b"PK"):
            return zip_mutant(data, rng)
        if data.startswith(_PNG):
            return _changed_png(data, change, rng)
        if data.startswith(b"glTF"):
            return _changed_glb(data, change, rng)
        if data.lstrip().startswith(b"{") and _URI.encode() in data:
            return _changed_gltf(data, change)
    except Exception:  # an earlier change has broken the container
        pass
    return change(data)


def _changed_png(data: bytes, change: Change, rng: np.random.Generator) -> bytes:
    """Change what one chunk holds, with its length and checksum; of pixels, what is packed."""
    chunks, at = [], len(_PNG)
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    i = int(rng.integers(len(chunks)))
    kind, body = chunks[i]
    is_packed = kind == b"IDAT" and rng.random() < 0.7
    body = zlib.compress(change(zlib.decompress(body)), 9) if is_packed else change(body)
    chunks[i] = (kind, body)
    pieces = [
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    ]
    return _PNG + b"".join(pieces) + data[at:]


def _changed_glb(data: bytes, change: Change, rng: np.random.Generator) -> bytes:
    """Change the JSON chunk or the binary one, with the lengths of both and of the file."""
    length = struct.unpack_from("<I", data, 12)[0]
    texts, rest = data[20 : 20 + length], data[20 + length :]
    body = rest[8:]
    if body and rng.random() < 0.4:
        body = change(body)
    elif rng.random() < 0.5:
        texts = mutant(texts, rng)
    else:
        texts = change(texts)
    texts += b" " * (-len(texts) % 4)
    body += bytes(-len(body) % 4)
    chunks = struct.pack("<I4s", len(texts), b"JSON") + texts
    if rest:
        chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _changed_gltf(data: bytes, change: Change) -> bytes:
    """Change what a buffer in a JSON file holds."""
    document = json.loads(data)
    buffer = next(each for each in document["buffers"] if each["uri"].startswith(_URI))
    body = change(base64.b64decode(buffer["uri"].removeprefix(_URI)))
    buffer["uri"] = _URI + base64.b64encode(body).decode()
    buffer["byteLength"] = len(body)
    return json.dumps(document).encode()
