"""One verdict."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class Check(NamedTuple):
    """A row of ``checks.csv``.

    Attributes
    ----------
    filter : str
    subject : str
        A sensor, an input, or "coefficients".
    check : str
        What is looked at.
    statistic, threshold : str
        What came out, and what it may be.
    passed : bool or None
        None where it did not pass but is only worth knowing.
    advice : str
        What to do; empty where it passed.
    """

    filter: str
    subject: str
    check: str
    statistic: str
    threshold: str
    passed: bool | None
    advice: str

    @classmethod
    def of(
        cls,
        filter_name: str,
        subject: str,
        check: str,
        statistic: str,
        threshold: str,
        passed: bool | None,
        advice: str,
    ) -> "Check":
        """A verdict that gives advice only where it is needed."""
        return cls(filter_name, subject, check, statistic, threshold, passed, "" if passed else advice)

    @classmethod
    def of_largest(
        cls,
        filter_name: str,
        subject: str,
        check: str,
        values: Mapping[str, float],
        limit: float,
        meaning: str,
        advice: str,
        fails: bool = True,
    ) -> "Check":
        """A verdict on named numbers of which none may exceed a limit; names those that do, largest first."""
        beyond = sorted((name for name, value in values.items() if not value <= limit), key=lambda name: -values[name])
        largest = max(values, key=lambda name: values[name])
        statistic = ", ".join(f"{name} {values[name]:.3g}" for name in beyond or [largest])
        passed = True if not beyond else False if fails else None
        return cls.of(filter_name, subject, check, statistic, f"<= {limit:.3g} {meaning}", passed, advice)

    @classmethod
    def of_smallest(
        cls,
        filter_name: str,
        subject: str,
        check: str,
        values: Mapping[str, float],
        limit: float,
        meaning: str,
        advice: str,
    ) -> "Check":
        """A verdict on named numbers of which none may be below a limit; names those that are, smallest first."""
        below = sorted((name for name, value in values.items() if not value >= limit), key=lambda name: values[name])
        smallest = min(values, key=lambda name: values[name])
        statistic = ", ".join(f"{name} {values[name]:.3g}" for name in below or [smallest])
        return cls.of(filter_name, subject, check, statistic, f">= {limit:.3g} {meaning}", not below, advice)

    @classmethod
    def of_names(
        cls, filter_name: str, check: str, names: Sequence[str], threshold: str, advice: str, fails: bool = True
    ) -> "Check":
        """A verdict that passes if no name is on a list."""
        passed = True if not names else False if fails else None
        return cls.of(filter_name, "coefficients", check, ", ".join(names) or "none", threshold, passed, advice)
