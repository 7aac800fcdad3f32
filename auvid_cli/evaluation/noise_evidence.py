"""Whether data ask for more or for less process noise than is stated, from which advice on it must follow."""

import numpy as np

from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import Cause
from auvid_cli.evaluation.causes import LARGEST_FAULT, causes_text
from auvid_cli.evaluation.motion_along import probable_motion
from auvid_cli.filters.noise_likelihood import noise_scores_about
from auvid_cli.identification.noise_tuning import process_noises
from auvid_cli.identification.prepared_data import PreparedData


def far_from_bound(prepared: PreparedData, estimate: Estimate, causes: list[Cause]) -> str:
    """Say why a filter knows so much less than its data hold: process noise is only called too large if it is.

    Parameters
    ----------
    prepared : PreparedData
        From which the estimate was made.
    estimate : Estimate
    causes : list of Cause
        What these data look like.
    """
    if causes:
        return f"Process noise takes its part, and must, for these data look like {causes_text(causes)}."
    score = process_noise_score(prepared, estimate) or 0.0
    by = f"by {abs(score):.0f} sigma (`auvid tune` finds how much)"
    if score < -LARGEST_FAULT:
        return f"Less process noise is likelier in these data than what is stated, {by}: lower it."
    if score > LARGEST_FAULT:
        return f"Process noise takes its part, and must: more of it is likelier in these data, {by}."
    return (
        "Process noise takes its part, and nothing in these data speaks against what is stated: more or livelier data "
        "will tell more, less process noise will not."
    )


def process_noise_score(prepared: PreparedData, estimate: Estimate) -> float | None:
    """Judge all process noise at once by Rao's test of its logarithm, about the trajectory of an estimate.

    Parameters
    ----------
    prepared : PreparedData
        From which the estimate was made.
    estimate : Estimate

    Returns
    -------
    float or None
        Standard deviations by which data ask for more of it or, negative, for less. None where they say nothing of it,
        or cannot be followed.
    """
    own = prepared.with_settings(estimate.experiment)
    if (about := probable_motion(own, dict(zip(estimate.state, estimate.mean[-1], strict=True)))) is None:
        return None
    groups = [noise.group for noise in process_noises(about.augmented, estimate.experiment.identification)]
    scores = noise_scores_about(about.augmented.joint, groups, about.filtered.trajectory)
    if scores is None or (information := float(scores.information.sum())) <= 0.0:
        return None
    return float(scores.slope.sum() / np.sqrt(information))
