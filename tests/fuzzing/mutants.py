"""Changes of valid files: of bits, bytes, lengths, words and numbers; cuts, and moved blocks.

Changed bytes rarely get past the checksum of a PNG chunk or the lengths of a GLB file. So some
changes keep the container of a file intact: lengths, checksums and compressed streams fit again.
"""

import base64
import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable

# Numbers and words put into text, which readers take for counts, indices and keys.
WORDS = (
    b"-1", b"0", b"1e999", b"nan", b"-inf", b"4294967295", b"9999999999999", b"1e-400", b"\x00",
    b"\xff\xfe", b"'", b"[", b"{}", b"null", b"true", b"\n", b" ", b"//", b"\\\n", b"#", b'"',
)  # fmt: skip

LENGTHS = (0, 1, 2**15, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**63 - 1, 2**63, 2**64 - 1)
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_MOST = 1 << 16  # bytes that a repeated block adds at most
_URI = "data:application/octet-stream;base64,"
_PNG = b"\x89PNG\r\n\x1a\n"

Change = Callable[[bytes], bytes]


def mutant(content, rng):
    """Return the content with a few changes of one kind or of several."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        _CHANGES[int(rng.integers(len(_CHANGES)))](data, rng)
    return bytes(data)


def _block(data, rng):
    """Return where a short block begins and ends."""
    at = int(rng.integers(len(data) + 1))
    return at, min(len(data), at + int(rng.integers(1, 64)))


def _flip_bit(data, rng):
    if data:
        data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))


def _set_byte(data, rng):
    if data:
        data[int(rng.integers(len(data)))] = int(rng.integers(256))


def _delete(data, rng):
    at, until = _block(data, rng)
    del data[at:until]


def _reverse(data, rng):
    at, until = _block(data, rng)
    data[at:until] = data[at:until][::-1]


def _repeat(data, rng):
    """Once, or so often that counts and depths overflow."""
    at, until = _block(data, rng)
    n = 1 if rng.random() < 0.7 else int(rng.integers(2, 2000))
    data[at:at] = (data[at:until] * n)[:_MOST]


def _splice(data, rng):
    """Put a block of the file over another place of it."""
    at, until = _block(data, rng)
    to = int(rng.integers(len(data) + 1))
    data[to : to + until - at] = data[at:until]


def _splice_number(data, rng):
    """Put a number of the text, or one of the lengths, in place of another."""
    start = int(rng.integers(len(data) + 1))
    old = _NUMBER.search(data, start, start + 4096)
    if old is None:
        return
    other = _NUMBER.search(data, int(rng.integers(len(data) + 1)))
    is_length = other is None or rng.random() < 0.4
    number = (
        str(LENGTHS[int(rng.integers(len(LENGTHS)))])
        if is_length or other is None
        else other[0].decode()
    )
    data[old.start() : old.end()] = number.encode()


def _set_length(data, rng):
    """A length of four or eight bytes, in either order."""
    at = int(rng.integers(len(data) + 1))
    width = 4 if rng.random() < 0.6 else 8
    order = "little" if rng.random() < 0.7 else "big"
    length = LENGTHS[int(rng.integers(len(LENGTHS)))] % (1 << 8 * width)
    data[at : at + width] = length.to_bytes(width, order)


def _insert_word(data, rng):
    at = int(rng.integers(len(data) + 1))
    data[at:at] = WORDS[int(rng.integers(len(WORDS)))]


def _truncate(data, rng):
    if rng.random() < 0.3:
        del data[int(rng.integers(len(data) + 1)) :]


_CHANGES = (
    _flip_bit, _set_byte, _delete, _reverse, _repeat, _splice, _splice_number, _set_length,
    _insert_word, _truncate,
)  # fmt: skip


def zip_mutant(content, rng):
    """Return a zip archive with changes in one of its files, and checksums that fit them."""
    changed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(changed, "w") as new:
        entries = old.infolist()
        at = int(rng.integers(len(entries)))
        for i, entry in enumerate(entries):
            data = old.read(entry)
            new.writestr(entry, mutant(data, rng) if i == at else data)
    return changed.getvalue()


def changed(data, change, rng):
    """Return a file with a change inside of its container, or anywhere; `change` changes pieces."""
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


def _changed_png(data, change, rng):
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


def _changed_glb(data, change, rng):
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


def _changed_gltf(data, change):
    """Change what a buffer in a JSON file holds."""
    document = json.loads(data)
    buffer = next(each for each in document["buffers"] if each["uri"].startswith(_URI))
    body = change(base64.b64decode(buffer["uri"].removeprefix(_URI)))
    buffer["uri"] = _URI + base64.b64encode(body).decode()
    buffer["byteLength"] = len(body)
    return json.dumps(document).encode()
