"""Every choice of a build, with its default, written once for the API and the command line."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.baking.memory import parse_bytes
from texbake.errors import OptionError
from texbake.files import PathLike


@dataclass(frozen=True, kw_only=True)
class BuildOptions:
    """What `build` does where the caller does not say otherwise.

    Attributes
    ----------
    folder : path, optional
        Of what is built, in place of the pipeline file's `folder`.
    only : tuple of str
        Names of assets, or patterns such as `orange*`, that are built; none for all.
    jobs : int, optional
        Steps that run at once, each in a process of its own. None: one a processor.
    threads : int, optional
        Of each step. None: the processors shared out among the jobs.
    max_memory : str or int, optional
        Memory that all running steps together may be estimated to take, such as `8G`, or bytes. A
        step that is estimated to need more runs alone, and a bake goes through its dense mesh in
        chunks then. None: four fifths of what the machine has.
    scheduler : str, optional
        Address of a Dask scheduler, such as `tcp://host:8786`, whose workers run the steps.
    wait : bool
        Wait for another build in the same folder, instead of failing at once.
    prune : bool
        In the end remove stored results that no step of this build stands for.
    verify : bool
        Read all that is stored and hold it against its checksums, also what the system says has
        not been touched.
    """

    folder: PathLike | None = None
    only: tuple[str, ...] = ()
    jobs: int | None = None
    threads: int | None = None
    max_memory: str | int | None = None
    scheduler: str | None = None
    wait: bool = True
    prune: bool = False
    verify: bool = False

    def __post_init__(self) -> None:
        for name in "jobs", "threads":
            value = getattr(self, name)
            if value is not None and (not isinstance(value, int) or value < 1):
                raise OptionError(f"{name}: {value} is too few; it must be at least 1")
        _ = self.memory_bytes  # checks it
        if self.scheduler is not None and "://" not in self.scheduler:
            raise OptionError(
                f"scheduler: {self.scheduler!r} is no address; give one such as tcp://host:8786"
            )
        if self.prune and self.only:
            raise OptionError(
                "prune, only: what other assets need would be removed; give one of them"
            )

    @property
    def memory_bytes(self) -> int | None:
        """`max_memory` in bytes, or None."""
        return None if self.max_memory is None else parse_bytes(self.max_memory)
