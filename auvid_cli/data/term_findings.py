"""Terms that a model lacks, as the data have it: the value objects between identification and report."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import yaml

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.spans import Spans
from auvid_cli.data.named_rows import NamedRows

if TYPE_CHECKING:
    import pandas as pd


# Gain in log-likelihood that a term must have where it was not fitted: e^3, or twenty to one, is usually called strong
# evidence (Kass and Raftery 1995).
LEAST_HELD_OUT_GAIN = 3.0


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
        return self.held_out_gain is not None and self.held_out_gain >= LEAST_HELD_OUT_GAIN


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
