"""Trial of a model: fit to the first two thirds of the data, and prediction of the last third."""

from collections.abc import Sequence
from dataclasses import replace

from auvid_cli.config.enums import JUDGE
from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import BiasName
from auvid_cli.config.identification import Use
from auvid_cli.data.dataset import Dataset, cut
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.identification.terms import split
from auvid_cli.validation.results import Score, scores_of, verdict_on
from auvid_cli.validation.validate import validate

_STARTS = 60
_MIN_LENGTH = 30.0  # s; shorter data are not split


def try_on_held_out(dataset: Dataset, settings: RunSettings) -> tuple[Score, ...]:
    """Return the errors of predictions of the last third by a fit to the rest; empty if the data are too short.

    Parameters
    ----------
    dataset : Dataset
        Its own settings are those of the vehicle file.
    settings : RunSettings
        Settings of the model.
    """
    errors = settings.identification.estimate.biases
    stated = settings.with_estimate(biases=tuple(error for error in errors if error != BiasName.DELAY))
    data = replace(dataset, experiment=stated)
    training, held_out = split(prepare(data))
    if sum(end - begin for begin, end in held_out) < _MIN_LENGTH / 3.0:
        return ()
    fitted = identify(replace(data, experiment=stated.with_identification(use=Use(spans=training))), JUDGE)
    if not fitted.completed:
        return ()
    parts = [cut(dataset.without_truth(), begin, end) for begin, end in held_out]
    try:
        return scores_of(validate(parts, fitted, starts=_STARTS).predictions)
    except DataError:
        return ()


def trial_text(scores: Sequence[Score]) -> str:
    """Return the result of a trial in a few sentences; empty without one."""
    if not scores:
        return ""
    text = f"Prediction of the last third by a fit to the rest. {'. '.join(map(str, scores))}."
    return f"{text} {verdict_on(scores)}".rstrip()
