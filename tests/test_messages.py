"""Messages between processes: values come as they were sent, and others are refused."""

import numpy as np
import pytest

from texbake.mesh.mesh import UvSet
from texbake.mesh.shapes import cube
from texbake.messages import MessageError, pack, unpack


def test_values_come_as_they_were_sent() -> None:
    mesh = cube()
    uvs = np.zeros((1, 2))
    mesh = mesh.replace(uv_sets={"second": UvSet(uvs=uvs, faces=np.zeros_like(mesh.faces))})
    image = b"image"
    value = ({1: None, "a": True}, (1, 0.1, "\udc80ä"), image, (image, b""), mesh, np.zeros((0, 3)))
    message = b"".join(pack(value))
    classes = {"Mesh": type(mesh), "UvSet": UvSet}
    found = unpack(message, classes)
    assert found[:4] == value[:4]
    assert found[3][0] is found[2]
    assert found[5].shape == (0, 3)
    for name in ("positions", "faces", "normals", "normal_faces"):
        ours, theirs = getattr(mesh, name), getattr(found[4], name)
        if ours is not None:
            assert np.array_equal(ours, theirs) and ours.dtype == theirs.dtype
            assert theirs.flags.aligned
    assert found[4].uv_sets["second"].uvs.tolist() == [[0.0, 0.0]]
    for length in range(0, len(message) - 16, 7):
        with pytest.raises(MessageError):
            unpack(message[:length], classes)
    with pytest.raises(MessageError, match="Mesh"):
        unpack(message, {})


@pytest.mark.parametrize(
    "text",
    [b'{"array": "O", "shape": [1]}', b'{"array": "<f8", "shape": [99999999999999]}',
     b'{"array": "<f8", "shape": [-1]}', b'{"bytes": -8}', b"{}", b"x"],
)  # fmt: skip
def test_other_messages_are_refused(text: bytes) -> None:
    with pytest.raises(MessageError):
        unpack(len(text).to_bytes(8, "little") + text, {})
