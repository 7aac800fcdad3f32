"""Trial of a model: fit to the first two thirds of the data, and prediction of the last third."""

from collections.abc import Sequence
from dataclasses import replace

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.identification import Use
from auvid_cli.data.dataset import Dataset, cut
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import PreparedData, prepare
from auvid_cli.identification.terms import split
from auvid_cli.validation.results import Score, scores_of, verdict_on
from auvid_cli.validation.validate import predict

_STARTS = 30
_MIN_LENGTH = 30.0  # s; shorter data are not split


def training_part(dataset: Dataset, settings: RunSettings) -> PreparedData:
    """Return the first two thirds of the data for a fit; all if they are too short to be split."""
    errors = settings.identification.estimate.biases
    stated = settings.with_estimate(biases=tuple(error for error in errors if error != BiasName.DELAY))
    training, held_out = split(prepare(dataset))
    if _is_long_enough(held_out):
        stated = stated.with_identification(use=Use(spans=training))
    return prepare(replace(dataset, experiment=stated))


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
