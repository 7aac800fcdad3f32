"""What a worker does: simulate data once, run filters on them, measure."""

import json
import traceback
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from auvid_cli import __version__
from auvid_cli.campaign.measures import Measure, measures
from auvid_cli.campaign.plan import CampaignRun, RunGroup
from auvid_cli.config.actuators import ActuatorSettings
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.filter_name import JUDGE
from auvid_cli.config.identification import Identification, Use
from auvid_cli.config.load import given_settings
from auvid_cli.config.terms import Term
from auvid_cli.data.dataset import Dataset, TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.errors import AuvidError, ConfigError, DataError
from auvid_cli.evaluation.bounds import bounds_at
from auvid_cli.evaluation.judgement import judge_one
from auvid_cli.identification.identify import identify
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.simulation.simulate import simulate

# What of the settings of a filter its bound depends on.
_OF_THE_DATA = {
    *("coefficients", "attitude_from", "use", "estimate", "integration_step"),
    *("inputs", "delays"),
}


class Performed(NamedTuple):
    """Outcome of a run.

    Attributes
    ----------
    run : CampaignRun
    rows : list of Measure
        None of a run that failed.
    failure : str
        Why it failed; empty if it did not.
    estimate : Estimate or None
        Only if it was asked for.
    """

    run: CampaignRun
    rows: list[Measure]
    failure: str
    estimate: Estimate | None


def perform(group: RunGroup, with_estimates: bool = False) -> list[Performed]:
    """Do all runs of a group, on one core; what goes wrong with one is its failure and does not end the others.

    Raises
    ------
    ConfigError
        If this is another version of auvid than the one that made the group.
    """
    if group.version != __version__:
        raise ConfigError(f"the worker has auvid {__version__}, the campaign is of auvid {group.version}")
    with threadpool_limits(1):
        pairs = zip(group.runs, group.assumed, strict=True)
        return [_perform(group.simulated, run, assumed, with_estimates) for run, assumed in pairs]


def shortened_group(group: RunGroup, duration: float) -> tuple[RunGroup, float]:
    """Cut a group to the beginning of its data, s, all of which counts; say what share of its data that is."""
    whole = Experiment.model_validate_json(group.simulated).manoeuvre.duration
    part = min(duration, whole)

    def cut(text: str) -> str:
        experiment = Experiment.model_validate_json(text)
        manoeuvre = experiment.manoeuvre.model_copy(update={"duration": part})
        identification = experiment.identification.model_copy(update={"use": Use()})
        changes = {"manoeuvre": manoeuvre, "identification": identification}
        return json.dumps(given_settings(experiment.model_copy(update=changes)))

    return group._replace(simulated=cut(group.simulated), assumed=[cut(text) for text in group.assumed]), part / whole


def _perform(simulated: str, run: CampaignRun, given: str, with_estimates: bool) -> Performed:
    try:
        dataset = _data(simulated)
        assumed = Experiment.model_validate_json(given)
        (name,) = assumed.identification.filters
        reference = _reference(simulated, _judging(assumed))
        if reference is not None and name is JUDGE:
            estimate = reference
        else:
            estimate = identify(_as_assumed(dataset, assumed), name)
        estimated = assumed.identification.estimated(assumed.vehicle)
        settings = assumed.identification.model_copy(update={"coefficients": estimated})
        of_data = settings.model_dump_json(include=_OF_THE_DATA, exclude_none=True)
        bounds = _bounds(
            simulated, of_data, assumed.vehicle.model_dump_json(include={"terms", "actuators"}, exclude_none=True)
        )
        judgement = judge_one(estimate, reference)
        rows = measures(run.identity, run.filter, run.seed, estimate, _truth(dataset), bounds, judgement)
    except AuvidError as error:
        return Performed(run, [], str(error), None)
    except Exception as error:
        # A campaign goes on; the failure is named with its place, and counted.
        place = traceback.extract_tb(error.__traceback__)[-1]
        return Performed(run, [], f"{type(error).__name__}: {error} ({place.name}, line {place.lineno})", None)
    return Performed(run, rows, "", estimate if with_estimates else None)


# Groups with the same data come one after the other, and several workers take turns.
@lru_cache(maxsize=2)
def _data(simulated: str) -> Dataset:
    return simulate(Experiment.model_validate_json(simulated))


def _as_assumed(dataset: Dataset, assumed: Experiment) -> Dataset:
    """Return the data with the settings that a filter assumes, the noise of the sensors included."""
    records = {
        name: replace(record, standard_deviation=np.array(getattr(assumed.sensors, name).stated_standard_deviation()))
        for name, record in dataset.sensors.items()
    }
    return replace(dataset, sensors=records, experiment=assumed)


def _judging(assumed: Experiment) -> str:
    """Return the experiment that fits the judge of a filter; empty if nobody is to judge it."""
    settings = assumed.identification
    if JUDGE not in settings.with_judge(settings.filters):
        return ""
    judge = settings.of_filter(JUDGE)
    return json.dumps(given_settings(assumed.model_copy(update={"identification": judge})))


# The filters of a group's data that assume the same share their judge, which may be one of them.
@lru_cache(maxsize=4)
def _reference(simulated: str, given: str) -> Estimate | None:
    if not given:
        return None
    return identify(_as_assumed(_data(simulated), Experiment.model_validate_json(given)), JUDGE)


def _truth(dataset: Dataset) -> TruthRecord:
    if dataset.truth is None:
        raise DataError("simulated data without truth")
    return dataset.truth


@lru_cache(maxsize=8)
def _bounds(simulated: str, identification: str, assumed: str) -> Mapping[str, float]:
    """Return Cramer-Rao bounds at the truth, by symbol; empty where there are none.

    Parameters
    ----------
    simulated : str
        Experiment that makes the data.
    identification : str
        What is estimated from which part of them.
    assumed : str
        Terms that may be among it, and of which those that the simulation does not have are truly zero; and actuators.
    """
    dataset = _data(simulated)
    vehicle = dataset.experiment.vehicle
    of_vehicle = json.loads(assumed)
    of_filter = (Term.model_validate(term) for term in of_vehicle["terms"])
    actuators = ActuatorSettings.model_validate(of_vehicle["actuators"])
    beyond = tuple(term for term in of_filter if term.name not in vehicle.coefficient_set.symbols)
    vehicle = vehicle.model_copy(update={"terms": (*vehicle.terms, *beyond), "actuators": actuators})
    settings = Identification.model_validate_json(identification, context=vehicle.coefficient_set)
    changes = {"identification": settings, "vehicle": vehicle}
    data = replace(dataset, experiment=dataset.experiment.model_copy(update=changes))
    return bounds_at(prepare(data), data.known_coefficients()).of_data
