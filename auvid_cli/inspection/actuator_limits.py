"""Commands against what the vehicle file says that fins and propeller do of them."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Check
from auvid_cli.data.dataset import InputRecord
from auvid_cli.inspection.inspection import judged
from auvid_cli.vehicle.actuators import IDEAL, Actuator, Actuators
from auvid_cli.vehicle.parameters import INPUTS, Quantity

Array = NDArray[np.float64]

# Of the time, above which what is lost of the commands is worth a note.
_WORTH_A_NOTE = 0.01


def actuator_checks(inputs: InputRecord, actuators: Actuators) -> list[Check]:
    """Say for how long commands are within a dead band, saturate, outrun a rate limit or stall a fin."""
    return [
        _limits(INPUTS[column], inputs.time, inputs.values[:, column], actuator)
        for column, actuator in enumerate(actuators)
        if actuator != IDEAL
    ]


def _limits(quantity: Quantity, time: Array, commands: Array, actuator: Actuator) -> Check:
    lengths = np.diff(time, append=time[-1] + (time[-1] - time[-2] if time.size > 1 else 1.0))
    size = np.abs(commands)
    steps = np.abs(np.diff(commands, append=commands[-1]))
    times = {
        "beyond the saturation": size > actuator.saturation,
        "faster than the rate limit": steps > actuator.rate_limit * lengths,
        "beyond the stall": np.minimum(size, actuator.saturation) - actuator.dead_band > actuator.stall,
        "within the dead band": (size > 0.0) & (size <= actuator.dead_band),
    }
    shares = {what: float(lengths[when].sum() / lengths.sum()) for what, when in times.items() if when.any()}
    much = any(share > _WORTH_A_NOTE for share in shares.values())
    return judged(
        quantity.symbol,
        "actuator limits",
        statistic=", ".join(f"{share:.1%} of the time {what}" for what, share in shares.items()) or "never reached",
        threshold=f"<= {_WORTH_A_NOTE:.0%} of the time each",
        passed=None if much else True,
        advice="What is commanded there does not act as it is commanded (`vehicle.actuators`): such times tell "
        "coefficients only as far as those limits are right.",
    )
