"""Judgements and checks that several estimates share, as lines of text."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from auvid_cli.config.enums import JUDGE
from auvid_cli.data.checks import Check
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.report.table import filter_label
from auvid_cli.text import sentence

_COUNTED = {False: "failed", None: "noted"}


def judgement_sentences(judgements: Mapping[str, Judgement], with_sound: bool) -> list[str]:
    """Say what filters are worth, what stands against them and what to do, all with the same in one sentence.

    Parameters
    ----------
    judgements : mapping of Judgement
        By filter.
    with_sound : bool
        Whether those that are sound are named as well.
    """
    labels: dict[Judgement, list[str]] = {}
    for name, judgement in judgements.items():
        if with_sound or judgement.grade is not Grade.SOUND:
            labels.setdefault(judgement, []).append(filter_label(name))
    return [sentence(f"{', '.join(of_same)} {judgement}") for judgement, of_same in labels.items()]


def contradiction_sentences(checks: Iterable[Check]) -> list[str]:
    """Say of verdicts on an accelerometer that nothing listened to that it contradicts what was used."""
    found = ", ".join(f"{check.check}: {check.statistic}" for check in checks)
    said = "the accelerometer, which was not used, contradicts the DVL ({}): see `auvid inspect` before it is used"
    return [sentence(said.format(found))] if found else []


class SharedCheck(NamedTuple):
    """What did not pass, and of whom.

    Attributes
    ----------
    check : Check
        That of the estimate that judges the others, if it is among them, else of the first.
    """

    check: Check
    filters: tuple[str, ...]


class Advice(NamedTuple):
    """What to do about verdicts of which the cause is the same.

    Attributes
    ----------
    shared : tuple of SharedCheck
        All failed or all worth knowing, of the same estimates.
    """

    shared: tuple[SharedCheck, ...]
    text: str

    @property
    def failed(self) -> bool:
        """Say whether it is against the estimates."""
        return self.shared[0].check.passed is False

    @property
    def filters(self) -> tuple[str, ...]:
        """Return whose it is."""
        return self.shared[0].filters

    @property
    def what(self) -> str:
        """Name the verdicts."""
        names: dict[str, list[str]] = {}
        for each in self.shared:
            names.setdefault(each.check.subject, []).append(each.check.check)
        return joined_words([f"{subject} ({', '.join(checks)})" for subject, checks in names.items()])


def shared_checks(checks: Iterable[Check]) -> list[SharedCheck]:
    """Return what did not pass, failures first, each once for all estimates of which the same is to be said."""
    alike: dict[tuple[str, str, bool | None, str], list[Check]] = {}
    for check in checks:
        if not check.passed:
            alike.setdefault((check.subject, check.check, check.passed, check.advice), []).append(check)
    shared = [
        SharedCheck(
            next((each for each in group if each.filter == JUDGE), group[0]), tuple(each.filter for each in group)
        )
        for group in alike.values()
    ]
    return sorted(shared, key=lambda each: each.check.passed is None)


def advices(shared: Iterable[SharedCheck]) -> list[Advice]:
    """Return what to do, each once for all verdicts that it explains."""
    alike: dict[tuple[str, bool | None, tuple[str, ...]], list[SharedCheck]] = {}
    for each in shared:
        alike.setdefault((each.check.advice, each.check.passed, each.filters), []).append(each)
    return [Advice(tuple(group), text) for (text, _, _), group in alike.items()]


def counts_in_words(checks: Sequence[Check]) -> list[str]:
    """Say how many verdicts passed, those of estimates of which as many did in one sentence without its full stop."""
    labels: dict[str, list[str]] = {}
    for name in dict.fromkeys(check.filter for check in checks):
        verdicts = [check.passed for check in checks if check.filter == name]
        counts = Counter(verdicts)
        others = "".join(f", {counts[passed]} {said}" for passed, said in _COUNTED.items() if counts[passed])
        labels.setdefault(f"{counts[True]} of {len(verdicts)} passed{others}", []).append(name)
    return [f"{whose(names)}: {counted}" for counted, names in labels.items()]


def whose(filters: Collection[str], among: Collection[str] = ()) -> str:
    """Name estimates, or the data where no estimate is judged; all of several as that."""
    if len(filters) == len(among) > 1:
        return "all"
    return ", ".join(filter_label(name) if name else "data" for name in filters)


def joined_words(words: Sequence[str]) -> str:
    """Write words as a sentence lists them: ``a, b and c``."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
