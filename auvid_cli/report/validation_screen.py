"""What an identified model predicts of other data, for the terminal; angles in degrees."""

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from auvid_cli.report.judgements import judgement_sentences
from auvid_cli.report.notation import filter_label
from auvid_cli.report.screen import print_checks
from auvid_cli.report.screen_table import narrowed, printed, screen_table
from auvid_cli.report.sentence import sentence
from auvid_cli.report.table import Cell, Column, Table
from auvid_cli.validation.results import AHEAD, FREE_RUN, NO_WIDER, ManoeuvreNumber, Prediction, Validation

_DIGITS = 3
# What gives way where the terminal is narrow, first to last.
_LEAST_OF_MODELS = "vehicle file", "prior", "unchanged"
_ERRORS = (
    "Free run: the model moved from its start by the inputs alone. Noise: of the sensor, as stated. Unchanged: errors "
    "if the motion stayed as at the start; prior, vehicle file: by the coefficients known before, and by the file's."
)
_BAND = (
    "Band: two standard deviations of coefficients, start, measurements and what the model is seen to lack, together."
)


def print_validation(console: Console, validation: Validation, passed: bool) -> None:
    """Print what is against the estimate, errors of the free run, fits by horizon, manoeuvres, and verdicts.

    Parameters
    ----------
    console : rich.console.Console
    validation : Validation
    passed : bool
        Whether verdicts that passed are printed as well.
    """
    if validation.judgement.is_against:
        for line in judgement_sentences({validation.filter: validation.judgement}, with_sound=False):
            console.print(Text(line))
    ahead = [row for row in validation.predictions if row.kind == AHEAD]
    free = [row for row in validation.predictions if row.kind == FREE_RUN]
    console.print(narrowed(console, _free_run(free), _LEAST_OF_MODELS, _DIGITS))
    if free:
        console.print(Text(_ERRORS))
        console.print()
    if ahead:
        console.print(screen_table(console, _fits_ahead(ahead), _DIGITS))
        if any(row.share_within_band is not None for row in ahead):
            console.print(Text(_BAND))
    for line in _manoeuvres(validation.manoeuvres):
        console.print(Text(line))
    for remark in validation.remarks:
        console.print(Text(sentence(remark)))
    print_checks(console, validation.checks, passed)
    console.print(Text(_conclusion(validation)))


def _conclusion(validation: Validation) -> str:
    """Say whether the model predicts these data, or what of them, and what it does not."""
    worse = {
        "in the free run": validation.worse_than_the_mean(FREE_RUN),
        "ahead": validation.worse_than_the_mean(AHEAD),
    }
    unpredicted = {signal for signals in worse.values() for signal in signals}
    predicted = [s for s in dict.fromkeys(row.signal for row in validation.predictions) if s not in unpredicted]
    failed = {check.check for check in validation.checks if check.passed is False}
    if failed - {NO_WIDER} or not predicted:
        conclusion = "does not predict these data."
    elif failed:
        conclusion = f"predicts {', '.join(predicted) + ' of ' if unpredicted else ''}these data, with bands too wide."
    elif unpredicted:
        conclusion = f"predicts {', '.join(predicted)} of these data."
    else:
        conclusion = "predicts these data."
    if unpredicted:
        where_worse = "; ".join(f"{', '.join(signals)} {where}" for where, signals in worse.items() if signals)
        conclusion += f" Worse than their mean (fit below 0): {where_worse}."
    return f"The model of the {filter_label(validation.filter)} {conclusion}"


def _free_run(rows: Sequence[Prediction]) -> Table:
    columns = (
        *(Column(header, numeric=False) for header in ("free run", "unit")),
        *(Column(header) for header in ("noise", "fit %", "RMSE", "unchanged", "prior", "vehicle file")),
    )
    body: list[list[Cell]] = []
    for row in rows:
        values = row.noise, row.rmse, row.constant_velocity_rmse, row.prior_rmse, row.vehicle_file_rmse
        noise, *errors = (_in_degrees(value, row.unit) for value in values)
        body.append([row.signal, _degrees(row.unit), noise, row.fit_percent, *errors])
    return Table("free-run", "Errors of the free run", columns, body)


def _fits_ahead(rows: Sequence[Prediction]) -> Table:
    """Lay out the fit by signal and horizon, and the share of errors that the stated uncertainty explains."""
    horizons = list(dict.fromkeys(row.horizon_s for row in rows))
    columns = Column("fit % ahead", numeric=False), *(Column(f"{horizon:g} s") for horizon in horizons)
    fits = {(row.signal, row.horizon_s): row.fit_percent for row in rows}
    signals = dict.fromkeys(row.signal for row in rows)
    body: list[list[Cell]] = [[signal, *(fits.get((signal, horizon)) for horizon in horizons)] for signal in signals]
    within: list[Cell] = ["% within band", *(_share_within(rows, horizon) for horizon in horizons)]
    return Table("fits-ahead", "Fits ahead", columns, [*body, within])


def _share_within(rows: Sequence[Prediction], horizon: float) -> float | None:
    """Average the share over the errors of all signals at a horizon, percent."""
    shares = [row.share_within_band for row in rows if row.horizon_s == horizon and row.share_within_band is not None]
    return 100.0 * sum(shares) / len(shares) if shares else None


def _manoeuvres(numbers: Sequence[ManoeuvreNumber]) -> list[str]:
    """Write a line for each kind of number; those of a zigzag are many, and their mean is printed."""
    kinds: dict[tuple[str, str], list[ManoeuvreNumber]] = {}
    for number in numbers:
        kinds.setdefault((number.manoeuvre, number.number.rstrip(" 0123456789")), []).append(number)
    lines = []
    for (manoeuvre, kind), alike in kinds.items():
        unit = alike[0].unit
        predictions = [number.predicted for number in alike if number.predicted is not None]
        measured = _in_degrees(float(np.mean([number.measured for number in alike])), unit)
        predicted = _in_degrees(float(np.mean(predictions)), unit) if len(predictions) == len(alike) else None
        count = f" (mean of {len(alike)})" if len(alike) > 1 else ""
        what = f"{manoeuvre}, {kind}{count}" + ("" if unit == "1" else f" in {_degrees(unit)}")
        lines.append(f"{what}: measured {printed(measured)}, predicted {printed(predicted)}")
    return lines


def _degrees(unit: str) -> str:
    return unit.replace("rad", "deg")


def _in_degrees(value: float | None, unit: str) -> float | None:
    return float(np.rad2deg(value)) if value is not None and unit.startswith("rad") else value
