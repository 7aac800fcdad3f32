"""What a target cannot hold of an identified model."""

from collections.abc import Collection
from typing import NamedTuple

from auvid_cli.export.model import IdentifiedModel
from auvid_cli.export.terms import TermSize

COVARIANCES = "The covariances between coefficients are lost; their standard deviations are here."


class Losses(NamedTuple):
    """What is lost.

    Attributes
    ----------
    terms : tuple of TermSize
        Terms of the equations of motion, with how large they are.
    notes : tuple of str
        All else, a sentence each.
    """

    terms: tuple[TermSize, ...]
    notes: tuple[str, ...]


def losses_of(model: IdentifiedModel, symbols: Collection[str], notes: tuple[str, ...]) -> Losses:
    """The terms of these coefficients, and other losses as sentences."""
    return Losses(tuple(size for size in model.term_sizes if size.symbol in symbols), notes)


def loss_lines(losses: Losses) -> list[str]:
    """Losses in words, a line each."""
    if not losses.terms and not losses.notes:
        return ["Nothing is lost."]
    if not losses.terms:
        return ["No term of the equations of motion is lost.", *losses.notes]
    opening = "Terms that are lost, RMS along the estimated motion and share of all terms of their row:"
    terms = [f"  {t.symbol} in {t.row}: {t.rms:.3g} {t.unit}, {t.percent:.3g} %" for t in losses.terms]
    return [opening, *terms, *losses.notes]
