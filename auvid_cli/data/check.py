"""Verdicts."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from auvid_cli.data.named_rows import NamedRows

if TYPE_CHECKING:
    import pandas as pd


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
        *,
        statistic: str,
        threshold: str,
        passed: bool | None,
        advice: str,
    ) -> "Check":
        """Make a verdict that gives advice only where it is needed."""
        return cls(filter_name, subject, check, statistic, threshold, passed, "" if passed else advice)

    @classmethod
    def of_values(
        cls,
        filter_name: str,
        subject: str,
        check: str,
        values: Mapping[str, float],
        *,
        limit: float,
        unit: str = "",
        meaning: str,
        advice: str,
        fails: bool = True,
        is_least: bool = False,
    ) -> "Check":
        """Judge named numbers, none of which may be beyond a limit; those that are stand there, the farthest first."""
        sign = -1.0 if is_least else 1.0
        ordered = sorted(values, key=lambda name: -sign * values[name])
        beyond = [name for name in ordered if not sign * values[name] <= sign * limit]
        statistic = ", ".join(f"{name} {values[name]:.3g} {unit}".rstrip() for name in beyond or ordered[:1])
        threshold = " ".join(filter(None, (">=" if is_least else "<=", f"{limit:.3g}", unit, meaning)))
        passed = True if not beyond else False if fails else None
        return cls.of(
            filter_name, subject, check, statistic=statistic, threshold=threshold, passed=passed, advice=advice
        )

    @classmethod
    def of_names(
        cls, filter_name: str, check: str, names: Sequence[str], *, threshold: str, advice: str, fails: bool = True
    ) -> "Check":
        """Make a verdict that passes if no name is on a list."""
        passed = True if not names else False if fails else None
        return cls.of(
            filter_name,
            "coefficients",
            check,
            statistic=", ".join(names) or "none",
            threshold=threshold,
            passed=passed,
            advice=advice,
        )


class Checks(list[Check]):
    """Verdicts in the order in which they are reached."""

    def failed(self) -> list[Check]:
        """Return those that did not pass."""
        return [check for check in self if check.passed is False]

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each verdict and the fields of `Check` as columns.

        ``passed`` is missing of what is only worth knowing.
        """
        return self.rows().to_pandas()

    def rows(self) -> NamedRows:
        """Return the rows of ``checks.csv``."""
        return NamedRows(Check._fields, self)
