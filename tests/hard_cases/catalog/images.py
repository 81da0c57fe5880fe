"""Images that are hard: of odd sizes, of values that are no numbers, of ranges at the ends."""

import numpy as np
import numpy.typing as npt
from catalog.case import Case

Array = npt.NDArray[np.float32]


def _noise(height, width):
    def make():
        return np.random.default_rng(7).random((height, width, 3)).astype(np.float32)

    return make


def _constant(value):
    return lambda: np.full((6, 5, 3), value, np.float32)


def _with(value, *, every=7):
    def make():
        image = _noise(9, 8)()
        image.reshape(-1, 3)[::every] = value
        return image

    return make


def _flat_normals():
    return np.tile(np.array([0.0, 0.0, 1.0], np.float32), (8, 8, 1))


def _opposite_normals():
    """Normals that cancel in every block of the next mip level."""
    image = np.zeros((8, 8, 3), np.float32)
    image[..., 0] = np.where(np.indices((8, 8)).sum(axis=0) % 2, 1.0, -1.0)
    return image


def _one_spike():
    image = np.zeros((8, 8, 3), np.float32)
    image[3, 4] = 1e30
    return image


FINITE = frozenset({"finite"})
COLOR = FINITE | {"color"}  # in [0, 1], so that files of every kind hold it

IMAGES: tuple[Case[Array], ...] = (
    Case(name="1 x 1", wrong="there is no neighbor and no smaller level",
         make=_noise(1, 1), traits=COLOR),
    Case(name="1 x 9", wrong="half of a height of 1 is 0", make=_noise(1, 9), traits=COLOR),
    Case(name="9 x 1", wrong="half of a width of 1 is 0", make=_noise(9, 1), traits=COLOR),
    Case(name="primes 13 x 7", wrong="blocks of 2 x 2 leave out the last row and column",
         make=_noise(13, 7), traits=COLOR),
    Case(name="1 x 257", wrong="the size is odd at every halving", make=_noise(1, 257),
         traits=COLOR),
    Case(name="constant", wrong="filter weights that sum to 0.99999994 make the color drift",
         make=_constant(0.3), traits=COLOR | {"constant"}),
    Case(name="constant 0", wrong="the code divides by the range, which is 0", make=_constant(0.0),
         traits=COLOR | {"constant"}),
    Case(name="constant 1", wrong="1 * 256 wraps around to a byte of 0", make=_constant(1.0),
         traits=COLOR | {"constant"}),
    Case(name="constant 1e30", wrong="squares overflow float32", make=_constant(1e30),
         traits=FINITE | {"constant", "beyond squares"}),
    Case(name="subnormal", wrong="1 / range is infinite", make=_constant(1e-40), traits=FINITE),
    Case(name="NaN among numbers", wrong="NaN spreads over all smaller levels and all padding",
         make=_with(np.nan)),
    Case(name="infinities among numbers", wrong="inf - inf is NaN, and the range is infinite",
         make=_with(np.inf), traits=frozenset({"beyond squares"})),
    Case(name="all NaN", wrong="the mean is taken of no values at all", make=_constant(np.nan)),
    Case(name="one spike of 1e30",
         wrong="the range is so large that all other heights become equal", make=_one_spike,
         traits=FINITE | {"beyond squares"}),
    Case(name="negative", wrong="codes wrap around below 0", make=_with(-2.0), traits=FINITE),
    Case(name="flat normals", wrong="no code means 0, and both 127 and 128 tilt the normal",
         make=_flat_normals, traits=COLOR | {"constant"}),
    Case(name="all background",
         wrong="padding looks for the nearest texel of a chart, and invents colors without one",
         make=_constant(0.5), traits=COLOR | {"constant", "background"}),
    Case(name="normals that cancel", wrong="their mean has no direction", make=_opposite_normals,
         traits=FINITE),
)  # fmt: skip
