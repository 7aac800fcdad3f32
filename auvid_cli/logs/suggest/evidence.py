"""Which signs, axes, delays and assignments of a log's signals agree best with each other, and how surely.

What is known beforehand: bodies obey kinematics, a vehicle goes ahead and is below the surface, gravity points down,
a positive rudder turns to port, a positive elevator noses down. Every sign is a hypothesis of its own; the signs of a
sensor cost by how far they are from usual axes, so that one reversed component and other axes are told apart.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.logs.suggest.ties import Agreement

Array = NDArray[np.float64]

# Signs of components in the axes that vehicles use; an attitude of FLU axes refers to ENU.
USUAL_AXES = {"FRD": (1, 1, 1), "FLU": (1, -1, -1)}
TRIPLES = {
    "attitude": ("phi", "theta", "psi"),
    "gyroscope": ("p", "q", "r"),
    "accelerometer": ("fx", "fy", "fz"),
    "dvl": ("u", "v", "w"),
}
# Of log likelihoods: what a component costs that counts the other way than its axes, and axes that are not expected.
_REVERSED, _UNEXPECTED = 4.0, 1.0
# From where on the evidence of a sign is called so.
_STRENGTHS = ((8.0, "strong"), (2.5, "fair"))


class LikelySigns(NamedTuple):
    """The signs that agree best with the evidence.

    Attributes
    ----------
    signs : dict of int
        1 or -1 by symbol.
    margins : dict of float
        By symbol how much less likely, as a logarithm, everything is with its other sign; 0 where only what is usual
        speaks for it, and no data.
    """

    signs: dict[str, int]
    margins: dict[str, float]

    def strength(self, symbol: str) -> str:
        """Say how surely a sign is known; empty if the data do not tell."""
        return next((word for limit, word in _STRENGTHS if self.margins.get(symbol, 0.0) >= limit), "")


def weigh(
    symbols: Sequence[str], ties: Sequence[Agreement], expected: Mapping[str, Mapping[str, float]]
) -> LikelySigns:
    """Find the signs of all symbols that agree best with ties and expectations.

    Parameters
    ----------
    symbols : sequence of str
    ties : sequence of Agreement
    expected : mapping of mappings
        By sensor what names, values and conventions say for each of its `USUAL_AXES`, and by symbol for its sign as it
        is (``"+"``), as logarithms.
    """
    signs = np.array(list(product((1, -1), repeat=len(symbols))), np.int8).reshape(2 ** len(symbols), len(symbols))
    of = {symbol: signs[:, k] for k, symbol in enumerate(symbols)}
    score = np.zeros(len(signs))
    for tie in ties:
        sides = [of[symbol] for symbol in tie.symbols if symbol in of]
        score += tie.weight * np.prod(sides, axis=0)
    for sensor, triple in TRIPLES.items():
        present = [(of[symbol], k) for k, symbol in enumerate(triple) if symbol in of]
        if present:
            score += _likely_axes(present, expected.get(sensor, {}))
    for symbol, own in of.items():
        score += expected.get(symbol, {}).get("+", 0.0) * own
    best = int(score.argmax())
    margins = {symbol: float(score[best] - score[own != own[best]].max(initial=-np.inf)) for symbol, own in of.items()}
    return LikelySigns({symbol: int(own[best]) for symbol, own in of.items()}, margins)


def _likely_axes(present: Sequence[tuple[NDArray[np.int8], int]], expected: Mapping[str, float]) -> Array:
    """Return how likely the signs of a sensor are: its nearest axes, less what is reversed in them."""
    scores = []
    for axes, usual in USUAL_AXES.items():
        reversed_ones = sum((own != usual[k]).astype(np.float64) for own, k in present)
        scores.append(expected.get(axes, 0.0) - _UNEXPECTED * (axes != "FRD") - _REVERSED * reversed_ones)
    return np.max(scores, axis=0)
