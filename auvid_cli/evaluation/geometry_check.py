"""Whether coefficients are such as the shape of the vehicle lets expect."""

import numpy as np

from auvid_cli.data.check import Check
from auvid_cli.data.estimate import Estimate

_SIGMAS = 4.0


def near_its_geometry(estimate: Estimate) -> list[Check]:
    """Compare the estimated coefficients with what follows from hull and fins; nothing where these are not stated.

    What is worth a remark is beyond four standard deviations of both together: a drawing can be wrong as well.
    """
    derived = {each.name: each for each in estimate.experiment.vehicle.derived_values()}
    distances = {
        symbol: float(
            abs(estimate.mean[-1, i] - derived[symbol].mean)
            / np.hypot(derived[symbol].standard_deviation, estimate.standard_deviation[-1, i])
        )
        for i, symbol in enumerate(estimate.state)
        if symbol in derived
    }
    if not distances:
        return []
    return [
        Check.of_values(
            estimate.filter,
            "coefficients",
            "plausible size",
            distances,
            limit=_SIGMAS,
            unit="sd",
            meaning="from what hull and fins let expect",
            advice="Look at the geometry in the vehicle file, at units and signs, and at what is marked beside; if all "
            "is right, this vehicle is another than its drawing, and the estimate stands.",
            fails=False,
        )
    ]
