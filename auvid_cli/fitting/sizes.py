"""Sizes of the additions to a model, from its estimate."""

from math import degrees

from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.settings import three
from auvid_cli.data.estimate import Estimate
from auvid_cli.fitting.additions import Addition

# Distance of an estimated error from 0 beyond which the model needs it, in standard deviations.
_CERTAIN = 8.0


def values(estimate: Estimate, addition: Addition) -> dict[str, tuple[float, float]]:
    """Return value and standard deviation, SI, of each estimated state of an addition, by symbol."""
    symbols: list[str] = [addition.name]
    if addition.family in {*BiasName} and not addition.is_time:
        blocks = estimate.experiment.identification.estimate.blocks_of(BiasName(addition.family))
        symbols = [quantity.symbol for block in blocks for quantity in block.quantities]
    rows = [estimate.state.index(symbol) for symbol in symbols if symbol in estimate.state]
    return {estimate.state[i]: (float(estimate.mean[-1, i]), float(estimate.standard_deviation[-1, i])) for i in rows}


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
    factor = degrees(1.0) if unit.startswith("rad") else 1.0
    shown = unit.replace("rad", "deg") if factor != 1.0 else unit
    return f"{symbol} {factor * value:.4g} +- {factor * deviation:.2g} {shown}".removesuffix(" 1")
