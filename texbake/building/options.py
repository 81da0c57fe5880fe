"""Every option of `build`, with its default."""

from __future__ import annotations

from texbake.baking.memory import parse_bytes
from texbake.errors import OptionError, quoted
from texbake.files import PathLike
from texbake.records import dataclass
from texbake.schema import CheckedOptions, option


@dataclass(frozen=True, kw_only=True)
class BuildOptions(CheckedOptions):
    """How `build` runs the steps of a pipeline.

    With `max_memory`, a step that is estimated to need more runs alone, and a bake casts its rays
    against chunks of the high-poly mesh then.
    """

    folder: PathLike | None = option(
        None,
        "Folder of the output.",
        metavar="DIR",
        default="the pipeline file's folder, or else build",
    )
    only: tuple[str, ...] = option(
        (),
        "Build this asset, or those that a pattern such as 'orange*' matches; repeatable.",
        metavar="ASSET",
        many=True,
    )
    jobs: int | None = option(
        None,
        "Number of steps that run at once, each in its own process.",
        metavar="N",
        low=1,
        default="one per processor",
    )
    threads: int | None = option(
        None,
        "Number of threads of each step.",
        metavar="N",
        low=1,
        default="the processors divided by the jobs",
    )
    max_memory: str | int | None = option(
        None,
        "Limit on the estimated memory of all running steps together, such as 8G; a step that "
        "needs more runs alone.",
        metavar="SIZE",
        default="four fifths of the machine's",
    )
    scheduler: str | None = option(
        None,
        "Address of a Dask scheduler whose workers run the steps, such as tcp://host:8786.",
        metavar="ADDRESS",
        default="this machine",
    )
    wait: bool = option(
        True, "Wait for another build in the same folder, or fail at once.", flag="--wait/--no-wait"
    )
    prune: bool = option(False, "At the end remove stored results that this build does not use.")
    verify: bool = option(
        False, "Read everything that is stored and compare it with its checksums."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.memory_bytes  # checks it
        if self.scheduler is not None and "://" not in self.scheduler:
            raise OptionError(
                f"scheduler: {quoted(self.scheduler)} is not an address; use one such as tcp://host:8786"
            )
        if self.scheduler is not None and self.jobs is not None:
            raise OptionError("jobs, scheduler: a cluster sets the number itself; give one of them")
        if self.prune and self.only:
            raise OptionError(
                "prune, only: this would remove what other assets need; give one of them"
            )

    @property
    def memory_bytes(self) -> int | None:
        """`max_memory` in bytes, or None."""
        return None if self.max_memory is None else parse_bytes(self.max_memory)
