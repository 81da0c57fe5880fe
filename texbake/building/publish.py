"""Results to where people look for them: copies of what is stored, which may be changed or lost."""

from __future__ import annotations

import tempfile
from pathlib import Path

from texbake.building.digests import Digests
from texbake.building.graph import Node
from texbake.building.locations import location_of
from texbake.building.store import (
    Manifest,
    Store,
    StoredFile,
    stored_files,
)


class Publisher:
    """Copies outputs to the folder of outputs, where they are not there yet."""

    def __init__(self, place: str, store: Store, digests: Digests) -> None:
        self.place = place
        self._location = location_of(place)
        self._store, self._digests = store, digests

    def missing(self, node: Node, manifest: Manifest) -> list[tuple[str, StoredFile]]:
        """Outputs that are not there, or are not what was stored: their names and stored files."""
        stored = stored_files(manifest)
        return [
            (name, file)
            for output, base in node.published.items()
            for file in stored[output]
            for name in (f"{base}/{file.path}" if file.path else base,)
            if not self._digests.is_known(self._location.path(name), file.sha256)
        ]

    def publish(self, node: Node, manifest: Manifest) -> int:
        """Put out what is missing; return how many files.

        Raises
        ------
        FileError
            A file cannot be written.
        """
        missing = self.missing(node, manifest)
        if not missing:
            return 0
        with tempfile.TemporaryDirectory(prefix="texbake-") as copies:
            for name, file in missing:
                self._location.put(self._store.fetch(file, Path(copies)), name)
                signature = self._location.signature(name)
                if signature is not None:  # nobody has taken it away at once
                    self._digests.remember(self._location.path(name), signature, file.sha256)
        return len(missing)
