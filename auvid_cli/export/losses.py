"""What a target cannot hold of an identified model."""

from collections.abc import Collection
from typing import NamedTuple

from auvid_cli.export.model import EstimatedState, IdentifiedModel
from auvid_cli.export.terms import TermSize
from auvid_cli.vehicle.ballast import NO_BALLAST, Ballast

_COVARIANCES = "The covariances are lost; standard deviations stand beside the values."


class Losses(NamedTuple):
    """Parts of a model that a form cannot hold.

    Attributes
    ----------
    terms : tuple of TermSize
        Terms of the equations of motion, with how large they are.
    notes : tuple of str
        All else, a line each.
    """

    terms: tuple[TermSize, ...]
    notes: tuple[str, ...]


NOTHING = Losses((), ())


def losses_of(
    model: IdentifiedModel,
    symbols: Collection[str] = (),
    notes: tuple[str, ...] = (),
    *,
    holds_gain: bool = False,
    holds_actuators: bool = False,
) -> Losses:
    """Return what a form loses that holds the equations of motion alone.

    Parameters
    ----------
    model : IdentifiedModel
    symbols : collection of str
        Coefficients whose terms it loses as well.
    notes : tuple of str
        All else that it loses.
    holds_gain : bool
        Whether it has the propeller's gain.
    holds_actuators : bool
        Whether it has how fins and propeller follow their commands.
    """
    terms = tuple(size for size in model.term_sizes if size.symbol in symbols)
    gain = [] if holds_gain else _gain_lines(model)
    actuators = [] if holds_actuators else _actuator_lines(model)
    return Losses(terms, (*notes, _COVARIANCES, *gain, *actuators, *_ballast_lines(model), *_state_lines(model)))


def loss_lines(losses: Losses) -> list[str]:
    """Write losses in words, a line each."""
    if not losses.terms and not losses.notes:
        return ["Nothing is lost."]
    if not losses.terms:
        return ["No term of the equations of motion is lost.", *losses.notes]
    opening = "Terms that are lost, RMS along the estimated motion and share of all terms of their row:"
    terms = [f"  {t.symbol} in {t.row}: {t.rms:.3g} {t.unit}, {t.percent:.3g} %" for t in losses.terms]
    return [opening, *terms, *losses.notes]


def _gain_lines(model: IdentifiedModel) -> list[str]:
    actuation = model.actuation
    if actuation.thrust == 1.0:
        return []
    return [
        f"The propeller's gain is lost: multiply the stated surge force by {actuation.thrust:.5g}; along the "
        f"estimated motion that changed it by {actuation.thrust_rms:.3g} N RMS."
    ]


def _actuator_lines(model: IdentifiedModel) -> list[str]:
    actuators, units = model.actuation.actuators, {size.symbol: size.unit for size in model.term_sizes}
    described = [f"{what} of {words}" for what, words in actuators.described().items() if words]
    if not described:
        return []
    changes = ", ".join(
        f"{symbol} by {rms:.3g} {units.get(symbol, 'N')}" for symbol, rms in model.actuation.changes.items()
    )
    return [
        f"The actuators are lost: put {' and '.join(described)} between the commands and the inputs here; along the "
        f"estimated motion that changed {changes} RMS."
    ]


def _ballast_lines(model: IdentifiedModel) -> list[str]:
    found = {state.symbol: state.value for state in model.states}
    ballast = Ballast(*(found.get(symbol, 0.0) for symbol in Ballast._fields))
    if ballast == NO_BALLAST:
        return []
    loaded = ballast.added_to(model.experiment.vehicle.known_parameters())
    places = ", ".join(f"{symbol} = {loaded[symbol]:.5g} m" for symbol in ("xB", "yB", "zB"))
    return [f"The ballast is lost: with it the buoyancy is B = {loaded['B']:.6g} N at {places}."]


def _state_lines(model: IdentifiedModel) -> list[str]:
    if not model.states:
        return []
    return ["Estimated beside the coefficients, and lost:", *map(_state_line, model.states)]


def _state_line(state: EstimatedState) -> str:
    unit = "" if state.unit == "1" else f" {state.unit}"
    return f"  {state.symbol}: {state.value:.4g}{unit}, standard deviation {state.standard_deviation:.2g}{unit}"
