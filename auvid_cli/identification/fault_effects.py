"""Effects of faults on the data of a problem, and the score tests of these faults after a run of the smoother."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import CURRENT, EXCESS_BUOYANCY, FIN_TRIMS, THRUST_SCALE, TRIM_MOMENT
from auvid_cli.data.estimate import EstimateHeader
from auvid_cli.data.faults import LARGEST_FAULT, ConsideredErrors, Fault, FaultKind, FaultTest
from auvid_cli.filters.fault_scores import (
    most_likely_sizes,
    needed_faults,
    second_moments,
    significances,
)
from auvid_cli.filters.problem import AlternativeEstimate, FaultScores, FilterOutcome, Timeline
from auvid_cli.filters.signatures import FaultEffects
from auvid_cli.filters.smoother_forward import Linearised
from auvid_cli.identification.faults import (
    DELAY_FAULTS,
    FAULTS,
    FaultedVehicle,
    FaultModel,
    Motion,
    held_coefficient,
    stated_parameters,
)
from auvid_cli.identification.problem_setup import AugmentedProblem
from auvid_cli.vehicle.equations import factors
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

_CURRENTS = tuple(quantity.symbol for quantity in CURRENT)
_BALLAST = EXCESS_BUOYANCY.symbol, TRIM_MOMENT.symbol
_ORIGIN = (0.0, 0.0, 0.0)
_THRUST_INPUT = INPUT_SYMBOLS.index("surge_force")
_FINS = tuple(INPUT_SYMBOLS.index(name) for name in ("rudder", "elevator"))
# Quantile of the changes of an input that separates small changes, which may be reactions, from planned ones.
_SMALL_QUANTILE = 0.98
# Smallest decrease of the innovations' sum of squares by errors within the tolerances, in standard deviations of that
# sum. From this decrease on, the innovations are judged without these errors.
_MIN_DECREASE = 0.5
_LENGTHS = ("centre_of_gravity", "trim")  # tolerances of parameters that are not shares of their values


class VehicleFaults:
    """The faults that may be in the data of an augmented problem.

    Parameters
    ----------
    problem : AugmentedProblem
    delays : collection of str
        Symbols of estimated delays; these faults come last.
    tested : sequence of FaultModel
        Faults to test; those that a state represents are left out.
    """

    def __init__(
        self, problem: AugmentedProblem, delays: Collection[str] = (), tested: Sequence[FaultModel] = FAULTS
    ) -> None:
        self._problem = problem
        present, modelled = ("", *problem.measuring), (*problem.layout.symbols, *delays)
        if tested is FAULTS:
            held = (coefficient for coefficient in problem.coefficients if problem.held.get(coefficient.symbol))
            tested = *FAULTS, *stated_parameters(problem.known_deviations), *map(held_coefficient, held)
        self._motion_rows = problem.layout.moving_rows_of("motion")
        constant = problem.layout.symbols[: problem.layout.n_parameters]
        modelled_terms = {c.regressor for c in problem.coefficients if c.symbol in modelled or problem.held[c.symbol]}
        others = (
            fault
            for fault in tested
            if fault.sensor in present
            and (fault.state in constant if fault.is_drift else fault.state not in modelled)
            and (not fault.reacts_to or fault.reacts_to in modelled)
            and fault.regressor not in modelled_terms
        )
        self._faults = *others, *(DELAY_FAULTS[symbol] for symbol in delays)
        # `effects` puts in the coefficients of each trajectory.
        without = factors(dict.fromkeys(problem.coefficients.symbols, 0.0), of_vehicle=problem.coefficients)
        self._vehicle = FaultedVehicle(problem.known, without, problem.coefficients.terms, *self._mounted())

        rates = np.concatenate([segment.timelines.input_rate() for segment in problem.segments])
        sizes = np.abs(rates, out=rates)
        self._largest_small_rate = np.quantile(sizes, _SMALL_QUANTILE, axis=0, overwrite_input=True)

    @property
    def labels(self) -> tuple[FaultModel, ...]:
        """Return the faults of the present sensors that no state represents."""
        return self._faults

    def effects(self, segment: int, timeline: Timeline, about: Linearised) -> FaultEffects:
        """Return the effects of the faults on a chunk of a segment, along a trajectory."""
        identified = self._problem.held | self._identified(about.parameters)
        model = self._vehicle.with_coefficients(factors(identified, of_vehicle=self._problem.coefficients))
        # Rows of the inputs that hold during the chunk.
        of_chunk = np.concatenate([timeline.substep_input, timeline.event_input])
        first_input = int(of_chunk.min())
        rate = self._problem.segments[segment].timelines.input_rate(first_input, int(of_chunk.max()) + 1)
        small = np.where(np.abs(rate) <= self._largest_small_rate, rate, 0.0)
        states, times = np.vstack([about.before, about.moving]), np.append(timeline.time[:1], timeline.time)
        motion = states[:, self._motion_rows]
        current, ballast = (
            np.column_stack([self._along(symbol, about.parameters, states) for symbol in symbols])
            for symbols in (_CURRENTS, _BALLAST)
        )
        # Acting inputs, from estimated errors of thrust and fins: gain times recorded input, plus trim.
        shape = len(states), timeline.inputs.shape[1]
        gain, trim = np.ones(shape), np.zeros(shape)
        gain[:, _THRUST_INPUT] += self._along(THRUST_SCALE.symbol, about.parameters, states)
        for fin, state in zip(_FINS, FIN_TRIMS, strict=True):
            trim[:, fin] = self._along(state.symbol, about.parameters, states)

        def motion_at(row: NDArray[np.int64], input_row: NDArray[np.int64], later: Array | None = None) -> Motion:
            inputs = gain[row] * timeline.inputs[input_row] + trim[row]
            moved = motion[row] if later is None else motion[row] + later[:, None] * (motion[row + 1] - motion[row])
            rates = model.rates(moved, inputs, ballast[row])
            input_rates = gain[row] * rate[input_row - first_input], gain[row] * small[input_row - first_input]
            return Motion(moved, inputs, *input_rates, rates, current[row], ballast[row], times[row])

        # Midpoint rule over each substep, with motion that is linear between two events.
        n_substeps, substep_input = np.diff(timeline.substep_offset), timeline.substep_input
        has_substeps, duration = n_substeps > 0, timeline.substep_duration[:, None]
        first = timeline.substep_offset[:-1][has_substeps]
        before = np.repeat(np.arange(timeline.time.size), n_substeps)
        until = np.cumsum(timeline.substep_duration)
        begin = (until - timeline.substep_duration)[timeline.substep_offset[before]]
        whole = until[timeline.substep_offset[before + 1] - 1] - begin
        in_substeps = motion_at(before, substep_input, (until - 0.5 * timeline.substep_duration - begin) / whole)
        # An effect in the middle of an event's substeps reaches their end through half of the transition.
        n = about.parameters.size
        rows = np.arange(n + self._motion_rows.start, n + self._motion_rows.stop)
        halfway = 0.5 * (np.eye(rows.size) + about.transition[has_substeps][:, self._motion_rows][..., rows])
        event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
        last = timeline.event_input.copy()
        last[has_substeps] = substep_input[timeline.substep_offset[1:][has_substeps] - 1]
        measured = {
            sensor: np.flatnonzero(timeline.measurement_sensor == number)
            for number, sensor in enumerate(self._problem.measuring)
        }
        # An accelerometer depends on the inputs that hold from this event on.
        inputs = {sensor: timeline.event_input if sensor == "accelerometer" else last for sensor in measured}
        at_measurements = {
            sensor: motion_at(1 + event[rows], inputs[sensor][event[rows]])
            for sensor, rows in measured.items()
            if any(fault.sensor == sensor for fault in self._faults)
        }
        on_motion, on_measurements = (
            np.zeros((*a.shape, len(self._faults))) for a in (about.moving, timeline.measurement)
        )
        acting = [f for f, fault in enumerate(self._faults) if not fault.sensor]
        if acting:
            pushes = [np.add.reduceat(self._faults[f].effect(model, in_substeps) * duration, first) for f in acting]
            moved = np.ix_(np.flatnonzero(has_substeps), rows - n, np.array(acting))
            on_motion[moved] = halfway @ np.stack(pushes, axis=-1)
        for f, fault in enumerate(self._faults):
            if fault.sensor:
                on_measurements[measured[fault.sensor], :3, f] = fault.effect(model, at_measurements[fault.sensor])
            elif "accelerometer" in at_measurements:
                # A fault that accelerates the vehicle is measured too.
                acceleration = model.at_accelerometer(fault.effect(model, at_measurements["accelerometer"]))
                on_measurements[measured["accelerometer"], :3, f] = acceleration
        return FaultEffects(on_motion, on_measurements)

    def _mounted(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the position of the accelerometer, m, and the earth's field, T; zeros without such a sensor."""
        force, field = (self._problem.measuring.get(name) for name in ("accelerometer", "magnetic_field"))
        return _ORIGIN if force is None else force.position, _ORIGIN if field is None else field.earth_field

    def _identified(self, parameters: Array) -> dict[str, float]:
        """Return scaled parameters by symbol, SI."""
        layout, n = self._problem.layout, parameters.size
        return dict(zip(layout.symbols[:n], (parameters * layout.scale[:n]).tolist(), strict=True))

    def _along(self, symbol: str, parameters: Array, states: Array) -> Array:
        """Return a constant or walking error at each state; zero if it is not estimated."""
        row, n = self._problem.layout.row(symbol), parameters.size
        if row is None:
            return np.zeros(len(states))
        return states[:, row - n] if row >= n else np.full(len(states), parameters[row])


def fault_tests(
    outcome: FilterOutcome, header: EstimateHeader, scale: Array, whole: Mapping[Fault, float]
) -> tuple[tuple[FaultTest, ...], ConsideredErrors | None]:
    """Return the test of each fault with an effect on the data and of each alternative estimate, and all their effects.

    Parameters
    ----------
    outcome : FilterOutcome
        In scaled units.
    header : EstimateHeader
    scale : ndarray, shape (n,)
        SI value of one unit of each component of the state.
    whole : mapping
        SI value of which the tolerance of a fault is a share.
    """
    deviation, tests, considered = np.sqrt(np.diagonal(outcome.covariance)), list[FaultTest](), None
    if outcome.faults is not None:
        tests, considered = _score_tests(outcome, outcome.faults, header, scale, whole)
    alternatives = (_test_of_alternative(other, header, deviation, scale) for other in outcome.others)
    # The difference from a segment that alone has all the information has no variance.
    return (*tests, *(test for test in alternatives if np.isfinite(test.standard_deviation))), considered


def sizes_within_tolerances(
    faults: FaultScores, header: EstimateHeader, whole: Mapping[Fault, float], n_components: int
) -> Array | None:
    """Return the most likely sizes of all faults together, SI; 0 for those without a tolerance.

    None if these faults explain hardly anything.

    Parameters
    ----------
    faults : FaultScores
    header : EstimateHeader
    whole : mapping
        As `fault_tests`.
    n_components : int
        Number of measured components.
    """
    experiment = header.experiment
    estimated = {DELAY_FAULTS[symbol] for symbol in header.state if symbol in DELAY_FAULTS}
    tolerance = np.array([tolerance_of(model, experiment, whole) for model in faults.labels])
    if not tolerance.any():
        return None
    # With other faults, an estimated delay moves too.
    spread = experiment.identification.estimate.delay.spread
    is_estimated = np.array([model in estimated for model in faults.labels])
    sizes = most_likely_sizes(faults, np.where(is_estimated, spread, tolerance))
    decrease = float(sizes @ (2.0 * faults.score - faults.information @ sizes))
    # A sum of n squares scatters by sqrt(2 n).
    return sizes if decrease > _MIN_DECREASE * np.sqrt(2.0 * n_components) else None


def _score_tests(
    outcome: FilterOutcome, faults: FaultScores, header: EstimateHeader, scale: Array, whole: Mapping[Fault, float]
) -> tuple[list[FaultTest], ConsideredErrors]:
    deviation = np.sqrt(np.diagonal(outcome.covariance))
    coefficients, spread = header.coefficient_rows, header.experiment.identification.estimate.delay.spread
    delays = [model for model in faults.labels if model.fault.kind in (FaultKind.INPUT_DELAY, FaultKind.SENSOR_DELAY)]
    faults = faults.conditional_on({model: spread for model in delays if model.state in header.state})
    # A fin that anticipates looks like delayed inputs, so it is tested conditional on their delay.
    without_delay = faults.conditional_on({model: spread for model in delays if not model.sensor})
    tolerance = np.array([tolerance_of(model, header.experiment, whole) for model in faults.labels])
    significance, needed = significances(faults, tolerance), needed_faults(faults, tolerance, LARGEST_FAULT)
    considered = _considered(outcome, faults, tolerance, coefficients, scale)
    of_data = outcome.corrected * scale[: outcome.corrected.size]
    tests = []
    for model in faults.labels:
        scores = without_delay if model.reacts_to else faults
        f = scores.labels.index(model)
        # A fault without effect on the data is not tested.
        if scores.information[f, f] <= 0.0:
            continue
        shift = np.abs(scores.effect[coefficients, f]) / deviation[coefficients]
        sigma, worst = float(scores.information[f, f] ** -0.5), int(shift.argmax())
        size = float(scores.score[f]) * sigma**2
        sigma *= float(scores.inflation[f]) if scores.inflation.size else 1.0
        symbol = header.state[coefficients[worst]]
        test = FaultTest(model.fault, model.unit, size, sigma, symbol, float(shift[worst]) * sigma)
        place = faults.labels.index(model)
        significant = abs(test.z) if model.reacts_to else float(significance[place])
        test = test._replace(tolerance=float(tolerance[place]), significance=significant)
        for rank, fault in enumerate(needed, 1):
            if fault.place == place:
                moves = np.abs(considered.effect[coefficients, place] * fault.likely_size)
                # Compared with the total without this fault, which otherwise includes its size.
                total = considered.given(place).total_deviation(of_data)
                moved = (header.state[row] for row, by in zip(coefficients, moves, strict=True) if by > total[row])
                others = (faults.labels[g].fault for g in fault.alternatives)
                test = test._replace(rank=rank, moved=tuple(moved), alternatives=tuple(others))
        tests.append(test)
    return tests, considered


def _considered(
    outcome: FilterOutcome, faults: FaultScores, tolerance: Array, coefficients: list[int], scale: Array
) -> ConsideredErrors:
    """Return the effects of all faults, with second moments by the tolerances and the data.

    If the smallest size of a fault that the tests find moves a coefficient by more than its total standard deviation,
    this size is the tolerance of a fault that has none; not if all tolerances are none.
    """
    n, information = outcome.corrected.size, np.diagonal(faults.information)
    nominal = np.sqrt(np.diagonal(outcome.covariance)[:n])
    effect = faults.effect * scale[:n, None]
    labels, units = zip(*((model.fault, model.unit) for model in faults.labels), strict=True)
    moments = second_moments(faults, tolerance)
    considered = ConsideredErrors(labels, units, moments, effect, outcome.corrected / nominal)
    total = considered.total_deviation(outcome.corrected * scale[:n])
    smallest = LARGEST_FAULT * faults.inflation / np.sqrt(np.where(information > 0.0, information, np.inf))
    matters = (np.abs(effect[coefficients]) * smallest > total[coefficients, None]).any(axis=0)
    hidden = (tolerance == 0.0) & matters & tolerance.any()
    return considered._replace(covariance=second_moments(faults, np.where(hidden, smallest, tolerance)))


def tolerance_of(model: FaultModel, experiment: RunSettings, whole: Mapping[Fault, float]) -> float:
    """Return the standard deviation of a known quantity before any data, SI; 0 if it is not expected to be wrong."""
    vehicle, settings = experiment.vehicle, experiment.identification.tolerances
    symbol, is_held = model.parameter, model.fault.kind is FaultKind.HELD_COEFFICIENT
    if is_held:
        symbol = model.fault.component
    known = vehicle.parameters.deviations() | vehicle.stated_deviations()
    if (stated := known.get(symbol)) is not None:
        return stated
    if not model.tolerance or (model.tolerance == "ahrs" and not experiment.has_ahrs):
        return 0.0
    size: float = getattr(settings, model.tolerance)
    if is_held:
        return size * abs(vehicle.stated_coefficients()[symbol])
    if model.parameter and model.tolerance not in _LENGTHS:
        return size * abs(vehicle.known_parameters()[symbol])
    return size * whole.get(model.fault, 1.0)


def _test_of_alternative(
    other: AlternativeEstimate, header: EstimateHeader, deviation: Array, scale: Array
) -> FaultTest:
    """Test the coefficient that differs most."""
    worst = max(header.coefficient_rows, key=lambda row: abs(other.difference[row]) / other.deviation[row])
    size, sigma = (float(values[worst] * scale[worst]) for values in (other.difference, other.deviation))
    moved = float(other.moved[worst] / deviation[worst])
    if other.begin is None:
        fault = Fault(FaultKind.ANOTHER_MINIMUM, f"{other.cost_increase:.3g}")
    else:
        fault = Fault(FaultKind.SEGMENT, f"{other.begin:g}")
    return FaultTest(fault, header.unit[worst], size, sigma, header.state[worst], moved, significance=abs(size) / sigma)
