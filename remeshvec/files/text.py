"""Text formats: lines, and the numbers in them, parsed in blocks.

A block of lines is parsed at once if every word in it is a number. Otherwise its lines are parsed one by
one, to find the line to refuse, or to ignore words such as those after the coordinates of a vertex in an
OBJ file.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import FloatArray, IntArray

__all__ = [
    "check_room",
    "floats",
    "integers",
    "number_table",
    "points",
    "polygons",
    "shown",
    "text_lines",
    "word_counts",
]

# Python's float also reads "nan", "inf" and "1_0"; with only these characters it reads only numbers.
_FLOAT_CHARACTERS = b"0123456789+-.eE \t\n"
_INTEGER_CHARACTERS = b"0123456789- \t\n"
_EXACT = 1 << 53  # up to here float64 represents every integer
_INDEX = re.compile(rb"\d{1,9}")
_COMMENT = re.compile(rb"#[^\r\n]*")
_CONTINUED = re.compile(rb"\\[ \t]*(?:\r\n?|\n)")


def text_lines(data: bytes, continued: bool = False) -> list[bytes]:
    """Return the lines of a text in any 8-bit encoding, without comments and blank lines.

    Only carriage returns and line feeds end a line: form feeds and Unicode's separators may be part of a
    name, whose rest must not become a statement. With ``continued``, a backslash at the end joins a line
    to the next, but not in a comment, which may end with the name of a folder.
    """
    if b"\0" in data:
        raise ValueError("it holds binary data or UTF-16 where text is expected")
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"#" in data:
        data = _COMMENT.sub(b"", data)
    if continued and b"\\" in data:
        data = _CONTINUED.sub(b" ", data)
    return [line for line in map(bytes.strip, data.splitlines()) if line]


def check_room(needed: int, available: int, unit: str) -> None:
    """Refuse a header that promises more than the file holds."""
    if needed > available:
        raise ValueError(
            f"the header promises at least {needed:,} {unit}, but only {available:,} follow: "
            "the file is cut short, or the header is wrong"
        )


def shown(line: bytes) -> str:
    """Return a line for a message, shortened and in printable characters."""
    text = line[:60].decode("ascii", "replace").replace("�", "?")
    return repr(text + ("..." if len(line) > 60 else ""))


def floats(text: bytes) -> FloatArray | None:
    """Return the numbers of a text; None if a word is not a number."""
    if text.translate(None, _FLOAT_CHARACTERS):
        return None
    try:
        return np.fromiter(map(float, text.split()), np.float64)
    except ValueError:
        return None


def integers(text: bytes) -> IntArray | None:
    """Return the integers of a text, clipped to 64 bits; None if a word is not an integer."""
    if text.translate(None, _INTEGER_CHARACTERS) or not _signs_are_in_place(text):
        return None
    if not text.strip():
        return np.empty(0, np.int64)
    return np.fromstring(text, dtype=np.int64, sep=" ")  # 6 times faster than int on every word


def _signs_are_in_place(text: bytes) -> bool:
    """Tell whether every minus begins a number in a text of digits, minuses and blanks."""
    if b"-" not in text:
        return True
    characters = np.frombuffer(b" " + text + b" ", np.uint8)
    at = np.flatnonzero(characters == ord("-"))
    return bool((characters[at - 1] <= ord(" ")).all() and (characters[at + 1] >= ord("0")).all())


def word_counts(text: bytes) -> IntArray:
    """Return the number of words in every line of a text."""
    characters = np.frombuffer(text + b"\n", np.uint8)
    starts = characters > ord(" ")
    starts[1:] &= characters[:-1] <= ord(" ")
    ends = np.flatnonzero(characters == ord("\n"))
    return np.diff(np.searchsorted(np.flatnonzero(starts), ends), prepend=0)


def number_table(lines: Sequence[bytes]) -> NDArray[Any] | None:
    """Return the numbers of lines, one row per line; None unless all lines hold equally many.

    Returns
    -------
    (n, k) int64 or float64
        Integers if all numbers are integers, because these are parsed 6 times faster.
    """
    text = b"\n".join(lines)
    numbers: NDArray[Any] | None = None if b"-0" in text else integers(text)  # integers have no -0
    if numbers is None or not -_EXACT < numbers.min(initial=0) <= numbers.max(initial=0) < _EXACT:
        numbers = floats(text)
    if numbers is None or not lines:
        return None
    counts = word_counts(text)
    return numbers.reshape(len(lines), -1) if (counts == counts[0]).all() else None


def points(lines: Sequence[bytes], keyword: bytes = b"") -> FloatArray:
    """Return the numbers of lines that begin with three coordinates.

    Parameters
    ----------
    lines : sequence of bytes
    keyword : bytes
        Removed from the front of every line; used in the message.

    Returns
    -------
    (n, k) float64
        All numbers if all lines hold ``k`` of them; otherwise only the coordinates.
    """
    table = number_table(lines)
    if table is None or table.shape[1] < 3 or not np.isfinite(table[:, :3]).all():
        table = np.array([_point(line, keyword) for line in lines], np.float64).reshape(-1, 3)
    return table.astype(np.float64, copy=False)


def _point(line: bytes, keyword: bytes) -> FloatArray:
    numbers = floats(b" ".join(line.split()[:3]))
    if numbers is None or len(numbers) < 3 or not np.isfinite(numbers).all():
        raise ValueError(f"{shown(keyword + line)} is not a point: three finite numbers are needed")
    return numbers


def polygons(lines: Sequence[bytes]) -> tuple[IntArray, IntArray]:
    """Return corners and sizes of faces; each line holds a number of corners and as many indices.

    Anything after the indices, such as colours, is ignored.
    """
    text = b"\n".join(lines)
    numbers, counts = integers(text), word_counts(text)
    if numbers is not None and len(lines):
        at = np.cumsum(counts) - counts
        sizes = numbers[at]
        if (sizes == counts - 1).all() and sizes.min() >= 3 and numbers.min() >= 0:
            return np.delete(numbers, at), sizes
    faces = [_polygon(line) for line in lines]
    corners = [corner for face in faces for corner in face]
    return np.array(corners, np.int64), np.array([len(face) for face in faces], np.int64)


def _polygon(line: bytes) -> list[int]:
    size, *corners = line.split()
    k = int(size) if _INDEX.fullmatch(size) else -1
    if k < 3 or len(corners) < k:
        raise ValueError(f"{shown(line)} is not a face: a number of corners (3 or more), indices")
    if not all(map(_INDEX.fullmatch, corners[:k])):
        raise ValueError(f"{shown(line)} has an index that is not a number from 0 to 999,999,999")
    return [int(corner) for corner in corners[:k]]
