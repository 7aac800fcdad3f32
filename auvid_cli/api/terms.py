"""Terms that a model lacks."""

from collections.abc import Callable

from auvid_cli.api.argument_types import typed
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.term_findings import TermFindings
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.term_search import search_terms


@typed
def find_terms(
    dataset: Dataset,
    any_symmetry: bool = False,
    most: int = 4,
    say: Callable[[str], None] | None = None,
) -> TermFindings:
    """Find terms of the equations of motion that the model of a dataset lacks.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not looked at. The last third is held out.
    any_symmetry : bool, default False
        Whether terms are looked for, too, that a vehicle has only if port and starboard differ.
    most : int, default 4
        How many terms are tried, each in a model of its own.
    say : callable, optional
        Called with what is being done; what it raises ends the search.

    Returns
    -------
    TermFindings
        ``found``, the terms that make held-out data likelier; ``experiment``, with these to be estimated;
        ``to_pandas()`` makes a table of all that were looked at.

    Raises
    ------
    ConfigError
        If a coefficient that is to be held has no value.
    DataError
        If no sensor can be used, or the smoother does not settle.

    Examples
    --------
    >>> findings = auvid.find_terms(dataset, most=1)
    >>> len(findings.found)
    0
    """
    return search_terms(prepare(dataset), any_symmetry, most, say or (lambda text: None))
