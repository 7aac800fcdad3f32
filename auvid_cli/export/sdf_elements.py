"""Elements of SDF: what stands in one, and numbers that come back as they were."""

from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray


def child_of(parent: ElementTree.Element, tag: str, text: str | None = None, **attributes: str) -> ElementTree.Element:
    """Append an element to another and return it."""
    child = ElementTree.SubElement(parent, tag, attributes)
    child.text = text
    return child


def as_text(*values: float) -> str:
    """Write numbers, separated by spaces."""
    # Adding zero takes the sign off a zero.
    return " ".join(repr(float(value) + 0.0) for value in values)


def add_inertial(
    link: ElementTree.Element, mass: float, centre: tuple[float, float, float], moments: NDArray[np.float64]
) -> ElementTree.Element:
    """Append what a link weighs: kg, its centre of gravity, m, and the inertia about that, kg m^2, shape (3, 3)."""
    inertial = child_of(link, "inertial")
    child_of(inertial, "mass", as_text(mass))
    child_of(inertial, "pose", as_text(*centre, 0.0, 0.0, 0.0))
    inertia = child_of(inertial, "inertia")
    for row, column in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        child_of(inertia, f"i{'xyz'[row]}{'xyz'[column]}", as_text(moments[row, column]))
    return inertial
