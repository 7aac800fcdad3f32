"""Random force and moment on a simulated vehicle that no model explains: waves, turbulence, missing physics."""

from typing import Annotated

from pydantic import Field

from auvid_cli.config.per_axis import Positive, three
from auvid_cli.config.quantity import AmountPerAxis
from auvid_cli.config.settings import Settings

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
