"""glTF files, taken apart and put together from the specification alone."""

import base64
import json
import struct

import numpy as np

COMPONENTS = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "I": 5125, "f": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def read_glb(path):
    """The document of a GLB file, and its binary chunk."""
    data = path.read_bytes()
    n_text = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + n_text]), data[28 + n_text :]


def glb_bytes(document, data=b""):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


class GltfFile:
    """A glTF file built by hand, array by array."""

    alignment = 4  # of the bytes of a view

    def __init__(self, **content):
        lists = {"accessors": [], "bufferViews": [], "meshes": []}
        self.json = {"asset": {"version": "2.0"}, **lists, **content}
        self.data = b""

    def view(self, data, **fields):
        """Add bytes, and return the index of their view."""
        self.data += bytes(-len(self.data) % self.alignment)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **fields}
        )
        self.data += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values, component="f", **fields):
        """Add an array, and return the index of its accessor; fields may say anything else."""
        values = np.atleast_2d(np.asarray(values).T).T.astype(component)
        if "bufferView" not in fields:
            fields = {"bufferView": self.view(values.tobytes()), **fields}
        self.json["accessors"].append({
            "componentType": COMPONENTS[component], "count": len(values),
            "type": TYPES[values.shape[1]], **fields,
        })  # fmt: skip
        return len(self.json["accessors"]) - 1

    def mesh(self, *primitives, **fields):
        """Add a mesh, and return its index."""
        self.json["meshes"].append({"primitives": list(primitives), **fields})
        return len(self.json["meshes"]) - 1

    def triangle(self, **fields):
        """Add a mesh of one triangle, and return its index."""
        return self.mesh({"attributes": {"POSITION": self.accessor(CORNERS)}}, **fields)

    def write(self, path):
        """Write a .glb file, or a .gltf file with its buffer in it; return its path."""
        buffer = {"byteLength": len(self.data)}
        if path.suffix == ".gltf":
            buffer["uri"] = "data:;base64," + base64.b64encode(self.data).decode()
        content = {"buffers": [buffer], **self.json}
        if path.suffix == ".gltf":
            path.write_text(json.dumps(content))
        else:
            path.write_bytes(glb_bytes(content, self.data))
        return path
