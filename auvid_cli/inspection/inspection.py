"""Result of an inspection; helpers that all its checks use; stuck values and gaps."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import log
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from auvid_cli.arrays import Array, release_memory
from auvid_cli.data.checks import Check, Checks, NamedRows
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.data.signals import MAX_REPEAT, gap_limit, repeats, rounded_repeats, rounding_steps
from auvid_cli.vehicle.parameters import SENSORS
from auvid_cli.vehicle.rigid_body import GRAVITY

if TYPE_CHECKING:
    import pandas as pd

# Check of data, which belong to no filter.
judged = partial(Check.of, "")
MarkKind = Literal["gap", "clock", "stuck", "spike", "step"]
UNDETERMINED = "undetermined"
# For each SI unit, other units and the factor by which their numbers are larger.
_UNIT_FACTORS = {
    "m": {"feet": 1.0 / 0.3048, "mm": 1000.0, "cm": 100.0},
    "m/s": {"knots": 3600.0 / 1852.0, "ft/s": 1.0 / 0.3048, "km/h": 3.6, "mm/s": 1000.0, "cm/s": 100.0},
    "m/s^2": {"g": 1.0 / GRAVITY, "mg": 1000.0 / GRAVITY},
    "rad": {"degrees": 57.29577951308232, "mrad": 1000.0},
    "rad/s": {"deg/s": 57.29577951308232, "rad/min": 60.0, "revolutions per minute": 9.549296585513721},
}
_UNIT_TOLERANCE = log(1.1)  # tolerance of the logarithm of a factor


def undetermined(
    subject: str, check: str, reason: str, threshold: str, advice: str = "This was not checked and may be wrong."
) -> Check:
    """Return the check of something that these data do not determine."""
    statistic = f"{UNDETERMINED}: {reason}"
    return judged(subject, check, statistic=statistic, threshold=threshold, passed=None, advice=advice)


def mistaken_unit(symbol: str, unit: str, times: float) -> str:
    """Return a sentence on the unit that explains why a signal is `times` too large; empty if no usual one does.

    `unit` is the SI unit that the log map states; `times` is positive.
    """
    candidates = []
    for name, factor in _UNIT_FACTORS[unit].items():
        candidates.append((abs(log(times / factor)), f"{symbol} is in {name}, but was read as {unit}."))
        candidates.append((abs(log(times * factor)), f"{symbol} was in {unit}, but was converted from {name}."))
    nearest, words = min(candidates)
    return words if nearest < _UNIT_TOLERANCE else ""


def mistaken_units(gain: float, above: tuple[str, str], below: tuple[str, str]) -> str:
    """Return the sentences of `mistaken_unit` for a ratio of two signals, each a symbol and its SI unit."""
    if gain == 0.0:
        return ""
    size = abs(gain)
    return " Or: ".join(words for words in (mistaken_unit(*above, size), mistaken_unit(*below, 1.0 / size)) if words)


def suggested_units(gain: float, above: tuple[str, str], below: tuple[str, str]) -> str:
    """Return the sentences of `mistaken_units` as the end of an advice; empty if there are none."""
    units = mistaken_units(gain, above, below)
    return f" The gain suggests: {units}" if units else ""


class Mark(NamedTuple):
    """A time span, s, with a fault of a sensor."""

    sensor: str
    kind: MarkKind
    start: float
    end: float


@dataclass(frozen=True)
class Inspection:
    """Checks of a dataset, and the contents of its timeline."""

    checks: Checks
    marks: list[Mark]
    inputs: InputRecord  # evenly spaced samples of a long record
    # By sensor, shape (bins,): share of the usual number of measurements in equal intervals of the span, 0 to 1
    presence: dict[str, Array]
    span: tuple[float, float]  # first and last time of all records, s

    def rows(self) -> NamedRows:
        """Return the rows of ``inspection.csv``: checks without the column of the filter."""
        return NamedRows(Check._fields[1:], [check[1:] for check in self.checks])

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with one row per check; ``passed`` is missing for notes."""
        return self.rows().to_pandas()


def data_checks(segments: Sequence[Dataset], filter_name: str, sensors: Sequence[str]) -> list[Check]:
    """Check the used sensors for stuck values and gaps; time between segments is not a gap."""
    checks = []
    for name in sensors:
        records = [segment.sensors[name] for segment in segments]
        measured = [record for record in records if record.present.any(axis=1).sum() > 1]
        if measured:
            for check_record in (_stuck, _gap):
                _, worst = max(
                    (check_record(filter_name, name, record) for record in measured), key=lambda found: found[0]
                )
                checks.append(worst)
        release_memory()
    return checks


def _stuck(filter_name: str, name: str, record: SensorRecord) -> tuple[float, Check]:
    """Return the longest duration of a repeated measurement, s, and its check."""
    runs = repeats(record)
    duration = runs[:, 1] - runs[:, 0]
    rounded = rounded_repeats(record, runs)
    if not (duration[~rounded] > MAX_REPEAT).any() and (duration > MAX_REPEAT).any():
        return _rounded(filter_name, name, record, float(duration.max()))
    duration[rounded] = 0.0
    start, end = runs[int(np.argmax(duration))]
    return float(end - start), Check.of(
        filter_name,
        name,
        "stuck",
        statistic=f"{end - start:.4g} s from t = {start:.6g} s on",
        threshold=f"<= {MAX_REPEAT:g} s of the same measurement",
        passed=bool(end - start <= MAX_REPEAT),
        advice=f"{name} repeats one measurement from t = {start:.6g} s to {end:.6g} s: it failed or was logged twice. "
        "Exclude that time (`exclude` of the sensor in the map).",
    )


def _rounded(filter_name: str, name: str, record: SensorRecord, longest: float) -> tuple[float, Check]:
    """Return `longest`, s, and a note with the rounding steps and the noise that they imply."""
    steps = {
        quantity.symbol: (f"{step:.3g} {quantity.unit}", f"{step / np.sqrt(12.0):.2g} {quantity.unit}")
        for quantity, step in zip(SENSORS[name], rounding_steps(record), strict=True)
        if step > 0.0
    }
    sizes = ", ".join(f"{symbol} by {step}" for symbol, (step, _) in steps.items())
    noise = ", ".join(f"{least} for {symbol}" for symbol, (_, least) in steps.items())
    return longest, Check.of(
        filter_name,
        name,
        "stuck",
        statistic=f"quantised: {sizes}; constant for up to {longest:.4g} s",
        threshold=f"<= {MAX_REPEAT:g} s of the same measurement, unless it is rounded",
        passed=None,
        advice=f"{name} is recorded in steps and at times changes by less than one. This is not a failure, but adds "
        f"autocorrelated noise of step / sqrt(12): set `standard_deviation` in the map to at least {noise}. In the "
        "next log, record more digits.",
    )


def _gap(filter_name: str, name: str, record: SensorRecord) -> tuple[float, Check]:
    """Return the longest time without a measurement, s, and its check."""
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
        advice=f"{name} has no measurement from t = {time[longest]:.6g} s to {time[longest + 1]:.6g} s. A filter "
        "bridges this with the model alone: check that the innovations after it are small again.",
    )
