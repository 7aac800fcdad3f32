"""Noise levels and missing terms as the data show them: value objects between identification and report."""

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.settings import Spans
from auvid_cli.data.checks import NamedRows

if TYPE_CHECKING:
    import pandas as pd

_NOT_QUITE_NONE = 0.1
# Gain in log-likelihood that a term must have where it was not fitted: e^3, or twenty to one, is usually called strong
# evidence (Kass and Raftery 1995).
MIN_HELD_OUT_GAIN = 3.0


class TunedNoise(NamedTuple):
    """One kind of noise.

    Attributes
    ----------
    setting : str
        Its key, as behind ``--set``, and of one of a list its number.
    unit : str
        SI.
    stated, tuned : float
        As the settings had it, and as it is most likely.
    low, high : float
        95 % interval; from 0 where less is as likely, however little, and to infinity where more is. Of a time constant
        from 0 where the data are as likely with white noise.
    """

    setting: str
    unit: str
    stated: float
    tuned: float
    low: float
    high: float

    @property
    def is_time_constant(self) -> bool:
        """Say whether it says how long something lasts, and not how large it is."""
        return "time_constant" in self.setting.split(".")

    @property
    def worth_stating(self) -> float:
        """Return what settings should state: what is most likely or, where none would be as likely, not quite none.

        A tenth of the upper end costs a fiftieth of a log-likelihood, and a smoother follows a motion without any
        process noise only with difficulty.
        """
        bounded = self.low == 0.0 and isfinite(self.high) and not self.is_time_constant
        return max(self.tuned, _NOT_QUITE_NONE * self.high) if bounded else self.tuned


class DisturbanceChoice(NamedTuple):
    """Whether data ask for a disturbance that lasts, by the Bayesian information criterion.

    Attributes
    ----------
    gain : float
        By how much the log-likelihood is greater with one.
    numbers : int
        Which that takes.
    needed : float
        Gain that so many numbers must be worth: half the logarithm of the number of measurements for each.
    """

    gain: float
    n_parameters: int
    needed: float

    @property
    def is_kept(self) -> bool:
        """Say whether the disturbance is estimated."""
        return self.gain > self.needed


@dataclass(frozen=True)
class Tuning:
    """Noise that is most likely.

    Attributes
    ----------
    noises : tuple of TunedNoise
    log_likelihood : float
        But for a constant of the data.
    gain : float
        In it, over the noise that was stated.
    converged : bool
    experiment : RunSettings
        With the tuned noise.
    choice : DisturbanceChoice or None
        Whether it has a disturbance, where that was to be chosen.
    """

    noises: tuple[TunedNoise, ...]
    log_likelihood: float
    gain: float
    converged: bool
    experiment: RunSettings
    choice: DisturbanceChoice | None = None

    def rows(self) -> NamedRows:
        """Return a row for each noise."""
        return NamedRows(TunedNoise._fields, self.noises)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each noise."""
        return self.rows().to_pandas()

    def settings(self) -> str:
        """Return settings with the tuned noise, what is estimated along, and what the smoother makes of it, as YAML."""
        tree: dict[str, Any] = {}
        tuned = self.experiment.model_dump(mode="json")
        for noise in self.noises:
            *sections, key = (part for part in noise.setting.split(".") if not part.isdigit())
            within, value = tree, tuned
            for section in sections:
                within, value = within.setdefault(section, {}), value[section]
            within[key] = value[key]
        estimate = tuned["identification"]["estimate"]
        if estimate["biases"] or self.choice is not None:
            # This noise is that beside these: without one of them there is more.
            tree["identification"]["estimate"] = {key: estimate[key] for key in ("biases", *estimate["biases"])}
        tree["identification"]["smoother"] = {"answer": tuned["identification"]["smoother"]["answer"]}
        return yaml.safe_dump(tree, sort_keys=False)


class ScoredTerm(NamedTuple):
    """A term that was looked at, beside those found before it; a row of ``terms.csv``.

    Attributes
    ----------
    look : int
        Which look at the data it belongs to: each begins with the terms that the looks before it found.
    term, unit, equation : str
    size, standard_deviation : float
        Of its coefficient if it alone were added, SI: of one that was tried by a fit to all data, of the others by the
        linear problem about the fit without them, which is rough where that is far off.
    gain : float
        In log-likelihood of the data that the model is fitted to, by the linear problem: rough.
    made_up_share : float
        Of what it does to the data, what the model's own coefficients make up for: 1 if they do so wholly.
    like : str
        Others that these data hardly tell from it.
    held_out_gain : float or None
        In log-likelihood of the data that were held out, from refitting with it; None where it was not tried.
    evidence_gain : float or None
        In log-likelihood of all data, whatever the coefficients and the motion, from refitting with it.
    found : bool
    """

    look: int
    term: str
    unit: str
    equation: str
    size: float
    standard_deviation: float
    gain: float
    made_up_share: float
    like: str
    held_out_gain: float | None
    evidence_gain: float | None
    found: bool

    @property
    def is_likelier(self) -> bool:
        """Say whether the data that were held out speak for it."""
        return self.held_out_gain is not None and self.held_out_gain >= MIN_HELD_OUT_GAIN


@dataclass(frozen=True)
class TermFindings:
    """What was looked at, and what was found.

    Attributes
    ----------
    scored : tuple of ScoredTerm
        Of each look the best by the linear problem, best first.
    n_candidates : int
    fitted, held_out : tuple of (float, float)
        Spans of the data, s.
    experiment : RunSettings
        With the terms that were found, to be estimated.
    """

    scored: tuple[ScoredTerm, ...]
    n_candidates: int
    fitted: Spans
    held_out: Spans
    experiment: RunSettings

    @property
    def found(self) -> tuple[ScoredTerm, ...]:
        """Return the terms that were found, in the order in which they were."""
        return tuple(term for term in self.scored if term.found)

    def rows(self) -> NamedRows:
        """Return a row for each term that was looked at."""
        return NamedRows(ScoredTerm._fields, self.scored)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each term that was looked at."""
        return self.rows().to_pandas()

    def settings(self) -> str:
        """Return settings with all terms of the vehicle, those found among them, as YAML."""
        keys = "name", "row", "factors", "value", "estimate"
        terms = []
        for term in self.experiment.vehicle.terms:
            dumped = term.model_dump(mode="json", exclude_unset=True)
            terms.append({key: dumped[key] for key in (*keys, *(k for k in dumped if k not in keys)) if key in dumped})
        return yaml.safe_dump({"vehicle": {"terms": terms}}, sort_keys=False)
