"""The page of what data can tell of each coefficient at best."""

from collections.abc import Sequence

import numpy as np

from auvid_cli.data.dataset import Dataset
from auvid_cli.evaluation.assessment import CLASSES, CoefficientBound, Identifiability
from auvid_cli.report.bounds import assessment_sentences, bounds_table, holding_sentence
from auvid_cli.report.notation import by_kind
from auvid_cli.report.page.cells import symbol_parts
from auvid_cli.report.page.correlation import correlation_parts
from auvid_cli.report.page.parts import Card, Cards, Page, Part, Plot, PlotLine, Plots, Section, TablePart, Words
from auvid_cli.report.page.picture import Axis, Box, Picture, Rule, TextLabel, decades
from auvid_cli.report.page.provenance import provenance_section
from auvid_cli.report.table import number

# Looks of the classes, from sure to unknown.
_LOOKS = dict(zip((label for _, label in CLASSES), ("sure", "known", "rough", "lost"), strict=True))
# Percent: a bar without bound, or beyond it, is so long, and says what it is.
_LARGEST = 1e4
_ROW, _LEFT, _WIDTH, _TOP = 20.0, 64.0, 460.0, 24.0


def identifiability_page(dataset: Dataset, identifiability: Identifiability, where: str) -> Page:
    """Lay out bounds, by what they are got, how they fall with time, and which coefficients go together.

    Parameters
    ----------
    dataset : Dataset
    identifiability : Identifiability
    where : str
        Whose coefficients the bounds hold at, in words.
    """
    symbols = [bound.coefficient for bound in identifiability.bounds]
    sections = (
        Section("verdict", "Verdict", [_verdict(identifiability), *_words(identifiability)]),
        Section("bounds", "Bounds", [*_bars(identifiability), TablePart(bounds_table(identifiability), sortable=True)]),
        Section("duration", "Bounds over the duration", _growth(identifiability)),
        Section("correlation", "What is known only together", _correlation(symbols, identifiability)),
        provenance_section(dataset),
    )
    return Page(
        f"Identifiability: {dataset.experiment.name}", f"{dataset.experiment.vehicle.name}, at {where}", sections
    )


def _verdict(identifiability: Identifiability) -> Cards:
    """Say of how many coefficients what is known, and what to do about the others."""
    classes = [bound.label for bound in identifiability.bounds]
    lost = [bound.coefficient for bound in identifiability.bounds if bound.label == CLASSES[-1][1]]
    says = (
        f"These data do not tell {', '.join(lost)}: hold these at known values, or move the vehicle differently."
        if lost
        else "These data can tell every coefficient to 20 % or better."
    )
    grade = "fails" if len(lost) == len(classes) else "doubtful" if lost else "passes"
    counts = {label: str(classes.count(label)) for _, label in CLASSES if label in classes}
    return Cards([Card("These data", "input", grade, says, counts)])


def _words(identifiability: Identifiability) -> list[Part]:
    holding = [] if identifiability.holding is None else [holding_sentence(identifiability.holding)]
    return [Words([*assessment_sentences(identifiability), *holding], listed=True)]


def _correlation(symbols: list[str], identifiability: Identifiability) -> list[Part]:
    if not np.isfinite(identifiability.correlation).any():
        return []
    return correlation_parts("Correlations of the errors at the bound", symbols, identifiability.correlation)


def _bars(identifiability: Identifiability) -> list[Picture]:
    """Draw bounds in percent of the value, by class, on a logarithmic scale; many in two pictures of the same scale."""
    percents = [min(bound.percent, _LARGEST) for bound in identifiability.bounds]
    low = np.floor(np.log10(max(min(percents), 1e-4)))
    high = np.ceil(np.log10(max(max(percents), 2.0 * CLASSES[-2][0])))
    across = Axis(float(low), float(high), _LEFT, _WIDTH - 56.0)
    of = {bound.coefficient: bound for bound in identifiability.bounds}
    kinds = by_kind([*of])
    return [
        _bars_of(f"Bounds{kind and f', {kind}'}", [of[name] for name in names], across) for kind, names in kinds.items()
    ]


def _bars_of(title: str, bounds: Sequence[CoefficientBound], across: Axis) -> Picture:
    bottom = _TOP + _ROW * len(bounds)
    shapes = decades(across, _TOP, bottom)
    for place, bound in enumerate(bounds):
        percent = min(bound.percent, _LARGEST)
        y = _TOP + _ROW * place
        letter, below = symbol_parts(bound.coefficient)
        end = across.at(float(np.log10(max(percent, 1e-4))))
        shapes.append(TextLabel(_LEFT - 8.0, y + 14.0, letter, "end", below))
        shapes.append(Box(_LEFT, y + 4.0, max(end - _LEFT, 1.0), _ROW - 8.0, _LOOKS[bound.label]))
        shapes.append(TextLabel(end + 4.0, y + 14.0, f"{number(bound.percent, 2) or 'none'}"))
    for limit, _ in CLASSES[:-1]:
        x = across.at(float(np.log10(limit)))
        shapes.append(Rule(x, _TOP, x, bottom, "axis"))
        shapes.append(TextLabel(x, _TOP - 8.0, f"{limit:g} %", "middle"))
    shapes.append(TextLabel(0.5 * (_LEFT + _WIDTH), bottom + 36.0, "bound, % of the value", "middle"))
    worst = max(bounds, key=lambda bound: bound.percent)
    says = f"Least standard deviation that the data allow, in percent of the value. Worst: {worst.coefficient}."
    legend = [(look, label) for label, look in _LOOKS.items() if any(b.label == label for b in bounds)]
    return Picture(title, says, _WIDTH, bottom + 46.0, shapes, legend)


def _growth(identifiability: Identifiability) -> list[Part]:
    """Plot how the bounds fall with the duration."""
    times = np.array([time for time, _ in identifiability.growth])
    percents = np.array([percent for _, percent in identifiability.growth])
    percents = np.where((percents > 0.0) & (percents < _LARGEST), percents, np.nan)
    lines = [
        PlotLine(bound.coefficient, _LOOKS[bound.label], times, percents[:, k])
        for k, bound in enumerate(identifiability.bounds)
    ]
    if not np.isfinite(percents).any():
        return []
    says = f"Bounds of all coefficients after {times[0]:.3g} to {times[-1]:.3g} s of these data."
    return [Plots([Plot("bounds", says, "% of the value", lines, "duration (s)", True, True)], wide=True)]
