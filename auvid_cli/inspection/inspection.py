"""What an inspection finds."""

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.check import Check, Checks
from auvid_cli.data.dataset import InputRecord
from auvid_cli.data.named_rows import NamedRows

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

# Data belong to no filter.
judged = partial(Check.of, "")


def cannot_tell(subject: str, check: str, reason: str, threshold: str) -> Check:
    """Make the verdict on what these data do not tell."""
    return judged(
        subject,
        check,
        statistic=f"cannot tell: {reason}",
        threshold=threshold,
        passed=None,
        advice="This was not checked, and may be wrong.",
    )


MarkKind = Literal["gap", "clock", "stuck", "spike", "step"]


class Mark(NamedTuple):
    """A time, s, at which something is the matter with a sensor."""

    sensor: str
    kind: MarkKind
    start: float
    end: float


@dataclass(frozen=True)
class Inspection:
    """Verdicts on a dataset, and what a timeline of it shows.

    Attributes
    ----------
    checks : Checks
    marks : list of Mark
    inputs : InputRecord
        Of long ones evenly spaced samples.
    presence : dict of ndarray, shape (bins,)
        By sensor, how many of the usual measurements there are in each of equal pieces of the span, 0 to 1.
    span : tuple of float
        First and last time of anything, s.
    """

    checks: Checks
    marks: list[Mark]
    inputs: InputRecord
    presence: dict[str, Array]
    span: tuple[float, float]

    def rows(self) -> NamedRows:
        """Return the rows of ``inspection.csv``: a check begins with the filter that it is of, and data are of none."""
        return NamedRows(Check._fields[1:], [check[1:] for check in self.checks])

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each verdict; ``passed`` is missing of what is only worth knowing."""
        return self.rows().to_pandas()
