"""Likely causes of contradictions between signals, by evidence: delay, current, trim, autocorrelated errors."""

from collections.abc import Iterator, Sequence, Set

from auvid_cli.data.checks import Check
from auvid_cli.data.faults import Cause, FaultKind
from auvid_cli.inspection.delays import Alignment
from auvid_cli.inspection.fins import RudderTrim
from auvid_cli.inspection.inspection import judged
from auvid_cli.inspection.lasting_errors import LastingError
from auvid_cli.inspection.responses import Drift

_SUBJECT, _NAME = "identification", "likely causes"


def causes_check(
    alignment: Alignment,
    drift: Drift | None,
    trim: RudderTrim | None,
    errors: Sequence[LastingError],
    biases: str,
    checks: Sequence[Check],
) -> Check:
    """Return the check that lists the likely causes in the order of their evidence.

    Parameters
    ----------
    alignment : Alignment
    drift : Drift or None
        None where there is no current.
    trim : RudderTrim or None
        None where it is unknown.
    errors : sequence of LastingError
    biases : str
        Names of the blocks that estimate these.
    checks : sequence of Check
        All others, weighed; a cause whose own check passed, or could not be made, is left out.
    """
    shown = {check.check for check in checks if check.passed is not True and "cannot tell" not in check.statistic}
    known = sorted(_causes(alignment, drift, trim, errors, biases, shown), key=lambda cause: -cause.gain)
    return judged(
        _SUBJECT,
        _NAME,
        statistic="; ".join(cause.name_with_gain for cause in known) or "none",
        threshold="nothing that would pass for motion or noise",
        passed=None if known else True,
        advice="Identification should be told, the likeliest first: "
        f"{'; then '.join(cause.remedy for cause in known)}. What is left is process noise: more of it, not less.",
    )


def _causes(
    alignment: Alignment,
    drift: Drift | None,
    trim: RudderTrim | None,
    errors: Sequence[LastingError],
    biases: str,
    shown: Set[str],
) -> Iterator[Cause]:
    """Yield the causes that the evidence and a check of this name show."""
    if "delay" in shown and alignment.is_delayed and alignment.delay is not None:
        setting = f"its delay (`identification.delays={{inputs: {-alignment.delay:.2g} s}}`)"
        yield Cause(alignment.gain, "inputs at another time", setting)
    if "current" in shown and drift is not None:
        yield Cause(0.5 * (drift.size / drift.error) ** 2, "a current", f"the current (`{FaultKind.CURRENT.setting}`)")
    if "trim" in shown and trim is not None and trim.is_off:
        remedy = f"the trim of the rudder (`{FaultKind.FIN_TRIM.setting}`)"
        yield Cause(0.5 * (trim.angle / trim.error) ** 2, "a rudder that is off its middle", remedy)
    beyond = [error for error in errors if error.is_beyond_noise]
    if any(f"errors that last in {error.rate}" in shown for error in beyond):
        yield Cause(
            sum(error.gain for error in beyond),
            "errors of the gyroscope that last",
            f"the bias of the gyroscope (`identification.estimate.biases: [{biases}]`) or more process noise (`auvid "
            "tune`)",
        )
