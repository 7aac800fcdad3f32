"""The augmented state as named blocks: what each stands for, where it stands, and what is known of it before any data.

A block is all parameters, which are constant, or all moving states. Parameters stand first, so that a prediction
touches only the rows behind them; within either kind blocks keep their order. Whatever depends on this order asks here.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.extra_states import ErrorBlock
from auvid_cli.config.identification import Identification
from auvid_cli.config.moving_states import FURTHER_STATES
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.identification.prior import coefficient_priors
from auvid_cli.vehicle.parameters import MOTION, Quantity

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StateBlock:
    """Components of the augmented state that belong together.

    Attributes
    ----------
    name : str
    quantities : tuple of Quantity
        Symbol, SI unit and meaning of each component.
    prior_std : tuple of float
        Standard deviation of each before any data, or about what was measured first, SI.
    noise_density : tuple of float
        Square root of the power spectral density that drives each, SI; empty for parameters.
    scaled : bool
        Whether filters see each as a multiple of its `prior_std`, as coefficients that span 1e-3 to 1e3 must be.
    starts_as_measured : bool
        Whether its prior mean is what sensors measured first, and not zero.
    error : ErrorBlock or None
        How it acts, where it is an error of a sensor or an actuator.
    """

    name: str
    quantities: tuple[Quantity, ...]
    prior_std: tuple[float, ...]
    noise_density: tuple[float, ...] = ()
    scaled: bool = False
    starts_as_measured: bool = False
    error: ErrorBlock | None = None

    @property
    def is_moving(self) -> bool:
        """Say whether its components are moving states, and not parameters."""
        return bool(self.noise_density)


class StateLayout:
    """An augmented state.

    Parameters
    ----------
    blocks : iterable of StateBlock
        In any order; parameters are put before moving states.

    Attributes
    ----------
    blocks : tuple of StateBlock
        As they stand in the state.
    """

    def __init__(self, blocks: Iterable[StateBlock]) -> None:
        self.blocks = tuple(sorted(blocks, key=lambda block: block.is_moving))
        sizes = [len(block.quantities) for block in self.blocks]
        self._ends = np.cumsum([0, *sizes]).tolist()
        self._rows = {symbol: row for row, symbol in enumerate(self.symbols)}

    @cached_property
    def symbols(self) -> tuple[str, ...]:
        """Return the symbol of each component."""
        return tuple(quantity.symbol for block in self.blocks for quantity in block.quantities)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Return the SI unit of each component."""
        return tuple(quantity.unit for block in self.blocks for quantity in block.quantities)

    @cached_property
    def scale(self) -> Array:
        """Return the SI value of one unit of each component, as filters see it."""
        return np.concatenate(
            [block.prior_std if block.scaled else np.ones(len(block.prior_std)) for block in self.blocks]
        )

    @cached_property
    def prior_std(self) -> Array:
        """Return the standard deviation of each component before any data, in units of `scale`."""
        return np.concatenate([block.prior_std for block in self.blocks]) / self.scale

    @cached_property
    def noise_density(self) -> Array:
        """Return the square root of the power spectral density that drives each moving state."""
        return np.concatenate([block.noise_density for block in self.blocks if block.is_moving])

    @property
    def n_parameters(self) -> int:
        """Return the number of parameters, which stand before the moving states."""
        return len(self.symbols) - self.noise_density.size

    def row(self, symbol: str) -> int | None:
        """Return where a component stands; None if it is no state."""
        return self._rows.get(symbol)

    def rows(self, symbols: Sequence[str]) -> list[int]:
        """Return where components stand that are all states."""
        return [self._rows[symbol] for symbol in symbols]

    def rows_of(self, name: str) -> slice:
        """Return where a block stands; empty if there is none of that name."""
        for block, begin, end in zip(self.blocks, self._ends, self._ends[1:], strict=False):
            if block.name == name:
                return slice(begin, end)
        return slice(0, 0)

    def moving_rows_of(self, name: str) -> slice:
        """Return where a block stands among the moving states alone; empty if there is none of that name."""
        rows, n_parameters = self.rows_of(name), self.n_parameters
        return slice(rows.start - n_parameters, rows.stop - n_parameters) if rows.stop else rows


def state_layout(settings: Identification, vehicle: VehicleSettings, measuring: Collection[str]) -> StateLayout:
    """Lay out the augmented state that settings ask for.

    Parameters
    ----------
    settings : Identification
    vehicle : VehicleSettings
        Natural magnitudes of its coefficients follow from its size.
    measuring : collection of str
        Sensors; what only one of them measures, as the depth, is a state where it does.
    """
    noise, initial = settings.process_noise, settings.initial_motion
    priors, estimated = coefficient_priors(vehicle, settings.prior), settings.estimated(vehicle)
    coefficients = tuple(
        Quantity(c.symbol, c.unit, c.meaning, c.equation) for c in vehicle.coefficient_set if c.symbol in estimated
    )
    blocks = [
        StateBlock(
            "coefficients",
            coefficients,
            tuple(priors[q.symbol].standard_deviation for q in coefficients),
            scaled=True,
        ),
        StateBlock(
            "motion",
            MOTION,
            tuple(np.repeat([initial.velocity, initial.rate, initial.attitude], 3).tolist()),
            noise.of_motion(),
            starts_as_measured=True,
        ),
    ]
    for name, quantity, sensor in FURTHER_STATES:
        if sensor in measuring:
            start, density = getattr(initial, name), getattr(noise, name)
            blocks.append(StateBlock(name, (quantity,), (start,), (density,), starts_as_measured=True))
    for error in settings.estimate.blocks():
        if error.shifts:
            continue
        n = len(error.quantities)
        walk = (error.walk,) * n if error.walk > 0.0 else ()
        blocks.append(StateBlock(error.name, error.quantities, (error.prior_std,) * n, walk, error=error))
    return StateLayout(blocks)
