# SPDX-License-Identifier: GPL-3.0-or-later
"""The process beside Blender: it does the task in a folder, and prints lines of JSON.

Blender's own Python runs it, with NumPy and the wheel of texbake alone.
"""

import json
import os
import shutil
import sys
import threading
import traceback
from pathlib import Path
from typing import Any


def tell(**values: Any) -> None:
    """Print one line for the process that waits."""
    print(json.dumps(values), flush=True)


def end_with_parent(folder: Path) -> None:
    """Wait until the other end of stdin closes; then remove the files, and end at once."""
    while os.read(0, 4096):  # sys.stdin would hold a lock when the process ends by itself
        pass
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


def read(folder: Path, role: str, count: int) -> list[dict[str, Any]]:
    """Return the arrays of the objects of a role."""
    import numpy as np

    every = []
    for number in range(count):
        with np.load(folder / f"{role}{number}.npz", allow_pickle=False) as arrays:
            every.append(dict(arrays))
    return every


def main(folder: Path) -> None:
    """Do the task in a folder."""
    threading.Thread(target=end_with_parent, args=(folder,), daemon=True).start()
    job = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    sys.path[:0] = [str(Path(__file__).parent), *job["paths"][:2]]
    sys.path += job["paths"][2:]
    try:
        from tasks import TASKS

        from texbake.errors import TexbakeError
    except Exception as error:
        tell(error=f"the package texbake does not work here: {error}")
        return
    try:
        meshes = {role: read(folder, role, count) for role, count in job["meshes"].items()}
        TASKS[job["task"]](folder, job["options"], **meshes)
    except TexbakeError as error:
        tell(error=str(error))
    except MemoryError:
        tell(error="there is not enough memory; use fewer samples, smaller maps or smaller meshes")
    except ImportError as error:
        tell(error=f"a library is missing from Blender's Python: {error}")
    except Exception:
        traceback.print_exc()
        raise SystemExit(1) from None


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
