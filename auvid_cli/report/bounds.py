"""Bounds of coefficients in a table and in sentences, as for the terminal so for pages."""

import numpy as np

from auvid_cli.evaluation.assessment import CLASSES, Holding, Identifiability
from auvid_cli.report.screen_table import printed
from auvid_cli.report.sentence import sentence
from auvid_cli.report.table import Cell, Column, Symbol, Table, UnitCell

_NOTES = (
    "Bound: the least standard deviation that any estimate from these data can have (Cramer-Rao), with the noise of "
    "the sensors alone; with noise %: with process noise, too. The class goes by the larger. Mostly from: the sensor "
    "that says most of it, and its share.",
)


def assessment_sentences(identifiability: Identifiability) -> list[str]:
    """Say what is missing, what goes together, what cannot be observed, and how bounds fall."""
    sentences = [sentence(identifiability.remark)] if identifiability.remark else []
    sentences += [
        f"{', '.join(group.members)} go together: {group.combination} is known to {group.percent:.2g} %, "
        f"the worst of them alone to {group.worst_percent:.2g} %"
        for group in identifiability.groups
    ]
    for symbol, error in identifiability.sensor_errors.items():
        unobserved = "" if error.observed else ": cannot be observed on this manoeuvre"
        sentences.append(f"{symbol}: bound {printed(error.bound, 2)}, prior {printed(error.prior, 2)}{unobserved}")
    half = min(identifiability.growth, key=lambda entry: abs(entry[0] - 0.5 * identifiability.growth[-1][0]))
    whole = identifiability.growth[-1]
    medians = [f"{np.median(percent):.2g} % after {time:.4g} s" for time, percent in dict([half, whole]).items()]
    return [*sentences, f"median bound {', '.join(medians)}"]


def holding_sentence(holding: Holding) -> str:
    """Say what data tell of, and the setting that holds the rest."""
    missing = f", of which it must first state {', '.join(holding.unstated)}" if holding.unstated else ""
    only = f"These data tell of {', '.join(holding.motions)} alone. " if len(holding.motions) < 6 else ""
    return (
        f"{only}Hold {', '.join(holding.held)} at the values of the vehicle file{missing}; then the rest is known to "
        f"{holding.worst_percent:.2g} % or better:\n"
        f"  --set 'identification.coefficients=[{', '.join(holding.kept)}]'"
    )


def bounds_table(identifiability: Identifiability) -> Table:
    """Lay out bounds by class, and what they mostly come from."""
    ranks = {label: rank for rank, (_, label) in enumerate(CLASSES)}
    columns = (
        *(Column(header, numeric=False) for header in ("symbol", "unit")),
        *(Column(header) for header in ("value", "bound", "bound %", "with noise %")),
        *(Column(header, numeric=False) for header in ("class", "mostly from", "goes with")),
    )
    rows: list[list[Cell]] = [
        [
            Symbol(bound.coefficient),
            UnitCell(bound.unit),
            bound.value,
            printed(bound.cramer_rao_bound, 2),
            printed(bound.percent, 2),
            printed(bound.percent_with_noise, 2),
            bound.label,
            f"{bound.best_sensor} {bound.best_share:.0%}",
            bound.group,
        ]
        for bound in sorted(identifiability.bounds, key=lambda bound: ranks[bound.label])
    ]
    table = Table("bounds", "Least standard deviations that the data allow", columns, rows, notes=_NOTES)
    return table if identifiability.groups else table.without("goes with")
