"""Additions to a model: what explains data that the model does not, settings with and without it, and its size."""

from math import sqrt
from typing import NamedTuple

from auvid_cli.config.coefficients import Term
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import AugmentedStates, BiasName
from auvid_cli.config.identification import INPUTS_DELAY
from auvid_cli.config.settings import three
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import TESTED_TERMS, FaultKind, FaultTest
from auvid_cli.identification.noise import disturbance_like_noise
from auvid_cli.identification.problem_setup import Motion
from auvid_cli.identification.states import coefficient_priors
from auvid_cli.identification.terms import with_terms
from auvid_cli.text import degrees_for
from auvid_cli.vehicle.coefficients import term

# Distance of an estimated error from 0 beyond which the model needs it, in standard deviations.
_CERTAIN = 8.0
# Distance of an estimated error from 0 beyond which it is not plausible, in standard deviations of its prior.
_FARTHEST = 3.0
# Errors of sensors, actuators and vehicle that a fault of this kind asks for.
_ERRORS = {
    FaultKind.GYROSCOPE_BIAS: BiasName.GYRO,
    FaultKind.ACCELEROMETER_BIAS: BiasName.ACCELEROMETER,
    FaultKind.MAGNETIC_FIELD_BIAS: BiasName.MAGNETIC_FIELD,
    FaultKind.ATTITUDE_BIAS: BiasName.ATTITUDE,
    FaultKind.DVL_SCALE: BiasName.DVL,
    FaultKind.DVL_YAW: BiasName.DVL,
    FaultKind.DVL_LEVER_ARM: BiasName.DVL_ARM,
    FaultKind.CURRENT: BiasName.CURRENT,
    FaultKind.FIN_TRIM: BiasName.FIN_TRIM,
    FaultKind.THRUST_SCALE: BiasName.THRUST,
    FaultKind.THRUST_OFFSET: BiasName.THRUST,
    FaultKind.BUOYANCY: BiasName.BALLAST,
    FaultKind.CENTRE_OF_GRAVITY: BiasName.BALLAST,
}
# Error and setting of the random walk that a drift asks for.
_WALKS = {
    FaultKind.CURRENT_DRIFT: (BiasName.CURRENT, "walk"),
    FaultKind.FIN_TRIM_DRIFT: (BiasName.FIN_TRIM, "walk"),
    FaultKind.THRUST_SCALE_DRIFT: (BiasName.THRUST, "walk"),
    FaultKind.EXCESS_BUOYANCY_DRIFT: (BiasName.BALLAST, "buoyancy_walk"),
    FaultKind.TRIM_MOMENT_DRIFT: (BiasName.BALLAST, "moment_walk"),
}
_DELAYS = FaultKind.SENSOR_DELAY, FaultKind.INPUT_DELAY
FAMILIES = *(name.value for name in BiasName), "walk", "noise", "lag", "term", "prior"


class Addition(NamedTuple):
    """An addition to a model; two of the same family and name are the same."""

    family: str  # one of `FAMILIES`: what the user may include or exclude
    name: str = ""  # sensor, input, setting or term; empty if the family has one
    # Value, SI: of a delay, a random walk, or the time constant of the fins; factor on the width of the prior
    size: float = 0.0
    deviation: float = 0.0  # standard deviation of a delay or of the time constant, s

    def __str__(self) -> str:
        texts = {
            "delay": "delay of the {}",
            "walk": "random walk of {}",
            "noise": "noise of the {}",
            "lag": "lag of the fins",
            "term": "term {}",
            "prior": "width of the prior",
            "dvl": "scale and yaw of the DVL",
            "dvl_arm": "lever arm of the DVL, {}",
            "gyro": "bias of the gyroscope",
            "fin_trim": "trim of the fins",
            "thrust": "scale of the thrust",
        }
        name = self.name if self.family in ("term", "walk") else self.name.replace("_", " ")
        return texts.get(self.family, self.family.replace("_", " ")).format(name)

    @property
    def key(self) -> tuple[str, str]:
        """Return family and name."""
        return self.family, self.name

    @property
    def instead(self) -> "Addition | None":
        """Return the addition that hardly differs from it and replaces it: late inputs and fins that lag."""
        if self.key == (BiasName.DELAY, INPUTS_DELAY):
            return self._replace(family="lag", name="")
        return self._replace(family=BiasName.DELAY.value, name=INPUTS_DELAY) if self.family == "lag" else None

    @property
    def is_time(self) -> bool:
        """Whether it is a delay or a time constant: no state of a filter, so the settings state it."""
        return self.family in (BiasName.DELAY, "lag")


def addition_for(test: FaultTest, duration: float) -> Addition | None:
    """Return the addition that a fault in data of a duration, s, asks for; None if no setting represents it."""
    fault, size = test.fault, test.size
    if fault.kind is FaultKind.DVL_LEVER_ARM:
        return Addition(BiasName.DVL_ARM.value, fault.component)
    if fault.kind in _ERRORS:
        return Addition(_ERRORS[fault.kind].value)
    if fault.kind in _WALKS:
        error, key = _WALKS[fault.kind]
        return Addition("walk", f"{error.value}.{key}", abs(size) * sqrt(duration))
    if fault.kind in _DELAYS:
        return Addition(
            BiasName.DELAY.value,
            fault.component.lower().replace(" ", "_") or INPUTS_DELAY,
            size,
            test.standard_deviation,
        )
    if fault.kind is FaultKind.MISSING_TERM:
        return Addition("term", fault.component)
    return None


def with_addition(settings: RunSettings, addition: Addition) -> RunSettings:
    """Return settings with an addition."""
    identification = settings.identification
    estimate, family, name = identification.estimate, addition.family, addition.name
    match family:
        case BiasName.DELAY:
            return settings.with_identification(delays={**identification.delays, name: addition.size})
        case "term":
            found = next(each for each in (term(*of) for of in TESTED_TERMS) if each.symbol == name)
            return with_terms(settings, (*settings.vehicle.terms, Term.of(found)))
        case "lag":
            return _with_lag(settings, addition.size)
        case "noise":
            return settings
        case "prior":
            return _with_wider_prior(settings, addition.size)
        case "walk":
            error, _, key = name.partition(".")
            changed = getattr(estimate, error).model_copy(update={key: addition.size})
            return settings.with_estimate(**{error: changed})
        case BiasName.DISTURBANCE:
            changes = {} if estimate.disturbance.blocks() else {"disturbance": disturbance_like_noise(settings)}
        case BiasName.DVL_ARM:
            arm = getattr(estimate, family)
            others = arm.axes if BiasName.DVL_ARM in estimate.biases else ()
            axes = tuple(axis for axis in "xyz" if axis in (*others, name))
            changes = {family: arm.model_copy(update={"axes": axes})}
        case _:
            changes = {}
    biases = tuple(dict.fromkeys((*estimate.biases, BiasName(family))))
    return settings.with_estimate(biases=biases, **changes)


def without_addition(settings: RunSettings, addition: Addition) -> RunSettings:
    """Return settings without an addition."""
    identification = settings.identification
    estimate, family, name = identification.estimate, addition.family, addition.name
    match family:
        case BiasName.DELAY:
            delays = {sensor: delay for sensor, delay in identification.delays.items() if sensor != name}
            return settings.with_identification(delays=delays)
        case "term":
            return with_terms(settings, [each for each in settings.vehicle.terms if each.name != name])
        case "lag":
            return _with_lag(settings, None)
        case "noise":
            factors = {s: factor for s, factor in identification.measurement_noise.items() if s != name}
            return settings.with_identification(measurement_noise=factors)
        case "prior":
            return _with_wider_prior(settings, 1.0 / addition.size)
        case "walk":
            error, _, key = name.partition(".")
            changed = getattr(estimate, error)
            default = type(changed).model_fields[key].default
            return settings.with_estimate(**{error: changed.model_copy(update={key: default})})
        case BiasName.DVL_ARM if len(getattr(estimate, family).axes) > 1:
            arm = getattr(estimate, family)
            axes = tuple(axis for axis in arm.axes if axis != name)
            return settings.with_estimate(dvl_arm=arm.model_copy(update={"axes": axes}))
        case _:
            return settings.with_estimate(biases=tuple(error for error in estimate.biases if error != family))


def _with_wider_prior(settings: RunSettings, factor: float) -> RunSettings:
    """Return settings with the prior standard deviation of each coefficient multiplied by a factor."""
    prior = settings.identification.prior
    priors = coefficient_priors(settings.vehicle, prior)
    wider = {symbol: factor * of.standard_deviation for symbol, of in priors.items()}
    return settings.with_identification(prior=prior.model_copy(update={"standard_deviation": wider}))


def _with_lag(settings: RunSettings, time_constant: float | None) -> RunSettings:
    vehicle = settings.vehicle
    fins = vehicle.actuators.fins.model_copy(update={"time_constant": time_constant})
    actuators = vehicle.actuators.model_copy(update={"fins": fins})
    return settings.model_copy(update={"vehicle": vehicle.model_copy(update={"actuators": actuators})})


def values(estimate: Estimate, addition: Addition) -> dict[str, tuple[float, float]]:
    """Return value and standard deviation, SI, of each estimated state of an addition, by symbol."""
    symbols: list[str] = [addition.name]
    if addition.family in {*BiasName} and not addition.is_time:
        blocks = estimate.experiment.identification.estimate.blocks_of(BiasName(addition.family))
        symbols = [quantity.symbol for block in blocks for quantity in block.quantities]
    rows = [estimate.state.index(symbol) for symbol in symbols if symbol in estimate.state]
    return {estimate.state[i]: (float(estimate.mean[-1, i]), float(estimate.standard_deviation[-1, i])) for i in rows}


def why_implausible(estimated: AugmentedStates, addition: Addition, motion: Motion, farthest: float = _FARTHEST) -> str:
    """Return a sentence if a state of an addition is too far beyond its prior; else an empty text.

    A wrong model can be explained by an absurd error, for example of 32 % of the DVL.
    """
    if addition.family not in {*BiasName} or addition.is_time or addition.family == BiasName.DISTURBANCE:
        return ""
    for block in estimated.blocks_of(BiasName(addition.family)):
        for quantity in block.quantities:
            value = float(motion.mean[-1, motion.state.index(quantity.symbol)])
            if abs(value) > farthest * block.prior_std:
                shown = _with_unit(quantity.symbol, value, block.prior_std, quantity.unit)
                return f"not plausible: {shown.replace('+-', 'with a spread of')}"
    return ""


def is_certain(estimate: Estimate, addition: Addition) -> bool:
    """Whether an estimated value of an addition is so far from 0 that the model needs it."""
    if addition.is_time:
        return abs(addition.size) > _CERTAIN * addition.deviation
    if addition.family == BiasName.DISTURBANCE:
        return False
    return any(abs(value) > _CERTAIN * deviation for value, deviation in values(estimate, addition).values())


def size_text(estimate: Estimate, addition: Addition) -> str:
    """Return the estimated values of an addition with standard deviations, angles in degrees; empty if unknown."""
    settings = estimate.experiment.identification
    if addition.family == "noise":
        return f"{settings.measurement_noise[addition.name]:.3g} times the stated noise"
    if addition.family == "prior":
        return f"standard deviations {addition.size:.3g} times as large"
    if addition.is_time:
        return f"{1e3 * addition.size:.3g} +- {1e3 * addition.deviation:.2g} ms"
    if addition.family == BiasName.DISTURBANCE:
        disturbance = settings.estimate.disturbance
        of_force, of_moment = (
            ", ".join(f"{size:.3g}" for size in three(of.standard_deviation))
            for of in (disturbance.force, disturbance.moment)
        )
        return f"force {of_force} N, moment {of_moment} N*m"
    units = dict(zip(estimate.state, estimate.unit, strict=True))
    return ", ".join(_with_unit(symbol, *size, units[symbol]) for symbol, size in values(estimate, addition).items())


def _with_unit(symbol: str, value: float, deviation: float, unit: str) -> str:
    factor, shown = degrees_for(unit)
    return f"{symbol} {factor * value:.4g} +- {factor * deviation:.2g} {shown}".removesuffix(" 1")
