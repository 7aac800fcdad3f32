"""From a trajectory down to the most probable one, by one linear smoothing problem after the other."""

from auvid_cli.filters.linear_smoothing import Filtered, LinearSmoothing, Trajectory

# Squares of standard deviations by which the cost may still fall, by the linear problem, before the last step: it moves
# no parameter by more than a tenth of its standard deviation, and what is left after it is smaller still.
_NEGLIGIBLE = 1e-2
# Shortest share of a step that is tried.
_SHORTEST = 2.0**-10


def minimise(smoothing: LinearSmoothing, start: Trajectory, max_passes: int) -> tuple[Filtered, bool] | None:
    """Step down from a trajectory: where that ends, and whether at a minimum; None if its cost is not finite."""
    here, passes = smoothing.filter(start), 1
    if here is None:
        return None
    while here.cost - here.least > _NEGLIGIBLE:
        step, share, lower = smoothing.step(here), 1.0, None
        while lower is None and share >= _SHORTEST and passes < max_passes:
            tried = smoothing.filter(here.trajectory.stepped(step, share))
            if tried is not None and tried.cost < here.cost:
                lower = tried
            share, passes = share / 2.0, passes + 1
        if lower is None:
            return here, False
        if here.cost - lower.cost < _NEGLIGIBLE:
            return lower, True
        here = lower
    return here, True
