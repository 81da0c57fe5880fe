"""three.js, taken from the viewer that the installed trimesh has inside."""

from __future__ import annotations

import re

from texbake.errors import DependencyError

# The viewer is one page; three.js is in it as the one file that its authors build for browsers,
# from the notice of its license to the last thing that it exports.
_THREE = re.compile(
    r"/\*\*\s*\* @license.{0,200}?SPDX-License-Identifier: MIT\s*\*/\s*!function\(.*?"
    r'"__esModule",\{value:!0\}\)\}\)\);',
    re.DOTALL,
)


def three_js() -> str:
    """Source of three.js with its license; it makes the global `THREE`.

    Raises
    ------
    DependencyError
        trimesh is missing, or carries no three.js in the form that is known here.
    """
    try:
        import trimesh
        from trimesh import resources, util
    except ImportError as error:
        raise DependencyError(
            "trimesh: pages take three.js from it and it is not here; install it with: "
            "pip install trimesh"
        ) from error
    try:
        archive = util.decompress(resources.get_bytes("templates/viewer.zip"), file_type="zip")
        page = archive["viewer.html.template"].read().decode("utf-8")
        found = _THREE.search(page)
    except (OSError, KeyError, ValueError):
        found = None
    if found is None or "</script" in found[0]:
        raise DependencyError(
            f"trimesh {trimesh.__version__}: three.js is not found in its viewer; "
            "install a version that has it: pip install trimesh==5.2.0"
        )
    return found[0]
