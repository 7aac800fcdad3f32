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
        95 % interval; from 0 where less is as likely, however little, and to infinity where more is.
    """

    setting: str
    unit: str
    stated: float
    tuned: float
    low: float
    high: float

    @property
    def worth_stating(self) -> float:
        """Return what settings should state: what is most likely or, where none would be as likely, not quite none.

        A tenth of the upper end costs a fiftieth of a log-likelihood, and a smoother follows a motion without any
        process noise only with difficulty.
        """
        bounded = self.low == 0.0 and isfinite(self.high)
        return max(self.tuned, _NOT_QUITE_NONE * self.high) if bounded else self.tuned


@dataclass(frozen=True)
class Tuning:
    """Noise that is most likely.

    Attributes
    ----------
    noises : tuple of TunedNoise
    gain : float
        In log-likelihood, over the noise that was stated.
    converged : bool
    experiment : RunSettings
        With the tuned noise.
    """

    noises: tuple[TunedNoise, ...]
    gain: float
    converged: bool
    experiment: RunSettings

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
        if estimate["biases"]:
            # This noise is that beside these: without one of them there is more.
            tree["identification"]["estimate"] = {key: estimate[key] for key in ("biases", *estimate["biases"])}
        tree["identification"]["smoother"] = {"answer": tuned["identification"]["smoother"]["answer"]}
        return yaml.safe_dump(tree, sort_keys=False)
