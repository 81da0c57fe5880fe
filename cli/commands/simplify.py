"""`texbake simplify`: fewer triangles."""

from __future__ import annotations
