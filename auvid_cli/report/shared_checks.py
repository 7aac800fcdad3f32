"""Verdicts on several estimates of the same data, told once where they share them."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

from auvid_cli.config.filter_name import JUDGE
from auvid_cli.data.check import Check
from auvid_cli.report.notation import filter_label

_COUNTED = {False: "failed", None: "noted"}


class SharedCheck(NamedTuple):
    """What did not pass, and of whom.

    Attributes
    ----------
    check : Check
        That of the estimate that judges the others, if it is among them, else of the first.
    filters : tuple of str
    """

    check: Check
    filters: tuple[str, ...]


class Advice(NamedTuple):
    """What to do about verdicts of which the cause is the same.

    Attributes
    ----------
    shared : tuple of SharedCheck
        All failed or all worth knowing, of the same estimates.
    text : str
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
