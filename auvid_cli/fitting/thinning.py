"""Quick fits during a search: data with fewer samples, and the smoother without the marginal estimate."""

from dataclasses import replace

import numpy as np

from auvid_cli.config.enums import JUDGE
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.problem_setup import Motion
from auvid_cli.identification.run import set_up_filters

# Samples of a sensor closer than this are left out during the search, s.
_INTERVAL = 0.1
_STEP = 0.05  # s, integration step during the search, unless a longer one is stated


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
    return replace(dataset, experiment=dataset.experiment.with_identification(**changes))


def smoothed(prepared: PreparedData, start: Motion | None = None) -> Estimate:
    """Return the estimate of the smoother with settings as stated; `start` is the motion of a similar model."""
    (run,), chunks = set_up_filters(prepared, [JUDGE], start=start), []
    outcome = run.run(chunks.append)
    return Estimate.of(run.header, chunks, outcome)
