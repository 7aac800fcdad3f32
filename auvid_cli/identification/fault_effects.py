"""What the faults of a vehicle do to the data of an augmented problem, chunk by chunk along a trajectory."""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.extra_states import CURRENT, EXCESS_BUOYANCY, FIN_TRIMS, THRUST_SCALE, TRIM_MOMENT
from auvid_cli.filters.fault_scores import FaultEffects
from auvid_cli.filters.problem import Timeline
from auvid_cli.filters.smoother_forward import Linearised
from auvid_cli.identification.faults import DELAY_FAULTS, FAULTS, FaultedVehicle, FaultModel, Motion
from auvid_cli.identification.problem_setup import AugmentedProblem
from auvid_cli.vehicle.equations import factors
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

Array = NDArray[np.float64]

_CURRENTS = tuple(quantity.symbol for quantity in CURRENT)
_BALLAST = EXCESS_BUOYANCY.symbol, TRIM_MOMENT.symbol
_NOWHERE = (0.0, 0.0, 0.0)
_THRUST_INPUT = INPUT_SYMBOLS.index("surge_force")
# Share of the changes of an input that are not its largest: those, as by a plan, answer nothing.
_SMALL = 0.98
_FINS = tuple(INPUT_SYMBOLS.index(name) for name in ("rudder", "elevator"))


class VehicleFaults:
    """The faults that may be in the data of an augmented problem.

    Parameters
    ----------
    problem : AugmentedProblem
    sought : collection of str
        Symbols of delays that are estimated beside the filter: they come last.
    tested : sequence of FaultModel
        Those to test for, as far as no state stands for them.
    """

    def __init__(
        self, problem: AugmentedProblem, sought: Collection[str] = (), tested: Sequence[FaultModel] = FAULTS
    ) -> None:
        self._problem = problem
        present, modelled = ("", *problem.measuring), (*problem.layout.symbols, *sought)
        self._motion_rows = problem.layout.moving_rows_of("motion")
        constant = problem.layout.symbols[: problem.layout.n_parameters]
        modelled_terms = {c.regressor for c in problem.coefficients if c.symbol in modelled}
        others = (
            fault
            for fault in tested
            if fault.sensor in present
            and (fault.state in constant if fault.is_drift else fault.state not in modelled)
            and (not fault.reacts_to or fault.reacts_to in modelled)
            and fault.regressor not in modelled_terms
        )
        self._faults = *others, *(DELAY_FAULTS[symbol] for symbol in sought)

        rates = np.concatenate([segment.timelines.input_rate for segment in problem.segments])
        self._largest_small_rate = np.quantile(np.abs(rates), _SMALL, axis=0)

    @property
    def labels(self) -> tuple[FaultModel, ...]:
        """Return the faults of the present sensors that no state represents."""
        return self._faults

    def effects(self, segment: int, timeline: Timeline, about: Linearised) -> FaultEffects:
        """Say what they do to a chunk of a segment, along a trajectory."""
        vehicle, found = self._problem.coefficients, self._problem.held | self._identified(about.parameters)
        coefficients = factors(found, of_vehicle=vehicle)
        model = FaultedVehicle(self._problem.known, coefficients, vehicle.terms, *self._mounted())
        rate = self._problem.segments[segment].timelines.input_rate
        small = np.where(np.abs(rate) <= self._largest_small_rate, rate, 0.0)
        states, times = np.vstack([about.before, about.moving]), np.append(timeline.time[:1], timeline.time)
        motion = states[:, self._motion_rows]
        current, ballast = (
            np.column_stack([self._along(symbol, about.parameters, states) for symbol in symbols])
            for symbols in (_CURRENTS, _BALLAST)
        )
        # What the thrust is more than stated acts like more of it, and a trim like a fin that is over.
        shape = len(states), timeline.inputs.shape[1]
        gain, trim = np.ones(shape), np.zeros(shape)
        gain[:, _THRUST_INPUT] += self._along(THRUST_SCALE.symbol, about.parameters, states)
        for fin, state in zip(_FINS, FIN_TRIMS, strict=True):
            trim[:, fin] = self._along(state.symbol, about.parameters, states)

        def under(place: NDArray[np.int64], given: NDArray[np.int64]) -> Motion:
            inputs = gain[place] * timeline.inputs[given] + trim[place]
            rates = model.rates(motion[place], inputs, ballast[place])
            turned = gain[place] * rate[given], gain[place] * small[given]
            return Motion(motion[place], inputs, *turned, rates, current[place], ballast[place], times[place])

        # Over a substep the motion is taken for that at the event before: faults are small, and substeps short.
        n_substeps, held = np.diff(timeline.substep_offset), timeline.substep_input
        on_the_way = under(np.repeat(np.arange(timeline.time.size), n_substeps), held)
        led, duration = n_substeps > 0, timeline.substep_duration[:, None]
        first = timeline.substep_offset[:-1][led]
        event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
        last = timeline.event_input.copy()
        last[led] = held[timeline.substep_offset[1:][led] - 1]
        measured = {
            sensor: np.flatnonzero(timeline.measurement_sensor == number)
            for number, sensor in enumerate(self._problem.measuring)
        }
        # An accelerometer depends on the inputs that hold from then on.
        inputs = {sensor: timeline.event_input if sensor == "accelerometer" else last for sensor in measured}
        at_measurements = {
            sensor: under(1 + event[rows], inputs[sensor][event[rows]])
            for sensor, rows in measured.items()
            if any(fault.sensor == sensor for fault in self._faults)
        }
        pushed, added = (np.zeros((*a.shape, len(self._faults))) for a in (about.moving, timeline.measurement))
        for f, fault in enumerate(self._faults):
            if fault.sensor:
                added[measured[fault.sensor], :3, f] = fault.effect(model, at_measurements[fault.sensor])
                continue
            pushed[led, self._motion_rows, f] = np.add.reduceat(fault.effect(model, on_the_way) * duration, first)
            if "accelerometer" in at_measurements:
                # What changes the motion is measured besides.
                pull = fault.effect(model, at_measurements["accelerometer"])
                added[measured["accelerometer"], :3, f] = model.at_accelerometer(pull)
        return FaultEffects(pushed, added)

    def _mounted(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return where the accelerometer sits, and the field of the earth; none where nothing measures it."""
        force, field = (self._problem.measuring.get(name) for name in ("accelerometer", "magnetic_field"))
        return _NOWHERE if force is None else force.position, _NOWHERE if field is None else field.earth_field

    def _identified(self, parameters: Array) -> dict[str, float]:
        """Return parameters by symbol, SI, as filters see them."""
        layout, n = self._problem.layout, parameters.size
        return dict(zip(layout.symbols[:n], (parameters * layout.scale[:n]).tolist(), strict=True))

    def _along(self, symbol: str, parameters: Array, states: Array) -> Array:
        """Return an error at each of some moving states, constant or walking; 0 where it is not estimated."""
        row, n = self._problem.layout.row(symbol), parameters.size
        if row is None:
            return np.zeros(len(states))
        return states[:, row - n] if row >= n else np.full(len(states), parameters[row])
