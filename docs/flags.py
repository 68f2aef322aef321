"""Write the table of flags into ``command-line.md``: ``python -m docs.flags``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.tables import table
from remeshvec.cli.arguments import batch_parser, parser

PAGE = Path(__file__).with_name("command-line.md")
HEADING = "## All flags\n"
BATCH = "## All flags of `remeshvec batch`\n"


def with_flags(text: str) -> str:
    """Return the page with everything below its heading of flags made anew."""
    before = text.partition(HEADING)[0]
    return f"{before}{HEADING}\n{_tables(parser())}\n\n{BATCH}\n{_tables(batch_parser())}\n"


def _tables(of: argparse.ArgumentParser) -> str:
    parts = []
    for group in of._action_groups:
        rows = [[_flag(a), _about(a)] for a in group._group_actions if a.option_strings]
        if rows:
            title = "general" if group.title in ("options", "optional arguments") else group.title
            parts.append(table([str(title), ""], rows, text_columns=2))
    return "\n\n".join(parts)


def _flag(action: argparse.Action) -> str:
    names = ", ".join(action.option_strings)
    if action.nargs == 0 or isinstance(action, argparse.BooleanOptionalAction):
        return f"`{names}`"
    values = "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.metavar
    return f"`{names} {values}`"


def _about(action: argparse.Action) -> str:
    about = (action.help or "").replace("%(default)s", str(action.default))
    return about[:1].upper() + about[1:] + "."


if __name__ == "__main__":
    PAGE.write_text(with_flags(PAGE.read_text("utf-8")), "utf-8")
    print(f"wrote {PAGE.name}", file=sys.stderr)
