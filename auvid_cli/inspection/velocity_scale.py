"""Whether velocities and depth are to one scale, where the vehicle dives: to half a percent."""

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Check
from auvid_cli.inspection.grid import Signals, change, smoothed
from auvid_cli.inspection.inspection import cannot_tell, judged
from auvid_cli.inspection.kinematic_relations import Relation
from auvid_cli.inspection.regression import fit

Array = NDArray[np.float64]

# s, over which depth is gained: what averaging and delays make of a rate is then small.
_SPAN = 3.0
# Intervals of depth and pitch in that time, at least: a line between two measurements is flatter than what went on.
_FEWEST = 10
_LARGEST, _LARGEST_ERROR, _SIGMAS = 0.01, 0.006, 2.0


def scale_check(signals: Signals, dive: Relation) -> Check:
    """Compare the depth that is gained with what pitch and velocities promise.

    What an offset of pitch adds, u cos(theta) times it, stands beside.

    Parameters
    ----------
    signals : Signals
    dive : Relation
        Of `kinematic_relations.diving_speed`.
    """
    name, threshold = "scale by depth", f"1 +- {_LARGEST:g}, where it is known to {_LARGEST_ERROR:g}"
    if max(signals.interval["down"], signals.interval["theta"]) > _SPAN / _FEWEST:
        return cannot_tell("dvl", name, "depth or pitch is measured too seldom", threshold)
    window = signals.window("down", "u", "theta", least=_SPAN)

    def gained(rate: Array) -> Array:
        # A depth is known in the middle of a cell: from one middle to another lie the means of the cells between.
        means = smoothed(rate, window)
        return 0.5 * (means + np.append(means[1:], np.nan))

    beside = signals.values["u"] * np.cos(signals.values["theta"])
    sunk = change(signals.values["down"], window) / (window * signals.grid.step)
    fitted = fit(sunk, gained(dive.total()), [gained(beside)], window)
    if fitted is None or not fitted.error <= _LARGEST_ERROR:
        return cannot_tell("dvl", name, "the vehicle hardly dives, or not for long", threshold)
    away = abs(fitted.gain - 1.0)
    return judged(
        "dvl",
        name,
        statistic=f"depth changes {fitted.gain:.4f} +- {fitted.error:.2g} times as velocity and pitch have it",
        threshold=threshold,
        passed=None if away > max(_LARGEST, _SIGMAS * fitted.error) else True,
        advice="One of them is to another scale: a DVL told another speed of sound, or a depth in water of another "
        f"density (salt and fresh differ by 2.7 %). Multiply the velocities by {fitted.gain:.4g} if the depth is right "
        "(`scale` in the map), or find it (`identification.estimate.biases: [dvl]`).",
    )
