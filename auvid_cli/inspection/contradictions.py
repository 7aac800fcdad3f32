"""What verdicts that contradict each other make of the rest: of which sign is turned, and of what hangs on it.

A vehicle and its mirror image move by the same equations. Where rudder and slip both seem turned it is rather the
heading that is; but if both are, turning the heading makes the data those of the mirror image, which nothing could tell
any more. Only whoever knows which way round the heading counts can tell.
"""

from collections.abc import Sequence
from typing import NamedTuple

from auvid_cli.data.check import Check

_Key = tuple[str, str]


class _Turn(NamedTuple):
    """Verdicts on one axis.

    Attributes
    ----------
    agreement : tuple of str
        Those on rate against angle, of which the first that was reached counts.
    answer : (str, str)
        That on the answer to the fin.
    witnesses : tuple of (str, str)
        Those that have the direction from the motion otherwise.
    symbols, positive : str
        What is turned where both contradict, and which way round is right.
    hangs_on_it : tuple of str
        Other verdicts for which the rate or the angle is needed.
    """

    agreement: tuple[str, ...]
    answer: _Key
    witnesses: tuple[_Key, ...]
    symbols: str
    positive: str
    hangs_on_it: tuple[str, ...] = ()


_FINS = "delay", "rudder and elevator"
_LASTING = tuple(f"errors that last in {rate}" for rate in "pqr")
_TURNS = (
    _Turn(("p against phi",), ("roll_moment", "response of p"), (), "phi (and p)", "starboard side down", _LASTING),
    _Turn(
        ("q against theta",),
        ("elevator", "response of q"),
        (("depth", "depth against pitch and u"), ("dvl", "w in a turn")),
        "theta (and q)",
        "nose up",
        ("w in a turn", *_FINS, *_LASTING),
    ),
    _Turn(
        ("r against psi", "r against heading"),
        ("rudder", "response of r"),
        (("dvl", "v in a turn"),),
        "psi (and r)",
        "clockwise from above; headings of ENU count the other way",
        (
            *("v in a turn", "v against accelerometer", "lever arm", "current", "heading offset", "response of u"),
            *("bias instability of r", "trim", *_FINS, *_LASTING),
        ),
    ),
)


def weighted_evidence(checks: Sequence[Check]) -> list[Check]:
    """Return verdicts with nothing called true or false by a rate and an angle that disagree, nor advice to mirror."""
    verdicts = {(check.subject, check.check): check for check in checks}
    for turn in _TURNS:
        agreements = [check for name in turn.agreement for check in checks if check.check == name]
        told = [check for check in agreements if check.passed is not None]
        if told and told[0].passed is False:
            for key, check in verdicts.items():
                if check.check in (turn.answer[1], *turn.hangs_on_it) and check.passed is not None:
                    verdicts[key] = _in_doubt(check, told[0].check)
        elif (answer := verdicts.get(turn.answer)) is not None:
            verdicts |= _blamed(turn, answer, verdicts)
    return list(verdicts.values())


def _in_doubt(check: Check, disagreement: str) -> Check:
    statistic = f"cannot tell while {disagreement} fails: {check.statistic}"
    return check._replace(passed=None, statistic=statistic, advice=f"First mend {disagreement}.")


def _blamed(turn: _Turn, answer: Check, verdicts: dict[_Key, Check]) -> dict[_Key, Check]:
    """Say which sign is turned where a fin, or what witnesses the turn, contradicts the attitude."""
    against = [check for key in turn.witnesses if (check := verdicts.get(key)) is not None and check.passed is False]
    if answer.passed is False and against:
        words = (
            f"{answer.check} and {' and '.join(check.check for check in against)} both contradict {turn.symbols}: turn "
            f"the sign of that ({turn.positive}), which one mistake explains, and not of the others. But first make "
            "sure that it counts the other way: if it does not, all others are turned, and turning it makes the data "
            "those of a mirror image of the vehicle, which nothing tells any more."
        )
        return {(check.subject, check.check): check._replace(advice=words) for check in (answer, *against)}
    words = (
        f" But first make sure of {turn.symbols} ({turn.positive}): if that is turned as well, this makes the data "
        "those of a mirror image of the vehicle, which nothing tells any more."
    )
    failed = [check for check in (answer, *against) if check.passed is False]
    return {(check.subject, check.check): check._replace(advice=check.advice + words) for check in failed}
