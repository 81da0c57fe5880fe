"""`texbake info` of glTF files of very many nodes: how long does it take?

    python tests/hard_cases/time_nodes.py [--nodes 25000 50000 100000] [--trees flat own ...]

- `flat`: all nodes are roots, and place one triangle.
- `chain`: each node but the last has one child.
- `tree`: each node has up to four children.
- `meshes`: flat, with a mesh and accessors for each node, of one buffer view.
- `own`: flat, with a mesh, buffer views, accessors and a material for each node.

Prints a row in Markdown for each tree and number of nodes: bytes, seconds of processor and by the
clock (the least of three runs), and peak memory. The time must grow with the number and not with
its square: exits with 1 where twice the nodes take more than three times as long. Linux and macOS.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

PROGRAM = "from texbake_cli.main import main; main()"
POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
INDICES = np.array([0, 1, 2], dtype="<u4").tobytes()
TRIANGLE = POSITIONS + INDICES
RUNS = 3
MOST_GROWTH = 1.5  # of the time of a node, where there are twice as many

Document = dict[str, Any]


def _places(n: int) -> list[Document]:
    side = int(np.ceil(np.sqrt(n)))
    return [{"mesh": 0, "translation": [i % side, i // side, 0]} for i in range(n)]


def _accessors(views: tuple[int, int]) -> list[Document]:
    return [
        {"bufferView": views[0], "componentType": 5126, "count": 3, "type": "VEC3",
         "min": [0, 0, 0], "max": [1, 1, 0]},
        {"bufferView": views[1], "byteOffset": 0, "componentType": 5125, "count": 3,
         "type": "SCALAR"},
    ]  # fmt: skip


def _views(first: int) -> list[Document]:
    return [
        {"buffer": 0, "byteOffset": first, "byteLength": len(POSITIONS)},
        {"buffer": 0, "byteOffset": first + len(POSITIONS), "byteLength": len(INDICES)},
    ]


def _mesh(accessors: tuple[int, int]) -> Document:
    return {"primitives": [{"attributes": {"POSITION": accessors[0]}, "indices": accessors[1]}]}


def flat(n: int) -> Document:
    """All nodes are roots, and place one triangle."""
    return {
        "nodes": _places(n),
        "scenes": [{"nodes": list(range(n))}],
        "meshes": [_mesh((0, 1))],
        "accessors": _accessors((0, 1)),
        "bufferViews": _views(0),
    }


def chain(n: int) -> Document:
    """Each node but the last has one child, a step to the side."""
    document = flat(n)
    document["nodes"] = [{"mesh": 0, "translation": [1, 0, 0]} for _ in range(n)]
    for i in range(n - 1):
        document["nodes"][i]["children"] = [i + 1]
    return document | {"scenes": [{"nodes": [0]}]}


def tree(n: int) -> Document:
    """Each node has up to four children."""
    document = flat(n)
    for i in range((n + 2) // 4):
        children = list(range(4 * i + 1, min(4 * i + 5, n)))
        if children:
            document["nodes"][i]["children"] = children
    return document | {"scenes": [{"nodes": [0]}]}


def meshes(n: int) -> Document:
    """A mesh and accessors for each node, of the same buffer views."""
    document = flat(n)
    for i, node in enumerate(document["nodes"]):
        node["mesh"] = i
    document["meshes"] = [_mesh((2 * i, 2 * i + 1)) for i in range(n)]
    document["accessors"] = _accessors((0, 1)) * n
    return document


def own(n: int) -> Document:
    """A mesh, buffer views, accessors and a material for each node."""
    document = meshes(n)
    for i, mesh in enumerate(document["meshes"]):
        mesh["primitives"][0]["material"] = i
    document["accessors"] = [each for i in range(n) for each in _accessors((2 * i, 2 * i + 1))]
    document["bufferViews"] = [each for i in range(n) for each in _views(i * len(TRIANGLE))]
    document["materials"] = [
        {"name": f"material {i}", "pbrMetallicRoughness": {"roughnessFactor": i / n}}
        for i in range(n)
    ]
    return document


TREES: dict[str, Callable[[int], Document]] = {
    make.__name__: make for make in (flat, chain, tree, meshes, own)
}


def write(document: Document, path: Path) -> None:
    """Write a document, and as many triangles as its buffer views reach, as a GLB file."""
    last = document["bufferViews"][-1]
    n_triangles = (last["byteOffset"] + last["byteLength"]) // len(TRIANGLE)
    document |= {
        "asset": {"version": "2.0"},
        "scene": 0,
        "buffers": [{"byteLength": n_triangles * len(TRIANGLE)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = TRIANGLE * n_triangles
    with path.open("wb") as file:
        length = 12 + 8 + len(text) + 8 + len(data)
        file.write(b"glTF" + np.array([2, length, len(text)], dtype="<u4").tobytes() + b"JSON")
        file.write(text + np.array([len(data)], dtype="<u4").tobytes() + b"BIN\0" + data)


def timed(path: Path) -> tuple[float, float, int]:
    """Processor and clock seconds of `texbake info`, and its peak memory in bytes."""
    start = time.perf_counter()
    command = [sys.executable, "-P", "-c", PROGRAM, "info", str(path)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{path.name}: exit code {process.returncode}")
    memory = usage.ru_maxrss << (0 if sys.platform == "darwin" else 10)
    return usage.ru_utime + usage.ru_stime, time.perf_counter() - start, memory


def main() -> int:
    """Time all and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--nodes", type=int, nargs="+", default=[25_000, 50_000, 100_000])
    parser.add_argument("--trees", nargs="+", choices=TREES, default=list(TREES))
    arguments = parser.parse_args()
    print("| tree | nodes | MB | processor s | clock s | peak MB |\n|---|---|---|---|---|---|")
    fine = True
    with tempfile.TemporaryDirectory(prefix="texbake-nodes-") as folder:
        for name in arguments.trees:
            times = []
            for n in sorted(arguments.nodes):
                path = Path(folder) / f"{name}_{n}.glb"
                write(TREES[name](n), path)
                processor, clock, memory = min(timed(path) for _ in range(RUNS))
                times.append((n, processor))
                print(f"| {name} | {n:,} | {path.stat().st_size / 1e6:.0f} | {processor:.2f} |"
                      f" {clock:.2f} | {memory / 1e6:.0f} |", flush=True)  # fmt: skip
                path.unlink()
            for (n, before), (m, after) in pairwise(times):
                fine &= after <= before * (1.0 + (m / n - 1.0) * MOST_GROWTH)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
