"""Scans of JPEG files: a small file can have thousands, each of which goes over all pixels."""

from __future__ import annotations

import re
from pathlib import Path

from texbake.errors import FileFormatError
from texbake.files import PathLike

_JPEG, _SCAN, _END_OF_IMAGE = b"\xff\xd8", b"\xff\xda", b"\xd9"
# Of segments, and of the end. Decoders pass over markers below these wherever they stand.
_MARKER = re.compile(rb"\xff+([\xc0-\xcf\xd9-\xfe])")
_MOST_SCANS = 64  # programs write some 10, and as many for a preview


def require_few_scans(path: PathLike) -> None:
    """Raise `FileFormatError` for a JPEG file of many scans, each of which goes over all pixels."""
    with Path(path).open("rb") as file:
        if file.read(2) == _JPEG:
            data = file.read()
            # Phones add films and pictures after the image, in which anything may stand.
            n_scans = _scan_count(data) if data.count(_SCAN) > _MOST_SCANS else 0
            if n_scans > _MOST_SCANS:
                raise FileFormatError(
                    f"{path}: it has {n_scans:,} scans, more than {_MOST_SCANS}; save it again"
                )


def _scan_count(data: bytes) -> int:
    """Scans of a JPEG image; what is inside other segments or after its end is none of it."""
    n_scans = at = 0
    while (found := _MARKER.search(data, at)) and found[1] != _END_OF_IMAGE:
        n_scans += found[1] == _SCAN[1:]
        at = found.end() + int.from_bytes(data[found.end() : found.end() + 2], "big")
    return n_scans
