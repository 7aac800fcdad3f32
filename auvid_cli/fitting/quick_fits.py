"""Quick fits of data with fewer samples, and a trial: a fit to two thirds of the data that predicts the last third."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from auvid_cli.config.enums import JUDGE
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.identification import Use
from auvid_cli.data.dataset import Dataset, cut
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import PreparedData, prepare
from auvid_cli.identification.problem_setup import Motion
from auvid_cli.identification.run import set_up_filters
from auvid_cli.identification.terms import split
from auvid_cli.validation.results import Score, scores_of, verdict_on
from auvid_cli.validation.validate import predict

# Samples of a sensor closer than this are left out during the search, s.
_INTERVAL = 0.1
_STEP = 0.05  # s, integration step during the search, unless a longer one is stated
# Number of starts of the predictions of a trial.
_STARTS = 30
_MIN_LENGTH = 30.0  # s; shorter data are not split


def thinned(dataset: Dataset) -> Dataset:
    """Return a dataset with the samples of fast sensors at most every `_INTERVAL`."""
    sensors = {}
    for name, record in dataset.sensors.items():
        usual = float(np.median(np.diff(record.time))) if record.time.size > 1 else _INTERVAL
        every = max(1, int(_INTERVAL / usual + 0.5))
        sensors[name] = replace(record, time=record.time[::every], values=record.values[::every])
    return replace(dataset, sensors=sensors)


def joint_answer(dataset: Dataset) -> Dataset:
    """Return a dataset whose settings ask for the joint estimate, with noise and delays as stated, in longer steps."""
    identification = dataset.experiment.identification
    changes = {
        "smoother": identification.smoother.model_copy(update={"answer": "joint"}),
        "noise": "stated",
        "integration_step": max(identification.integration_step, _STEP),
    }
    return dataset.with_settings(dataset.experiment.with_identification(**changes))


def smoothed(prepared: PreparedData, start: Motion | None = None) -> Estimate:
    """Return the estimate of the smoother with settings as stated; `start` is the motion of a similar model."""
    (run,), chunks = set_up_filters(prepared, [JUDGE], start=start), []
    outcome = run.run(chunks.append)
    return Estimate.of(run.header, chunks, outcome)


def training_part(dataset: Dataset, settings: RunSettings) -> PreparedData:
    """Return the first two thirds of the data for a fit; all if they are too short to be split."""
    errors = settings.identification.estimate.biases
    stated = settings.with_estimate(biases=tuple(error for error in errors if error != BiasName.DELAY))
    training, held_out = split(prepare(dataset))
    if _is_long_enough(held_out):
        stated = stated.with_identification(use=Use(spans=training))
    return prepare(dataset.with_settings(stated))


def try_on_held_out(dataset: Dataset, fitted: Estimate) -> tuple[Score, ...]:
    """Return the errors of predictions of the last third; empty if there are none, or the data are too short.

    Parameters
    ----------
    dataset : Dataset
        Its own settings are those of the vehicle file.
    fitted : Estimate
        From `training_part` of the dataset.
    """
    _, held_out = split(prepare(dataset))
    if not fitted.completed or not _is_long_enough(held_out):
        return ()
    data = dataset.without_truth()
    try:
        return scores_of(predict([cut(data, begin, end) for begin, end in held_out], fitted, _STARTS))
    except DataError:
        return ()


def _is_long_enough(held_out: Sequence[tuple[float, float]]) -> bool:
    return sum(end - begin for begin, end in held_out) >= _MIN_LENGTH / 3.0


def trial_text(scores: Sequence[Score]) -> str:
    """Return the result of a trial in a few sentences; empty without one."""
    if not scores:
        return ""
    text = f"Prediction of the last third by a fit to the rest. {'. '.join(map(str, scores))}."
    return f"{text} {verdict_on(scores)}".rstrip()
