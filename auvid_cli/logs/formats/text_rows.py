"""The rows of a text log, counted and checked before they are read: pandas fills up short rows without a word."""

import codecs
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.errors import FileError
from auvid_cli.logs.formats.text_layout import BLANKS, COMMENT_MARKS, Header, is_filler, split_row

_BLOCK_BYTES = 1 << 24
_LONGEST_LINE = 1 << 26
_WHITE = np.frombuffer(b" \t\r\n", np.uint8)


class TextRows(NamedTuple):
    """What is known of all rows of a text log.

    Attributes
    ----------
    lines : int
        Of the log.
    filler : frozenset of int
        Lines after the header that hold no values, counted from 1.
    encoding : str
    """

    lines: int
    filler: frozenset[int]
    encoding: str

    def numbers(self, header: Header) -> NDArray[np.int64]:
        """Return the lines that hold values, counted from 1."""
        return np.setdiff1d(np.arange(header.line + 1, self.lines + 1), list(self.filler))


def survey(path: Path, file: IO[bytes], header: Header) -> TextRows:
    """Count the rows, find the lines to leave out, and check that every row has its fields.

    Parameters
    ----------
    path : pathlib.Path
        Of the log, to be named in errors.
    file : binary file
        The log from its beginning.
    header : Header

    Raises
    ------
    FileError
        If a row has fields too many or too few, or zero bytes where power went off.
    """
    lines = 0
    filler: set[int] = set()
    utf8 = codecs.getincrementaldecoder("utf-8")()
    encoding = "utf-8"
    for block in _whole_lines(path, file):
        encoding = encoding if encoding == "latin-1" or _decodes(utf8, block) else "latin-1"
        data = np.frombuffer(block, np.uint8)
        ends = np.flatnonzero(data == ord("\n"))
        starts = np.concatenate(([0], ends[:-1] + 1))
        if (zero := block.find(0)) >= 0:
            number = lines + int(np.searchsorted(ends, zero)) + 1
            raise FileError(f"{path}:{number}: zero bytes, as after a power cut: delete this row and what follows it")
        fields = _count_fields(data, ends, header.delimiter)
        suspects = (fields != header.fields) | _may_be_filler(data[starts], header.delimiter)
        for k in np.flatnonzero(suspects):
            number = lines + int(k) + 1
            if number <= header.line:
                continue
            line = block[starts[k] : ends[k]].decode(encoding, errors="replace")
            if is_filler(line, header.delimiter):
                filler.add(number)
            elif (n_fields := len(split_row(line, header.delimiter))) != header.fields:
                raise FileError(f"{path}:{number}: a row of {n_fields} fields where the others have {header.fields}")
        lines += len(ends)
    return TextRows(lines, frozenset(filler), encoding)


def _whole_lines(path: Path, file: IO[bytes]) -> Iterator[bytes]:
    """Yield blocks of whole lines, each ended by a line feed."""
    rest = b""
    while block := file.read(_BLOCK_BYTES):
        whole, feed, rest = (rest + block).rpartition(b"\n")
        if feed:
            yield whole + feed
        elif len(rest) > _LONGEST_LINE:
            raise FileError(f"{path}: has a line of more than {_LONGEST_LINE >> 20} MB, and is no table")
    if rest:
        yield rest + b"\n"


def _decodes(decoder: codecs.IncrementalDecoder, block: bytes) -> bool:
    if block.isascii():
        return True
    try:
        decoder.decode(block)
    except UnicodeDecodeError:
        return False
    return True


def _count_fields(data: NDArray[np.uint8], ends: NDArray[np.int64], delimiter: str) -> NDArray[np.int64]:
    """Count the fields of each line, as if none were quoted."""
    if delimiter == BLANKS:
        blank = np.isin(data, _WHITE)
        marks = np.flatnonzero(~blank & np.concatenate(([True], blank[:-1])))
        return np.diff(np.searchsorted(marks, ends), prepend=0)
    marks = np.flatnonzero(data == ord(delimiter))
    return np.diff(np.searchsorted(marks, ends), prepend=0) + 1


def _may_be_filler(first: NDArray[np.uint8], delimiter: str) -> NDArray[np.bool_]:
    """Say whether lines begin like filler, by their first bytes."""
    signs = "".join(mark[0] for mark in COMMENT_MARKS) + delimiter + ' \t\r\n"'
    return np.isin(first, np.frombuffer(signs.encode(), np.uint8))
