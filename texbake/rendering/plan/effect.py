"""What an effect is: when it is needed, what it needs, and how it is computed.

An effect is one module of `texbake.rendering.effects`, which ends in one `Effect`. `called_for`
reads
the scene, and is all that ever runs of an effect that nothing asks for. What it says becomes passes
of the plan; their functions are run by `texbake.rendering.draw`:

`load`      once a scene: what does not depend on the camera, such as tangents or mip levels
`prepare`   once a picture: what does, such as a shadow map
`shade`     for the fragments of one object in some rows of the picture, in the order of the list
`dim`       for the light of one lamp that reaches fragments, before it is reflected

The first two return what the others find again by `Picture.value`. They are called for the targets
that asked: the index of an object, the index of a light, or None for the picture as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from texbake.rendering.fragments import Fragments, Incident
    from texbake.rendering.picture import Picture
    from texbake.rendering.plan.question import Question
    from texbake.texture.image import FloatImage

Target = int | None


@dataclass(frozen=True)
class Call:
    """Something that asks for an effect.

    Attributes
    ----------
    target : int, optional
        Index of the object or light that it is for; None: the whole picture.
    by : str
        What asks: `object "vase"`, `light "key"`, `the scene`.
    why : str
        In a few words: `its material has a normal map`.
    """

    target: Target
    by: str
    why: str


@dataclass(frozen=True)
class Refusal:
    """Something that would ask for an effect, did anything come of it."""

    by: str
    why: str


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One thing that light or a surface can do.

    Attributes
    ----------
    name : str
        As the plan, `--explain` and `needs` call it.
    does : str
        What it does, in one line.
    of : str
        What its targets are: `object`, `light` or `picture`.
    called_for : callable
        Question to the calls for it, and refusals.
    left_out : str
        Why it is not in a plan that nothing called it for: `no material has a normal map`.
    needs : callable, optional
        (question, target) to the names of effects that must come before it, for the same target
        (those of the picture are asked for with None, whatever the target).
    load, prepare, shade, dim : callable, optional
        See the module.
    behind : callable, optional
        Picture to (3,) or (H, W, 3) linear light that shows where there is no surface; of several
        the first of the list counts.
    of_the_others : bool
        Whether what `load` finds of an object depends on the other objects, so that it does not
        hold for a picture of fewer of them.
    moves_surface : bool
        Whether it is computed before it is known what is seen, because that depends on it.
    unneeded : callable, optional
        (picture, target) to why it is not needed after all, now that it is known what is seen; None
        where it is.
    """

    name: str
    does: str
    of: str = "object"
    called_for: Callable[[Question], Iterable[Call | Refusal]]
    left_out: str
    needs: Callable[[Question, Target], Iterable[str]] | None = None
    load: Callable[[Picture, Target], Any] | None = None
    prepare: Callable[[Picture, Target], Any] | None = None
    shade: Callable[[Fragments, Picture], None] | None = None
    dim: Callable[[Fragments, Picture, int, Incident], None] | None = None
    unneeded: Callable[[Picture, Target], str | None] | None = None
    behind: Callable[[Picture], FloatImage] | None = None
    moves_surface: bool = False
    of_the_others: bool = False


def only_when_needed(question: Question) -> Iterator[Call]:
    """`called_for` of an effect that is in a plan only where another needs it."""
    return iter(())
