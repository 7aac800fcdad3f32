"""What identification should be told of these data, the likeliest first: delay, current, trim, errors that last."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from auvid_cli.data.check import Check
from auvid_cli.inspection.alignment import Alignment
from auvid_cli.inspection.current import Drift
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.lasting_errors import LastingError
from auvid_cli.inspection.rudder_trim import RudderTrim

_SUBJECT, _NAME = "identification", "likely causes"


class LikelyCause(NamedTuple):
    """Something that would be taken for motion or noise if it were not told.

    Attributes
    ----------
    gain : float
        In log-likelihood, of the signals that show it, over those that would be without it.
    name, remedy : str
    shown_by : tuple of str
        Verdicts, any of which says that it is there.
    """

    gain: float
    name: str
    remedy: str
    shown_by: tuple[str, ...]


def causes_by_evidence(
    alignment: Alignment, drift: Drift | None, trim: RudderTrim | None, errors: Sequence[LastingError], biases: str
) -> Iterator[LikelyCause]:
    """Yield what the evidence speaks for.

    Parameters
    ----------
    alignment : Alignment
    drift : Drift or None
        None where there is no current.
    trim : RudderTrim or None
        None where nothing tells it.
    errors : sequence of LastingError
    biases : str
        Names of blocks that find these.
    """
    if alignment.is_delayed and alignment.delay is not None:
        setting = f"its delay (`identification.delays={{inputs: {-alignment.delay:.2g} s}}`)"
        yield LikelyCause(alignment.gain, "inputs at another time", setting, ("delay",))
    if drift is not None:
        remedy = "the current (`identification.estimate.biases: [current]`)"
        yield LikelyCause(0.5 * (drift.size / drift.error) ** 2, "a current", remedy, ("current",))
    if trim is not None and trim.is_off:
        remedy = "the trim of the rudder (`identification.estimate.biases: [fin_trim]`)"
        yield LikelyCause(0.5 * (trim.angle / trim.error) ** 2, "a rudder that is off its middle", remedy, ("trim",))
    if beyond := [error for error in errors if error.is_beyond_noise]:
        yield LikelyCause(
            sum(error.gain for error in beyond),
            "errors of the gyroscope that last",
            f"the bias of the gyroscope (`identification.estimate.biases: [{biases}]`) or more process noise (`auvid "
            "tune`)",
            tuple(f"errors that last in {error.rate}" for error in beyond),
        )


def causes_check(causes: Iterator[LikelyCause], checks: Sequence[Check]) -> Check:
    """Put those in order that no other verdict calls in doubt.

    Parameters
    ----------
    causes : iterator of LikelyCause
    checks : sequence of Check
        All verdicts, weighed.
    """
    told = {check.check for check in checks if check.passed is not True and "cannot tell" not in check.statistic}
    known = sorted((cause for cause in causes if told & {*cause.shown_by}), key=lambda cause: -cause.gain)
    return judged(
        _SUBJECT,
        _NAME,
        statistic="; ".join(f"{cause.name} (gains {cause.gain:.0f} in log-likelihood)" for cause in known) or "none",
        threshold="nothing that would pass for motion or noise",
        passed=None if known else True,
        advice="Identification should be told, the likeliest first: "
        f"{'; then '.join(cause.remedy for cause in known)}. What is left is process noise: more of it, not less.",
    )
