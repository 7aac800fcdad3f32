"""Result of an inspection, and the checks of a dataset that it gives."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.checks import Check, Checks, NamedRows
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.data.signals import MAX_REPEAT, gap_limit, repeats, rounded_repeats, rounding_steps
from auvid_cli.vehicle.parameters import SENSORS

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
# Data belong to no filter.
judged = partial(Check.of, "")
MarkKind = Literal["gap", "clock", "stuck", "spike", "step"]


def cannot_tell(subject: str, check: str, reason: str, threshold: str) -> Check:
    """Make the verdict on what these data do not tell."""
    return judged(
        subject,
        check,
        statistic=f"cannot tell: {reason}",
        threshold=threshold,
        passed=None,
        advice="This was not checked, and may be wrong.",
    )


class Mark(NamedTuple):
    """A time, s, at which something is the matter with a sensor."""

    sensor: str
    kind: MarkKind
    start: float
    end: float


@dataclass(frozen=True)
class Inspection:
    """Verdicts on a dataset, and what a timeline of it shows.

    Attributes
    ----------
    checks : Checks
    marks : list of Mark
    inputs : InputRecord
        Of long ones evenly spaced samples.
    presence : dict of ndarray, shape (bins,)
        By sensor, how many of the usual measurements there are in each of equal pieces of the span, 0 to 1.
    span : tuple of float
        First and last time of anything, s.
    """

    checks: Checks
    marks: list[Mark]
    inputs: InputRecord
    presence: dict[str, Array]
    span: tuple[float, float]

    def rows(self) -> NamedRows:
        """Return the rows of ``inspection.csv``: a check begins with the filter that it is of, and data are of none."""
        return NamedRows(Check._fields[1:], [check[1:] for check in self.checks])

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each verdict; ``passed`` is missing of what is only worth knowing."""
        return self.rows().to_pandas()


def data_checks(segments: Sequence[Dataset], filter_name: str, sensors: Sequence[str]) -> list[Check]:
    """Judge stuck values and gaps of the sensors that a filter used; time between two segments is no gap."""
    checks = []
    for name in sensors:
        records = [segment.sensors[name] for segment in segments]
        measured = [record for record in records if np.isfinite(record.values).any(axis=1).sum() > 1]
        if measured:
            for judge in (_stuck, _gap):
                _, worst = max((judge(filter_name, name, record) for record in measured), key=lambda judged: judged[0])
                checks.append(worst)
    return checks


def _stuck(filter_name: str, name: str, record: SensorRecord) -> tuple[float, Check]:
    """Return the longest time over which a measurement is repeated exactly, s, and the verdict on it."""
    runs, rounded = repeats(record), rounded_repeats(record)
    lasted = runs[:, 1] - runs[:, 0]
    if not (lasted[~rounded] > MAX_REPEAT).any() and (lasted > MAX_REPEAT).any():
        return _rounded(filter_name, name, record, float(lasted.max()))
    lasted[rounded] = 0.0
    start, end = runs[int(np.argmax(lasted))]
    return float(end - start), Check.of(
        filter_name,
        name,
        "stuck",
        statistic=f"{end - start:.4g} s from t = {start:.6g} s on",
        threshold=f"<= {MAX_REPEAT:g} s of the same measurement",
        passed=bool(end - start <= MAX_REPEAT),
        advice=f"{name} repeats one measurement from t = {start:.6g} s to {end:.6g} s: it has failed or was logged "
        "twice. Mark that time as not valid.",
    )


def _rounded(filter_name: str, name: str, record: SensorRecord, longest: float) -> tuple[float, Check]:
    """Say that measurements repeat themselves because they are rounded, and what noise that is at least."""
    steps = {
        quantity.symbol: (f"{step:.3g} {quantity.unit}", f"{step / np.sqrt(12.0):.2g} {quantity.unit}")
        for quantity, step in zip(SENSORS[name], rounding_steps(record), strict=True)
        if step > 0.0
    }
    each = ", ".join(f"{symbol} by {step}" for symbol, (step, _) in steps.items())
    noise = ", ".join(f"{least} of {symbol}" for symbol, (_, least) in steps.items())
    return longest, Check.of(
        filter_name,
        name,
        "stuck",
        statistic=f"quantised: {each}; the same for up to {longest:.4g} s",
        threshold=f"<= {MAX_REPEAT:g} s of the same measurement, if it is not rounded",
        passed=None,
        advice=f"{name} is recorded in steps and changes by less for a while. That is no failure, but noise of "
        f"step / sqrt(12), which lasts: state no less than {noise}, or log more digits.",
    )


def _gap(filter_name: str, name: str, record: SensorRecord) -> tuple[float, Check]:
    """Return the longest time without a measurement, s, and the verdict on it."""
    time = record.measured_times
    intervals = np.diff(time)
    longest = int(intervals.argmax())
    limit = gap_limit(intervals)
    return float(intervals[longest]), Check.of(
        filter_name,
        name,
        "gap",
        statistic=f"{intervals[longest]:.4g} s from t = {time[longest]:.6g} s on",
        threshold=f"<= {limit:.3g} s without a measurement",
        passed=True if intervals[longest] <= limit else None,
        advice=f"{name} is silent from t = {time[longest]:.6g} s to {time[longest + 1]:.6g} s. The filter bridges it "
        "with the model alone: see in the innovations whether it caught up.",
    )
