"""What an identified model predicts of other data, for the terminal; angles in degrees."""

from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from auvid_cli.evaluation.estimate_checks import failed
from auvid_cli.report.notation import filter_label
from auvid_cli.report.screen import print_checks, printed
from auvid_cli.report.screen_table import first_that_fits, screen_table
from auvid_cli.report.sentence import sentence
from auvid_cli.validation.results import AHEAD, FREE_RUN, ManoeuvreNumber, Prediction, Validation

_DIGITS = 3
_BAND = "Band: two standard deviations of coefficients, start and measurements together, without process noise."


def print_validation(console: Console, validation: Validation) -> None:
    """Print errors of the free run, fits by horizon, numbers of manoeuvres, and verdicts."""
    ahead = [row for row in validation.predictions if row.kind == AHEAD]
    free = [row for row in validation.predictions if row.kind == FREE_RUN]
    console.print(first_that_fits(console, _ever_fewer_models(free)))
    if ahead:
        console.print(_fits_ahead(ahead))
        if any(row.share_within_band is not None for row in ahead):
            console.print(Text(_BAND))
    for line in _manoeuvres(validation.manoeuvres):
        console.print(Text(line))
    for remark in validation.remarks:
        console.print(Text(sentence(remark)))
    print_checks(console, validation.checks)
    console.print(Text(_verdict(validation)))


def _verdict(validation: Validation) -> str:
    """Say whether the model predicts these data, or what of them, and what it does not."""
    worse = {
        "in the free run": validation.worse_than_the_mean(FREE_RUN),
        "ahead": validation.worse_than_the_mean(AHEAD),
    }
    unpredicted = {signal for signals in worse.values() for signal in signals}
    predicted = [s for s in dict.fromkeys(row.signal for row in validation.predictions) if s not in unpredicted]
    if failed(validation.checks) or not predicted:
        verdict = "does not predict these data."
    elif unpredicted:
        verdict = f"predicts {', '.join(predicted)} of these data."
    else:
        verdict = "predicts these data."
    if unpredicted:
        where_worse = "; ".join(f"{', '.join(signals)} {where}" for where, signals in worse.items() if signals)
        verdict += f" Worse than their mean (fit below 0): {where_worse}."
    return f"The model of the {filter_label(validation.filter)} {verdict}"


def _ever_fewer_models(rows: Sequence[Prediction]) -> Iterator[Table]:
    """Tabulate errors of the free run, a line for each signal; with ever fewer of the other models."""
    others = "unchanged", "prior", "vehicle file"
    for count in range(len(others), -1, -1):
        table = screen_table()
        table.add_column("free run")
        table.add_column("unit")
        for header in ("noise", "fit %", "RMSE", *others[:count]):
            table.add_column(header, justify="right")
        for row in rows:
            theirs = (row.constant_velocity_rmse, row.prior_rmse, row.vehicle_file_rmse)[:count]
            noise, *errors = (_in_degrees(value, row.unit) for value in (row.noise, row.rmse, *theirs))
            numbers = (printed(value, _DIGITS) for value in (noise, row.fit_percent, *errors))
            table.add_row(row.signal, _degrees(row.unit), *numbers)
        yield table


def _fits_ahead(rows: Sequence[Prediction]) -> Table:
    """Tabulate the fit by signal and horizon, and the share of errors that the stated uncertainty explains."""
    horizons = list(dict.fromkeys(row.horizon_s for row in rows))
    table = screen_table()
    table.add_column("fit % ahead")
    for horizon in horizons:
        table.add_column(f"{horizon:g} s", justify="right")
    fits = {(row.signal, row.horizon_s): row.fit_percent for row in rows}
    for signal in dict.fromkeys(row.signal for row in rows):
        table.add_row(signal, *(printed(fits.get((signal, horizon)), _DIGITS) for horizon in horizons))
    shares = [_share_within(rows, horizon) for horizon in horizons]
    table.add_row("% within band", *(printed(share, _DIGITS) for share in shares))
    return table


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
