"""The parser of arguments: what is wrong is said in one line, with what was perhaps meant."""

from __future__ import annotations

import argparse
import difflib
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from ..input.options import OTHER_NAMES

__all__ = ["OneLineParser"]

_WRONG_CHOICE = re.compile(r"invalid choice: '(.*?)' \(choose from (.*)\)")


class OneLineParser(argparse.ArgumentParser):
    """Prints one line on the error stream where argparse prints the usage first."""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the words, after a look for flags that do not exist."""
        words = sys.argv[1:] if args is None else list(args)
        self._check_flags(words)
        return super().parse_args(words, namespace)

    def error(self, message: str) -> NoReturn:
        """Print the message and end the process with status 2."""
        wrong = _WRONG_CHOICE.search(message)
        if wrong:
            known = wrong[2].replace("'", "").split(", ")
            message += _did_you_mean(difflib.get_close_matches(wrong[1], known, 1))
        self.exit(2, f"{self.prog}: {message} ({self.prog} --help lists all arguments)\n")

    def _check_flags(self, words: Sequence[str]) -> None:
        """Refuse the first unknown flag, before argparse complains of what is missing because of it."""
        known = [name for name in self._option_string_actions if name.startswith("--")]
        for word in words:
            if word == "--":
                return
            flag = word.split("=")[0]
            if flag.startswith("--") and not any(name.startswith(flag) for name in known):
                self.error(f"there is no flag {flag}{_did_you_mean(_near(flag, known))}")


def _near(flag: str, known: list[str]) -> list[str]:
    """Return the flag that was meant, if there is one like it."""
    option = OTHER_NAMES.get(flag[2:].replace("-", "_"))
    meant = "--length" if option == "L" else f"--{str(option).replace('_', '-')}"
    if meant in known:
        return [meant]
    names = [name[2:] for name in known]
    return [f"--{name}" for name in difflib.get_close_matches(flag[2:], names, 1)]


def _did_you_mean(near: list[str]) -> str:
    return f"; did you mean {near[0]}?" if near else ""
