"""Trial of a model: fit to the first two thirds of the data, and prediction of the last third."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees, isfinite

from auvid_cli.config.enums import JUDGE
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.identification import Use
from auvid_cli.data.dataset import Dataset, cut
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.identification.terms import split
from auvid_cli.validation.results import AHEAD, Prediction
from auvid_cli.validation.validate import validate

# Signals that show a turn, and their names.
_SIGNALS = {"r": "yaw rate", "v": "sway"}
_HORIZONS = 20.0, 10.0, 5.0, 2.0  # s; the longest with predictions counts
_STARTS = 40
_MIN_LENGTH = 30.0  # s; shorter data are not split
# Share of an error below which two models predict equally well.
_MARGIN = 0.1
# Coefficient errors of the vehicle that the vehicle file does not have.
_VEHICLE_ERRORS = "thrust_scale", "rudder_trim", "elevator_trim", "excess_buoyancy", "trim_moment"


@dataclass(frozen=True)
class Trial:
    """Errors of the predictions of a signal by the model, the vehicle file, and an unchanged motion."""

    signal: str
    horizon: float  # s
    unit: str
    model: float
    vehicle_file: float | None  # None if the file has no coefficients, or its model diverged
    unchanged: float | None

    @property
    def other(self) -> tuple[str, float | None]:
        """Return the model to compare with, and its error: the vehicle file, or without one an unchanged motion."""
        if self.vehicle_file is not None:
            return "vehicle file", self.vehicle_file
        return "unchanged motion", self.unchanged

    @property
    def gain(self) -> float:
        """Return the share by which the error is smaller than that of the other; 0 without one."""
        other = self.other[1]
        return 0.0 if not other else 1.0 - self.model / other

    def __str__(self) -> str:
        factor, unit = (degrees(1.0), "deg/s") if self.unit == "rad/s" else (1.0, self.unit)
        text = f"{_SIGNALS[self.signal]} {self.horizon:g} s ahead: {factor * self.model:.3g} {unit}"
        name, other = self.other
        if other is None:
            return text
        compared = f"{abs(self.gain):.0%} {'better' if self.gain > 0.0 else 'worse'}"
        return f"{text}, {name} {factor * other:.3g}: {compared}"


def try_on_held_out(dataset: Dataset, settings: RunSettings) -> tuple[Trial, ...]:
    """Return the errors of predictions of the last third by a fit to the rest; empty if the data are too short.

    The vehicle file is used as it is: its coefficients, without estimated errors of thrust, fins and ballast.
    """
    errors = settings.identification.estimate.biases
    stated = settings.with_estimate(biases=tuple(error for error in errors if error != BiasName.DELAY))
    data = replace(dataset, experiment=stated)
    training, held_out = split(prepare(data))
    if sum(end - begin for begin, end in held_out) < _MIN_LENGTH / 3.0:
        return ()
    fitted = identify(replace(data, experiment=stated.with_identification(use=Use(spans=training))), JUDGE)
    if not fitted.completed:
        return ()
    parts = [cut(replace(dataset, truth=None), begin, end) for begin, end in held_out]
    try:
        rows = validate(parts, fitted, starts=_STARTS).predictions
    except DataError:
        return ()
    file_rows = _file_rows(parts, fitted)
    trials = []
    for signal in _SIGNALS:
        own = {row.horizon_s: row for row in rows if row.kind == AHEAD and row.signal == signal}
        horizon = next((h for h in _HORIZONS if h in own), None)
        if horizon is None or (model := own[horizon].rmse) is None:
            continue
        row = own[horizon]
        by_file = next((r.rmse for r in file_rows if r.signal == signal and r.horizon_s == horizon), None)
        trials.append(Trial(signal, horizon, row.unit, model, by_file, row.constant_velocity_rmse))
    return tuple(trials)


def _file_rows(parts: Sequence[Dataset], fitted: Estimate) -> list[Prediction]:
    """Return predictions of the vehicle file as it is; none if it lacks a coefficient."""
    stated = fitted.experiment.vehicle.stated_coefficients()
    symbols = [fitted.state[row] for row in fitted.coefficient_rows]
    if not all(symbol in stated for symbol in symbols):
        return []
    values = stated | dict.fromkeys(_VEHICLE_ERRORS, 0.0)
    mean = fitted.mean.copy()
    for row, symbol in enumerate(fitted.state):
        if symbol in values:
            mean[:, row] = values[symbol]
    try:
        rows = validate(parts, replace(fitted, mean=mean), starts=_STARTS).predictions
    except DataError:
        return []
    return [row for row in rows if row.kind == AHEAD and row.rmse is not None and isfinite(row.rmse)]


def trial_text(trials: Sequence[Trial]) -> str:
    """Return the result of a trial in a sentence or two; empty without one."""
    if not trials:
        return ""
    text = f"Last third of the data, predicted by a fit to the rest: {'; '.join(map(str, trials))}."
    if min(trial.gain for trial in trials) < -_MARGIN:
        return f"{text} The model predicts worse than the {trials[0].other[0]}: it is not recommended."
    if max(trial.gain for trial in trials) <= _MARGIN:
        return f"{text} The {trials[0].other[0]} predicts as well."
    return text
