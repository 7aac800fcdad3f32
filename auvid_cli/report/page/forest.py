"""How far each estimate is from the truth or from another, in its standard deviations."""

from collections.abc import Iterable, Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np

from auvid_cli.evaluation.accuracy import CoefficientResult
from auvid_cli.evaluation.evaluate import Evaluation
from auvid_cli.report.layout import results_by_coefficient
from auvid_cli.report.notation import by_kind, filter_label
from auvid_cli.report.page.cells import symbol_parts
from auvid_cli.report.page.picture import Axis, Box, Dot, Picture, Rule, Shape, TextLabel

# Half the width, in standard deviations; a mark at the edge, with an arrow, stands for all beyond.
_WIDEST = 5.0
_ROW, _LEFT, _WIDTH, _TOP = 20.0, 64.0, 460.0, 12.0
# Of the height of a row, what its marks take.
_SPREAD = 0.7


class _Distance(NamedTuple):
    symbol: str
    filter: str
    sigmas: float


def deviations_from(origin: float | None, row: CoefficientResult, deviation: float) -> float | None:
    """Return how many standard deviations an estimate is from a value; None if that is not known."""
    if origin is None or not deviation > 0.0 or not isfinite(deviation):
        return None
    return (row.estimate - origin) / deviation


def forest(evaluation: Evaluation) -> list[Picture]:
    """Draw how far all estimates are from the truth or, without one, from those of the first filter; none if alone.

    Many coefficients take two pictures side by side, of forces and of moments.
    """
    filters = [row.filter for row in evaluation.summary]
    has_truth = any(row.true is not None for row in evaluation.coefficients)
    distances = _from_truth(evaluation) if has_truth else _from_first(evaluation, filters)
    if not distances:
        return []
    against = "the truth" if has_truth else f"the {filter_label(filters[0])}"
    shown = filters if has_truth else filters[1:]
    kinds = by_kind(list(dict.fromkeys(distance.symbol for distance in distances)))
    return [
        _picture(f"Distance from {against}{kind and f', {kind}'}", against, shown, symbols, distances)
        for kind, symbols in kinds.items()
    ]


def _picture(
    title: str, against: str, shown: Sequence[str], symbols: Sequence[str], every: Iterable[_Distance]
) -> Picture:
    """Draw the distances of some coefficients, a row for each."""
    distances = [distance for distance in every if distance.symbol in symbols]
    across = Axis(-_WIDEST, _WIDEST, _LEFT, _WIDTH - 16.0)
    bottom = _TOP + _ROW * len(symbols)
    shapes = _background(across, bottom, against)
    for place, symbol in enumerate(symbols):
        letter, below = symbol_parts(symbol)
        shapes.append(TextLabel(_LEFT - 8.0, _TOP + _ROW * (place + 0.5) + 4.0, letter, "end", below))
    for distance in distances:
        offset = _SPREAD * ((shown.index(distance.filter) + 0.5) / len(shown) - 0.5)
        shapes += _mark(distance, across, _TOP + _ROW * (symbols.index(distance.symbol) + 0.5 + offset))
    legend = [(name, filter_label(name)) for name in shown]
    says = _in_words(distances, against)
    return Picture(title, says, _WIDTH, bottom + 46.0, shapes, legend)


def _from_truth(evaluation: Evaluation) -> list[_Distance]:
    return [
        _Distance(row.coefficient, row.filter, sigmas)
        for row in evaluation.coefficients
        if (sigmas := deviations_from(row.true, row, row.standard_deviation)) is not None and isfinite(sigmas)
    ]


def _from_first(evaluation: Evaluation, filters: list[str]) -> list[_Distance]:
    """Compare in the larger of the two standard deviations, as judgements do."""
    distances = []
    for symbol, by_filter in results_by_coefficient(evaluation).items():
        first = by_filter.get(filters[0])
        for name in filters[1:]:
            if first is None or name not in by_filter:
                continue
            row = by_filter[name]
            larger = max(row.standard_deviation, first.standard_deviation)
            sigmas = deviations_from(first.estimate, row, larger)
            if sigmas is not None and isfinite(sigmas):
                distances.append(_Distance(symbol, name, sigmas))
    return distances


def _background(across: Axis, bottom: float, against: str) -> list[Shape]:
    middle, left, right = across.at(0.0), across.at(-2.0), across.at(2.0)
    return [
        Box(left, _TOP, right - left, bottom - _TOP, "chance"),
        *(Rule(across.at(k), _TOP, across.at(k), bottom, "grid") for k in range(-5, 6)),
        Rule(middle, _TOP, middle, bottom, "axis"),
        *(TextLabel(across.at(k), bottom + 16.0, f"{k:+d}" if k else "0", "middle") for k in range(-4, 5, 2)),
        TextLabel(middle, bottom + 36.0, f"(estimate - {against}) / standard deviation", "middle"),
    ]


def _mark(distance: _Distance, across: Axis, y: float) -> list[Shape]:
    says = f"{distance.symbol}, {filter_label(distance.filter)}: {distance.sigmas:+.2f}"
    x = across.at(float(np.clip(distance.sigmas, -_WIDEST, _WIDEST)))
    shapes: list[Shape] = [Dot(x, y, distance.filter, says)]
    if abs(distance.sigmas) > _WIDEST:
        shapes.append(TextLabel(x, y - 5.0, "→" if distance.sigmas > 0.0 else "←", "middle"))
    return shapes


def _in_words(distances: list[_Distance], against: str) -> str:
    worst = max(distances, key=lambda distance: abs(distance.sigmas))
    beyond = sum(abs(distance.sigmas) > _WIDEST for distance in distances)
    outside = f" {beyond} are farther than {_WIDEST:g} and stand at the edge, with an arrow." if beyond else ""
    return (
        f"Farthest from {against}: {worst.symbol} of {filter_label(worst.filter)}, by {abs(worst.sigmas):.2g} standard "
        f"deviations.{outside} Within the band of 2 to each side lie 95 of 100 if the standard deviations are right."
    )
