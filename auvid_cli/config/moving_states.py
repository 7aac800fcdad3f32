"""Settings of moving states and of disturbances that drive them."""

from collections.abc import Collection
from typing import Annotated, NamedTuple

from pydantic import Field

from auvid_cli.config.settings import Positive, Settings, three
from auvid_cli.config.units import Amount, AmountPerAxis
from auvid_cli.vehicle.parameters import DEPTH, Quantity

NotNegative = tuple[Annotated[float, Field(ge=0)], ...]


class DisturbingForce(Settings):
    """Gauss-Markov force, forward, starboard and down: one number for all three axes or a list of one each."""

    standard_deviation: Annotated[NotNegative, AmountPerAxis("N"), Field(description="0: none")] = (0.0,)
    time_constant: Annotated[Positive, AmountPerAxis("s"), Field(description="after which 1/e of it is left")] = (5.0,)


class DisturbingMoment(Settings):
    """Gauss-Markov moment about the same axes."""

    standard_deviation: Annotated[NotNegative, AmountPerAxis("N*m"), Field(description="0: none")] = (0.0,)
    time_constant: Annotated[Positive, AmountPerAxis("s"), Field(description="after which 1/e of it is left")] = (5.0,)


class Disturbance(Settings):
    """Force and moment in addition to those of the model, drawn per seed and constant between inputs."""

    force: DisturbingForce = DisturbingForce()
    moment: DisturbingMoment = DisturbingMoment()

    def per_axis(self) -> tuple[tuple[float, float], ...]:
        """Return standard deviation and time constant of X, Y, Z, K, M and N, SI."""
        groups = (
            (self.force.standard_deviation, self.force.time_constant),
            (
                self.moment.standard_deviation,
                self.moment.time_constant,
            ),
        )
        return tuple(pair for size, time in groups for pair in zip(three(size), three(time), strict=True))


class ProcessNoise(Settings):
    """White-noise densities that drive the motion, what the model leaves out: one for three states or one each."""

    velocity: Annotated[Positive, AmountPerAxis("m/s^2/Hz^0.5"), Field(description="of u, v, w")] = (1e-4,)
    rate: Annotated[Positive, AmountPerAxis("rad/s^2/Hz^0.5"), Field(description="of p, q, r")] = (1e-4,)
    attitude: Annotated[Positive, AmountPerAxis("rad/s/Hz^0.5"), Field(description="of phi, theta, psi")] = (1e-5,)
    depth: Annotated[float, Amount("m/s/Hz^0.5"), Field(gt=0, description="of the depth, where it is measured")] = 1e-3

    def of_motion(self) -> tuple[float, ...]:
        """Return the densities of the nine motion states, SI."""
        return (*three(self.velocity), *three(self.rate), *three(self.attitude))

    def times(
        self, factor: float, names: Collection[str] = ("velocity", "rate", "attitude", "depth")
    ) -> "ProcessNoise":
        """Return the noise with some densities multiplied by `factor`."""

        def larger(density: float | tuple[float, ...]) -> float | tuple[float, ...]:
            return tuple(factor * each for each in density) if isinstance(density, tuple) else factor * density

        return self.model_copy(update={name: larger(getattr(self, name)) for name in names})


class InitialMotion(Settings):
    """Standard deviations about the first sample of each sensor, from which a filter starts."""

    velocity: Annotated[float, Amount("m/s"), Field(gt=0)] = 0.1
    rate: Annotated[float, Amount("rad/s"), Field(gt=0)] = 0.05
    attitude: Annotated[float, Amount("rad"), Field(gt=0)] = 0.05
    depth: Annotated[float, Amount("m"), Field(gt=0)] = 0.5


class FurtherState(NamedTuple):
    """Moving state in addition to the motion, used if its sensor is.

    Attributes
    ----------
    name : str
        Key of the density that drives it in `ProcessNoise`, and of where it starts in `InitialMotion`.
    quantity : Quantity
    sensor : str
        Measures it, and nothing else.
    """

    name: str
    quantity: Quantity
    sensor: str


# Compiled code of `auvid_cli.identification.process` moves each of them.
FURTHER_STATES = (FurtherState("depth", DEPTH, "depth"),)
