"""Several stretches of data that share their parameters, while the motion begins anew in each.

Their joint state is the parameters, then the moving states at the beginning of each stretch. Of one stretch it is the
state that a filter knows.
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.filters.problem import OK, PREDICTION, Belief, Ending, Indices, Receiver, Records, Timeline

Array = NDArray[np.float64]

# Filters a stretch from a belief about its own state.
Run = Callable[[Iterable[Timeline], Belief, Receiver], Ending]


def places(n_joint: int, n_moving: int, n_stretches: int) -> list[Indices]:
    """Where in a joint state the own state of each stretch stands."""
    n_parameters = n_joint - n_stretches * n_moving
    own = np.arange(n_parameters, n_joint).reshape(n_stretches, n_moving)
    return [np.concatenate([np.arange(n_parameters), moving]) for moving in own]


def joint_belief(beliefs: Sequence[Belief], n_moving: int) -> Belief:
    """About stretches of which the same is known of the parameters, and whose motions share nothing else."""
    n = beliefs[0].mean.size + (len(beliefs) - 1) * n_moving
    joint = Belief(np.zeros(n), np.zeros((n, n)))
    for belief, place in zip(beliefs, places(n, n_moving, len(beliefs)), strict=True):
        joint.mean[place] = belief.mean
        joint.factor[np.ix_(place, place)] = belief.factor
    return joint


def of_stretch(joint: Belief, place: Indices) -> Belief:
    """What a joint belief says of the own state of a stretch."""
    return Belief(joint.mean[place], joint.factor[np.ix_(place, place)])


def one_after_the_other(
    run: Run, n_moving: int, stretches: Sequence[Iterable[Timeline]], prior: Belief, receive: Receiver
) -> Ending:
    """Filter stretches in their order; each begins with what the one before says of the parameters.

    Parameters
    ----------
    run : callable
    n_moving : int
    stretches : sequence of iterable of Timeline
    prior : Belief
        About the joint state.
    receive : callable
        Told every part of every stretch.

    Returns
    -------
    Ending
        That of the last stretch, or of the one at which a filter failed.
    """
    n_parameters = prior.mean.size - len(stretches) * n_moving
    final, n_good = prior.mean, 0
    ending = Ending(np.zeros((0, 0)), 0, OK)

    def keep_and_pass_on(timeline: Timeline, records: Records) -> None:
        nonlocal final
        if len(records.mean):
            final = records.mean[-1]
        receive(timeline, records)

    for k, place in enumerate(places(prior.mean.size, n_moving, len(stretches))):
        belief = of_stretch(prior, place)
        if k:
            try:
                belief = _with_parameters(belief, _marginal(final, ending.covariance, n_parameters))
            except np.linalg.LinAlgError:
                return ending._replace(n_good=n_good, culprit=PREDICTION)
        ending = run(stretches[k], belief, keep_and_pass_on)
        n_good += ending.n_good
        if ending.culprit != OK:
            break
    return ending._replace(n_good=n_good)


def _marginal(mean: Array, covariance: Array, n: int) -> Belief:
    """The first n components of a state."""
    scale = np.sqrt(np.diagonal(covariance)[:n])
    correlation = covariance[:n, :n] / np.outer(scale, scale)
    return Belief(mean[:n].copy(), np.asarray(scale[:, None] * np.linalg.cholesky(correlation), dtype=np.float64))


def _with_parameters(belief: Belief, parameters: Belief) -> Belief:
    """The same motion, given the parameters, with another belief about these."""
    n = parameters.mean.size
    by_parameters = np.linalg.solve(belief.factor[:n, :n].T, belief.factor[n:, :n].T).T
    mean, factor = belief.mean.copy(), belief.factor.copy()
    mean[:n] = parameters.mean
    mean[n:] += by_parameters @ (parameters.mean - belief.mean[:n])
    factor[:n, :n] = parameters.factor
    factor[n:, :n] = by_parameters @ parameters.factor
    return Belief(mean, factor)
