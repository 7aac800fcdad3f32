"""Results of searches: noise levels, missing terms, and the state of a manoeuvre search."""

import json
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import yaml
from pydantic import AfterValidator, BaseModel, Field, FiniteFloat, ValidationError

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.settings import Spans
from auvid_cli.data.checks import NamedRows
from auvid_cli.data.files import write_text
from auvid_cli.errors import FileError

if TYPE_CHECKING:
    import pandas as pd

# Noise that is likely to be zero gets this share of the upper end of its interval, because a smoother hardly converges
# without process noise. The log-likelihood decreases by only 1/50.
_SHARE_OF_HIGH = 0.1
# Gain in log-likelihood of a term in held-out data: e^3, or twenty to one, is strong evidence (Kass and Raftery 1995).
MIN_HELD_OUT_GAIN = 3.0


class TunedNoise(NamedTuple):
    """Estimate of one noise level."""

    setting: str  # key as after ``--set``, with an index for an element of a list
    unit: str  # SI
    stated: float  # value in the settings
    tuned: float  # most likely value
    # Ends of the 95 % interval; NaN if it was not computed. The lower one is 0 if any smaller value is as likely (white
    # noise for a time constant), the upper one infinite if any larger value is.
    low: float
    high: float

    @property
    def is_time_constant(self) -> bool:
        """Whether it is a correlation time instead of a noise level."""
        return "time_constant" in self.setting.split(".")

    @property
    def worth_stating(self) -> float:
        """Return the value for the settings: the most likely one, but not zero."""
        may_be_zero = self.low == 0.0 and isfinite(self.high) and not self.is_time_constant
        return max(self.tuned, _SHARE_OF_HIGH * self.high) if may_be_zero else self.tuned


class DisturbanceChoice(NamedTuple):
    """Choice between models with and without an autocorrelated disturbance, by the Bayesian information criterion."""

    gain: float  # increase of the log-likelihood by the disturbance
    n_parameters: int  # number of parameters of the disturbance
    needed: float  # least gain: half the logarithm of the number of measurements, for each parameter

    @property
    def is_kept(self) -> bool:
        """Whether the disturbance is estimated."""
        return self.gain > self.needed


@dataclass(frozen=True)
class Tuning:
    """Result of the search for the most likely noise."""

    noises: tuple[TunedNoise, ...]
    log_likelihood: float  # log-likelihood with this noise, up to a constant that depends only on the data
    gain: float  # increase of the log-likelihood compared with the stated noise
    converged: bool
    experiment: RunSettings  # settings with the tuned noise
    choice: DisturbanceChoice | None = None  # None if models without and with a disturbance were not compared

    def rows(self) -> NamedRows:
        """Return a row for each noise."""
        return NamedRows(TunedNoise._fields, self.noises)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each noise."""
        return self.rows().to_pandas()

    def settings(self) -> str:
        """Return the tuned noise, the estimated errors and the smoother's answer as YAML settings."""
        tree: dict[str, Any] = {}
        tuned = self.experiment.model_dump(mode="json")
        for noise in self.noises:
            *sections, key = (part for part in noise.setting.split(".") if not part.isdigit())
            branch, value = tree, tuned
            for section in sections:
                branch, value = branch.setdefault(section, {}), value[section]
            branch[key] = value[key]
        estimate = tuned["identification"]["estimate"]
        if estimate["biases"] or self.choice is not None:
            # The noise is valid only with these errors estimated.
            tree["identification"]["estimate"] = {key: estimate[key] for key in ("biases", *estimate["biases"])}
        tree["identification"]["smoother"] = {"answer": tuned["identification"]["smoother"]["answer"]}
        return yaml.safe_dump(tree, sort_keys=False)


class ScoredTerm(NamedTuple):
    """Candidate for an additional term; a row of ``terms.csv``."""

    look: int  # number of the search step; each starts with the terms found in the steps before
    term: str
    unit: str
    equation: str
    # Coefficient of the term if no other term is added, SI. From a fit to all data if there is one; otherwise from
    # linearisation about the fit without the term, which is rough for large terms
    size: float
    standard_deviation: float  # standard deviation of `size`, SI
    gain: float  # increase of the log-likelihood of the fitted data, by linearisation
    made_up_share: float  # share of the effect of the term that the coefficients of the model can reproduce, 0 to 1
    like: str  # other terms with nearly the same effect on these data
    # Increase of the log-likelihood of the held-out data after a fit with the term; None without such a fit
    held_out_gain: float | None
    # Increase of the marginal log-likelihood of all data after a fit with the term; None without such a fit
    evidence_gain: float | None
    found: bool

    @property
    def is_likelier(self) -> bool:
        """Whether the held-out data support the term."""
        return self.held_out_gain is not None and self.held_out_gain >= MIN_HELD_OUT_GAIN


@dataclass(frozen=True)
class TermFindings:
    """Result of a search for missing terms."""

    scored: tuple[ScoredTerm, ...]  # the best candidates of each step by linearisation, best first
    n_candidates: int
    fitted: Spans  # spans of the data that the model was fitted to, s
    held_out: Spans  # spans of the data that only tested the terms, s
    experiment: RunSettings  # settings that also estimate the found terms

    @property
    def found(self) -> tuple[ScoredTerm, ...]:
        """Return the found terms, in order."""
        return tuple(term for term in self.scored if term.found)

    def rows(self) -> NamedRows:
        """Return a row for each candidate."""
        return NamedRows(ScoredTerm._fields, self.scored)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each candidate."""
        return self.rows().to_pandas()

    def settings(self) -> str:
        """Return all terms of the vehicle, the found ones included, as YAML settings."""
        keys = "name", "row", "factors", "value", "estimate"
        terms = []
        for term in self.experiment.vehicle.terms:
            dumped = term.model_dump(mode="json", exclude_unset=True)
            terms.append({key: dumped[key] for key in (*keys, *(k for k in dumped if k not in keys)) if key in dumped})
        return yaml.safe_dump({"vehicle": {"terms": terms}}, sort_keys=False)


class SearchState(NamedTuple):
    """State of a search for a manoeuvre, from which it can be continued."""

    key: str  # hash of all inputs of the search
    elapsed: float  # s
    costs: tuple[tuple[float, ...], ...]  # costs of all manoeuvres, by generation


def _check_sizes(costs: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len({len(generation) for generation in costs}) > 1:
        raise ValueError("generations of different sizes")
    return costs


_Costs = Annotated[tuple[FiniteFloat, ...], Field(min_length=1)]


class _SearchFile(BaseModel, strict=True):
    kind: Literal["auvid design search"]
    key: str
    elapsed: FiniteFloat
    costs: Annotated[tuple[_Costs, ...], Field(min_length=1), AfterValidator(_check_sizes)]


def write_search(path: Path, state: SearchState) -> None:
    """Write the state of a search; raise a FileError if the file cannot be written."""
    write_text(path, json.dumps({"kind": "auvid design search"} | state._asdict()) + "\n")


def read_search(path: Path) -> SearchState | None:
    """Read the state of a search; None if there is no file, FileError if it is damaged or has other content."""
    try:
        content = _SearchFile.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    except ValidationError:
        raise FileError(f"{path}: damaged, or not the state of a search; remove it to start again") from None
    return SearchState(content.key, content.elapsed, content.costs)
