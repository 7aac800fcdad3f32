"""Features that an export format does not support, and the heading of exported files."""

import re
from collections.abc import Collection, Iterable
from typing import NamedTuple

from auvid_cli.evaluation.accuracy import LARGEST_SHARE_OF_VALUE
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.export.model import IdentifiedCoefficient, IdentifiedModel, TermSize
from auvid_cli.text import one_line
from auvid_cli.vehicle.parameters import PARAMETERS
from auvid_cli.vehicle.rigid_body import NO_BALLAST, Ballast

_COVARIANCES = "The covariances are lost; standard deviations are next to the values."


def line_comments(mark: str, lines: Iterable[str]) -> str:
    """Return lines as comments after a mark, such as ``#`` or ``%``."""
    return "".join(f"{mark} {_line(line)}\n" for line in lines)


def xml_comment(lines: Iterable[str]) -> str:
    """Return lines as the content of an XML comment, without two hyphens in a row."""
    return re.sub("-(?=-)", "- ", "\n".join(_line(line) for line in lines))


def _line(text: str) -> str:
    indent = "  " if text.startswith("  ") else ""
    return indent + one_line(text)


class UnsupportedFeatures(NamedTuple):
    """Parts of a model that a format cannot hold: terms of the equations of motion, and notes on all others."""

    terms: tuple[TermSize, ...]
    notes: tuple[str, ...]


def unsupported_features(
    model: IdentifiedModel,
    symbols: Collection[str] = (),
    notes: tuple[str, ...] = (),
    *,
    holds_gain: bool = False,
    holds_actuators: bool = False,
) -> UnsupportedFeatures:
    """Return the losses of a format that has the equations of motion.

    Parameters
    ----------
    symbols : collection of str
        Coefficients that the format cannot hold.
    notes : tuple of str
        Further unsupported.
    holds_gain : bool
        Whether the format has the gain of the propeller.
    holds_actuators : bool
        Whether the format has the dynamics of fins and propeller.
    """
    terms = tuple(size for size in model.term_sizes if size.symbol in symbols)
    gain = [] if holds_gain else _gain_lines(model)
    actuators = [] if holds_actuators else _actuator_lines(model)
    return UnsupportedFeatures(
        terms, (*notes, _COVARIANCES, *gain, *actuators, *_ballast_lines(model), *_state_lines(model))
    )


def unsupported_lines(unsupported: UnsupportedFeatures) -> list[str]:
    """Return losses in words, a line each."""
    if not any(unsupported):
        return ["Nothing is lost."]
    opening = "No term of the equations of motion is lost."
    if unsupported.terms:
        opening = "Terms that are lost, RMS along the estimated motion and share of all terms of their row:"
    terms = [f"  {t.symbol} in {t.row}: {t.rms:.3g} {t.unit}, {t.percent:.3g} %" for t in unsupported.terms]
    return [opening, *terms, *unsupported.notes]


def _gain_lines(model: IdentifiedModel) -> list[str]:
    actuation = model.actuation
    if actuation.thrust == 1.0:
        return []
    return [
        f"The propeller's gain is lost: multiply the stated surge force by {actuation.thrust:.5g}; this "
        f"changes it by {actuation.thrust_rms:.3g} N RMS along the estimated motion."
    ]


def _actuator_lines(model: IdentifiedModel) -> list[str]:
    actuators, units = model.actuation.actuators, {size.symbol: size.unit for size in model.term_sizes}
    described = [f"{name} of {words}" for name, words in actuators.descriptions().items() if words]
    if not described:
        return []
    changes = ", ".join(
        f"{symbol} by {rms:.3g} {units.get(symbol, 'N')}" for symbol, rms in model.actuation.changes.items()
    )
    return [
        f"The actuators are lost: put {' and '.join(described)} between the commands and the inputs here; this "
        f"changes {changes} RMS along the estimated motion."
    ]


def _ballast_lines(model: IdentifiedModel) -> list[str]:
    values = {state.symbol: state.value for state in model.states}
    ballast = Ballast(*(values.get(symbol, 0.0) for symbol in Ballast._fields))
    if ballast == NO_BALLAST:
        return []
    loaded = ballast.added_to(model.experiment.vehicle.known_parameters())
    places = ", ".join(f"{symbol} = {loaded[symbol]:.5g} m" for symbol in ("xB", "yB", "zB"))
    return [f"The ballast is lost: with it the buoyancy is B = {loaded['B']:.6g} N at {places}."]


def _state_lines(model: IdentifiedModel) -> list[str]:
    lines = ["Estimated next to the coefficients, and lost:"] if model.states else []
    for state in model.states:
        unit = "" if state.unit == "1" else f" {state.unit}"
        deviation = f"standard deviation {state.standard_deviation:.2g}{unit}"
        lines.append(f"  {state.symbol}: {state.value:.4g}{unit}, {deviation}")
    return lines


def heading_lines(model: IdentifiedModel, unsupported: UnsupportedFeatures) -> list[str]:
    """Return vehicle, filter, origin, caveats and unsupported, a line each."""
    experiment, origin = model.experiment, model.origin
    return [
        f"{experiment.vehicle.name}: coefficients identified by {model.filter}",
        f"Exported by auvid {origin.auvid_version} at {origin.created}",
        f"from {origin.estimate},",
        f"made from {origin.dataset}",
        f"(experiment {experiment.name}, seed {experiment.seed}).",
        *caveats(model),
        _parameter_line(model),
        *unsupported_lines(unsupported),
    ]


def _parameter_line(model: IdentifiedModel) -> str:
    """Return the values of the known parameters without which the coefficients are wrong."""
    known = model.experiment.vehicle.known_parameters()
    values = ", ".join(f"{q.symbol} = {known[q.symbol]:.5g} {q.unit}" for q in PARAMETERS if known[q.symbol])
    return f"The coefficients were computed with these parameters; change none of them alone: {values}."


def caveats(model: IdentifiedModel) -> list[str]:
    """Return the reasons not to rely on the coefficients, a sentence each."""
    reasons = caveats_of(model.judgement)
    if not reasons and (weak := model.not_identified()):
        share = f"uncertain by more than {LARGEST_SHARE_OF_VALUE:.0%} of their value"
        reasons = [f"Not identified by these data, {share}: {', '.join(weak)}."]
    return [*reasons, *model.speed_remarks]


def caveats_of(judgement: Judgement) -> list[str]:
    """Return the reason why an estimate is not sound, if it is not."""
    if judgement.grade is Grade.SOUND:
        return []
    # A doubt may concern some coefficients, or none.
    is_about_all = judgement.grade is not Grade.DOUBTFUL or judgement.doubted is None
    return [f"Do not rely on these values, {judgement}." if is_about_all else f"The estimate is {judgement}."]


def certainty(coefficient: IdentifiedCoefficient) -> str:
    """Return the uncertainty of a coefficient as a remark."""
    if coefficient.standard_deviation is None:
        return "held, not estimated"
    remark = f"standard deviation {coefficient.standard_deviation!r}"
    return remark if coefficient.identified else f"{remark}; identified: false"
