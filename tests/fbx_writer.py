"""Small FBX files, binary and text, from nodes as Python tuples: (name, values, children)."""

import struct
import zlib

import numpy as np

CODES = {"float32": b"f", "float64": b"d", "int32": b"i", "int64": b"l"}


def _value(value, packed):
    if isinstance(value, bytearray):  # as it is to stand in a binary file
        return value
    if isinstance(value, np.ndarray):
        content = value.tobytes()
        content = zlib.compress(content) if packed else content
        head = struct.pack("<III", len(value), packed, len(content))
        return CODES[value.dtype.name] + head + content
    if isinstance(value, bytes | str):
        text = value if isinstance(value, bytes) else value.encode()
        return b"S" + struct.pack("<I", len(text)) + text
    return b"D" + struct.pack("<d", value) if isinstance(value, float) else (
        b"L" + struct.pack("<q", value)
    )  # fmt: skip


def _node(node, at, version, packed):
    name, values, children = node
    layout = struct.Struct("<QQQB" if version >= 7500 else "<IIIB")
    if version < 7000:  # arrays are values one by one
        values = [x for v in values for x in (v.tolist() if isinstance(v, np.ndarray) else [v])]
    content = b"".join(_value(value, packed) for value in values)
    n_values = len(content)
    start = at + layout.size + len(name)
    for child in children:
        content += _node(child, start + len(content), version, packed)
    if children:
        content += bytes(layout.size)
    head = layout.pack(start + len(content), len(values), n_values, len(name))
    return head + name.encode() + content


def binary(nodes, version=7400, packed=True):
    data = b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", version)
    for node in nodes:
        data += _node(node, len(data), version, packed)
    return data + bytes(25 if version >= 7500 else 13)


def _text(node, version, indent=""):
    name, values, children = node
    words = []
    for value in values:
        if isinstance(value, np.ndarray):
            numbers = ",".join(map(str, value.tolist()))
            words += [numbers if version < 7000 else f"*{len(value)} {{\na: {numbers}\n}}"]
        elif isinstance(value, bytes | str):
            text = value if isinstance(value, str) else value.decode("latin-1")
            short, separator, kind = text.partition("\0\1")
            words.append('"' + (f"{kind}::{short}" if separator else text) + '"')
        else:
            words.append(str(value))
    inner = "".join(_text(child, version, indent + "\t") for child in children)
    body = f" {{\n{inner}{indent}}}" if children else ""
    return f"{indent}{name}: {', '.join(words)}{body}\n"


def ascii_text(nodes, version=7400):
    head = f"; FBX {version // 1000}.{version // 100 % 10}.0 project file\n; made by a test\n\n"
    return (head + "".join(_text(node, version) for node in nodes)).encode()


def written(nodes, version, form):
    """Bytes of a file of a form, "binary" or "ascii"."""
    return (binary if form == "binary" else ascii_text)(nodes, version)


def properties(version, values):
    """Node of properties, from names and lists of numbers."""
    name, entry, words = ("Properties70", "P", 3) if version >= 7000 else (
        "Properties60", "Property", 2
    )  # fmt: skip
    return (name, [], [(entry, [key, *[""] * words, *value], []) for key, value in values.items()])


def layer(name, values, mapping="ByPolygonVertex", indices=None, index=0):
    """Node of a layer, of values and perhaps indices, as (name, array)."""
    children = [
        ("MappingInformationType", [mapping], []),
        ("ReferenceInformationType", ["Direct" if indices is None else "IndexToDirect"], []),
        (values[0], [values[1]], []),
    ]
    if indices is not None:
        children.append((indices[0], [indices[1]], []))
    return (name, [index], children)


# Two quads side by side in the plane z = 0, and a triangle above the first.
POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [0, 2, 0.0]])
POLYGONS = np.array([0, 1, 4, -4, 1, 2, 5, -5, 3, 4, -7], np.int32)
FACES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 6]])
CM = 0.01


def shape(layers=(), points=POINTS, polygons=POLYGONS):
    return [("Vertices", [points.ravel()], []), ("PolygonVertexIndex", [polygons], []), *layers]


def _material_key(index):
    """Number of a material: from 50 on, and beyond those of models from there on."""
    return 50 + index if index < 50 else 100_000 + index


def scene(version=7400, *, layers=(), models=None, settings=None, materials=(), geometry=None):
    """Nodes of a file with one geometry and models by name: (properties, parent or None)."""
    models = {"wall": ({}, None)} if models is None else models
    geometry = shape(layers) if geometry is None else geometry
    is_new = version >= 7000
    objects, links = [], []
    numbers = {name: 100 + i for i, name in enumerate(models)}
    for name, (values, parent) in models.items():
        full = f"{name}\0\1Model"
        children = [properties(version, values)] + ([] if is_new else geometry)
        objects.append(("Model", ([numbers[name]] if is_new else []) + [full, "Mesh"], children))
        owner = f"{parent}\0\1Model" if parent else "Scene\0\1Model"
        if is_new:
            owner = numbers[parent] if parent else 0
            links.append((10, numbers[name]))
        links.append((numbers[name] if is_new else full, owner))
        for i, material in enumerate(materials):
            key = _material_key(i) if is_new else f"{material}\0\1Material"
            links.append((key, numbers[name] if is_new else full))
    if is_new:
        objects.append(("Geometry", [10, "wall mesh\0\1Geometry", "Mesh"], geometry))
    for i, material in enumerate(materials):
        key = [_material_key(i)] if is_new else []
        objects.append(("Material", [*key, f"{material}\0\1Material", ""], [("Version", [1], [])]))
    link = "C" if is_new else "Connect"
    return [
        ("GlobalSettings", [], [properties(version, settings or {})]),
        ("Objects", [], objects),
        ("Connections", [], [(link, ["OO", *pair], []) for pair in links]),
    ]


def rich_scene(version):
    """Nodes of a file with every kind of layer, two models and two materials."""
    n = len(POLYGONS)
    layers = [
        layer("LayerElementNormal", ("Normals", np.tile([0.0, 0.0, 1.0], n))),
        layer(
            "LayerElementUV",
            ("UV", POINTS[:, :2].ravel()),
            indices=("UVIndex", np.where(POLYGONS < 0, ~POLYGONS, POLYGONS)),
        ),
        layer("LayerElementColor", ("Colors", np.linspace(0, 1, 28)), "ByVertice"),
        layer("LayerElementMaterial", ("Materials", np.array([0, 1, 0], np.int32)), "ByPolygon"),
    ]
    models = {
        "wall": ({"Lcl Translation": [1.0, 2.0, 3.0]}, None),
        "door": ({"Lcl Scaling": [2.0, 2.0, 2.0], "Lcl Rotation": [90.0, 0.0, 0.0]}, "wall"),
    }
    return scene(version, layers=layers, models=models, materials=("red", "blue"))


def moving_scene():
    """A wall that a bone at (1, 0, 0) moves in part, and a shape; a door that turns by itself."""
    models = {
        "wall": ({"Lcl Translation": [0.0, 0.0, 5.0]}, None),
        "bone": ({"Lcl Translation": [1.0, 0.0, 5.0]}, None),
        "door": ({}, None),
    }
    nodes = scene(7400, models=models)
    bind = np.eye(4)
    bind[3, 0] = -1.0  # of the wall to the bone, in rows
    curve = [
        ("KeyTime", [np.array([0, 46_186_158_000])], []),
        ("KeyValueFloat", [np.array([0.0, 90.0], np.float32)], []),
        ("KeyAttrFlags", [np.array([4], np.int32)], []),
        ("KeyAttrDataFloat", [np.zeros(4, np.float32)], []),
        ("KeyAttrRefCount", [np.array([2], np.int32)], []),
    ]
    weights = np.array([0.5, 1.0, 1.0])
    cluster = [
        ("Indexes", [np.array([1, 2, 5], np.int32)], []),
        ("Weights", [weights], []),
        ("Transform", [bind.ravel()], []),
        ("TransformLink", [np.eye(4).ravel()], []),
    ]
    bump = [
        ("Indexes", [np.array([0, 6], np.int32)], []),
        ("Vertices", [np.array([0.0, 0, 1, 0, 0, 2])], []),
    ]
    nodes[1][2].extend([
        ("Geometry", [11, "door\0\1Geometry", "Mesh"], shape()),
        ("Deformer", [70, "\0\1Deformer", "Skin"], []),
        ("Deformer", [71, "\0\1SubDeformer", "Cluster"], cluster),
        ("Deformer", [72, "\0\1Deformer", "BlendShape"], []),
        ("Deformer", [73, "bump\0\1SubDeformer", "BlendShapeChannel"],
         [("DeformPercent", [25.0], [])]),
        ("Geometry", [74, "bump\0\1Geometry", "Shape"], bump),
        ("AnimationStack", [75, "turn\0\1AnimStack", ""], []),
        ("AnimationLayer", [76, "\0\1AnimLayer", ""], []),
        ("AnimationCurveNode", [77, "R\0\1AnimCurveNode", ""], []),
        ("AnimationCurve", [78, "\0\1AnimCurve", ""], curve),
        ("AnimationCurveNode", [79, "DeformPercent\0\1AnimCurveNode", ""], []),
    ])  # fmt: skip
    links = [("OO", *pair) for pair in (
        (11, 102), (70, 10), (71, 70), (101, 71), (72, 10), (73, 72), (74, 73), (76, 75), (77, 76),
        (79, 76),
    )]  # fmt: skip
    links += [("OP", 77, 101, "Lcl Rotation"), ("OP", 77, 102, "Lcl Rotation")]
    links += [("OP", 78, 77, "d|Z"), ("OP", 79, 73, "DeformPercent"),
              ("OP", 78, 79, "d|DeformPercent")]  # fmt: skip
    nodes[2][2].extend([("C", list(link), []) for link in links])
    taken = (["OO", 10, 101], ["OO", 10, 102])
    nodes[2][2][:] = [each for each in nodes[2][2] if each[1] not in taken]
    return nodes
