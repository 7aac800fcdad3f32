"""Noise as the data have it: the value object between identification and report."""

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

from auvid_cli.config.experiment import RunSettings
from auvid_cli.data.named_rows import NamedRows

if TYPE_CHECKING:
    import pandas as pd


_NOT_QUITE_NONE = 0.1


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
    numbers: int
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
