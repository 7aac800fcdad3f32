"""Numbers of a page as text that a browser reads at once."""

import base64

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LARGEST = float(np.finfo(np.float32).max)


class PackedArrays:
    """Arrays as base64 of little-endian float32, each that occurs more than once kept once.

    Seven digits are more than a screen shows; times are to be told from near their first, so that those of a long
    record keep their fractions. What is too large, and so what is not finite, is a gap.

    Attributes
    ----------
    texts : list of str
    """

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._places: dict[bytes, int] = {}

    def add(self, values: Array) -> int:
        """Return the place of an array in `texts`, and put it there if it is new."""
        fits = np.abs(values) <= _LARGEST
        content = np.where(fits, values, np.nan).astype("<f4").tobytes()
        place = self._places.setdefault(content, len(self.texts))
        if place == len(self.texts):
            self.texts.append(base64.b64encode(content).decode("ascii"))
        return place
