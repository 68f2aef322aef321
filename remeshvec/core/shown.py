"""How records show themselves: one line for a prompt, a small table for a notebook."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

__all__ = ["given_fields", "html_table", "one_line"]

_MOST = 60  # characters of one value


def one_line(kind: str, *facts: str) -> str:
    """Return ``<Kind: fact, fact>``, leaving out empty facts."""
    return f"<{kind}: {', '.join(fact for fact in facts if fact)}>"


def given_fields(values: dict[str, Any]) -> list[str]:
    """Return ``name=value`` for each, arrays by their shape."""
    return [f"{name}={_short(value)}" for name, value in values.items()]


def _short(value: Any) -> str:
    shape = getattr(value, "shape", None)
    if shape is None and isinstance(value, list | tuple) and len(value) > 4:
        shape = np.shape(value) if len({np.shape(row) for row in value}) == 1 else (len(value),)
    if shape:
        return f"<array {' x '.join(map(str, shape))}>"
    line = " ".join(repr(value).split())
    return line if len(line) <= _MOST else line[: _MOST - 3] + "..."


def html_table(
    rows: Iterable[Sequence[str]], heading: Sequence[str] = (), caption: str = ""
) -> str:
    """Return rows of texts as a table in HTML; all but the first column are numbers."""
    lines = ["<table>", *([f"<caption>{html.escape(caption)}</caption>"] if caption else [])]
    lines += [_row(heading, "th")] if heading else []
    lines += [_row(row, "td") for row in rows]
    return "\n".join([*lines, "</table>"])


def _row(cells: Sequence[str], tag: str) -> str:
    first, *numbers = (html.escape(cell) for cell in cells)
    right = "".join(f'<{tag} style="text-align: right">{cell}</{tag}>' for cell in numbers)
    return f'<tr><{tag} style="text-align: left">{first}</{tag}>{right}</tr>'
