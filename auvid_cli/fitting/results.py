"""Result of a search for a model: its steps, its settings, and its estimate."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import yaml

from auvid_cli.config.experiment import RunSettings
from auvid_cli.data.checks import NamedRows
from auvid_cli.data.estimate import Estimate
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.fitting.additions import Addition

if TYPE_CHECKING:
    import pandas as pd

# Settings below `identification` that a search changes.
_CHANGED = "coefficients", "prior", "estimate", "delays", "process_noise", "measurement_noise", "noise", "smoother"
FitAction: TypeAlias = Literal["as asked", "hold", "start", "add", "remove", "leave at 0", "end"]


class FitStep(NamedTuple):
    """A step of the search; a row of ``fit_steps.csv``."""

    look: int  # 0 for the start; all steps of a look start from the same model
    action: FitAction
    what: Addition | str  # addition or removal; text for any other step
    size: str  # estimated values with their standard deviations and units; angles in degrees; empty if unknown
    gain: float | None  # increase of the log marginal likelihood, net of the numbers that it takes; None for a start
    kept: bool
    judged_before: str  # judgement of the model before the look
    judged_after: str  # judgement of the model with the change; empty if it was not kept
    cpu_time: float  # s

    @property
    def key(self) -> tuple[str, str] | None:
        """Return the `Addition.key` of what was added or removed, whose size may have changed since; None for words."""
        return self.what.key if isinstance(self.what, Addition) else None


@dataclass(frozen=True)
class Fit:
    """A model that was found for a dataset, and the steps that led to it."""

    estimate: Estimate  # of the smoother, from all data
    judgement: Judgement
    steps: tuple[FitStep, ...]
    experiment: RunSettings  # settings of the model
    unexplained: tuple[str, ...]  # what the model leaves unexplained, and advice
    trial: str = ""  # how well the model predicts the last third of the data if it is fitted to the rest
    stopped: str = ""  # reason of an early end; empty if the search was complete

    @property
    def is_sound(self) -> bool:
        """Whether the estimate may be used."""
        return self.judgement.grade is Grade.SOUND

    @property
    def added(self) -> tuple[str, ...]:
        """Return the additions that the model has."""
        added = dict[object, str]()
        for step in self.steps:
            if step.kept and step.action == "add":
                added[step.key] = str(step.what)
            elif step.kept and step.action == "remove":
                added.pop(step.key, None)
        return tuple(added.values())

    def rows(self) -> NamedRows:
        """Return a row for each step."""
        return NamedRows(FitStep._fields, [step._replace(what=str(step.what)) for step in self.steps])

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each step."""
        return self.rows().to_pandas()

    def settings(self) -> str:
        """Return the settings of the model as YAML, with which `identify` repeats the estimate."""
        dumped = self.experiment.model_dump(mode="json")
        changed = {key: dumped["identification"][key] for key in _CHANGED}
        estimate = changed["estimate"]
        changed["estimate"] = {key: estimate[key] for key in ("biases", *estimate["biases"])}
        tree: dict[str, Any] = {"identification": changed}
        vehicle: dict[str, Any] = {}
        if self.experiment.vehicle.terms:
            vehicle["terms"] = [
                term.model_dump(mode="json", exclude_unset=True) for term in self.experiment.vehicle.terms
            ]
        if (lag := self.experiment.vehicle.actuators.fins.time_constant) is not None:
            vehicle["actuators"] = {"fins": {"time_constant": lag}}
        if vehicle:
            tree["vehicle"] = vehicle
        return yaml.safe_dump(tree, sort_keys=False)


def with_model(settings: RunSettings, model: RunSettings) -> RunSettings:
    """Return settings in which all that a search may change is as in a model."""
    parts = {"terms": model.vehicle.terms, "actuators": model.vehicle.actuators}
    vehicle = settings.vehicle.model_copy(update=parts)
    changed = settings.model_copy(update={"vehicle": vehicle})
    return changed.with_identification(**{key: getattr(model.identification, key) for key in _CHANGED})
