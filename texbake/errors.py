"""Every error that a user can meet, as one tree.

A message says where, what, and what to do next, in one line::

    low.obj: it has no texture coordinates; make some with: texbake unwrap low.obj -o low_uv.obj

The command line prints that line and exits 1, or 2 for an `OptionError`, which is wrong usage.
Anything else that is raised is a bug and keeps its traceback.
"""

from __future__ import annotations


class TexbakeError(Exception):
    """Root of everything that texbake raises on purpose."""


class OptionError(TexbakeError, ValueError):
    """An option has a value that it cannot have, or two options contradict each other."""


class DependencyError(TexbakeError, ImportError):
    """An optional or native library that the work needs is missing or does not load."""


class FileError(TexbakeError, OSError):
    """A file cannot be found, read or written."""


class FileFormatError(FileError, ValueError):
    """A file is not of a kind that texbake knows, or breaks the rules of its kind."""


class MeshError(TexbakeError, ValueError):
    """A mesh is not one: not finite, an index out of range, arrays that do not fit together."""


class UvError(MeshError):
    """A mesh has no texture coordinates where they are needed, or none that cover any area."""


class UnwrapError(MeshError):
    """No atlas could be made for a mesh."""


class CageError(MeshError):
    """A cage does not fit the light mesh that it is meant for."""


class MissError(TexbakeError):
    """More texels missed the dense mesh than the user allows."""
