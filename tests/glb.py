"""GLB files, taken apart and put together from the specification alone."""

import json
import struct


def read_glb(path):
    """The document of a GLB file, and its binary chunk."""
    data = path.read_bytes()
    n_text = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + n_text]), data[28 + n_text :]


def glb_bytes(document, data=b""):
    """A GLB file of a document and a binary chunk."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
