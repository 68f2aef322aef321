"""Completions of the shell command for bash and zsh, made from its parsers."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from .arguments import batch_parser, parser

__all__ = ["SHELLS", "completion_script"]

SHELLS = ("bash", "zsh")

# zsh reads the functions of bash.
_ZSH = "autoload -U +X bashcompinit && bashcompinit\n"

_SCRIPT = """\
_remeshvec() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}"
    local flags="{flags}" words=""
    if [[ "${{COMP_WORDS[1]}}" == batch ]]; then
        flags="{batch_flags}"
    elif [[ $COMP_CWORD == 1 ]]; then
        words="batch"
    fi
    case "$before" in
{choices}
        {values}) words="" flags="" ;;
    esac
    [[ "$word" == -* ]] && words="$flags"
    COMPREPLY=( $(compgen -W "$words" -- "$word") )
}}
complete -o default -F _remeshvec remeshvec
"""


def completion_script(shell: str) -> str:
    """Return a script that a shell reads: flags, the words that flags take, and files elsewhere.

    Parameters
    ----------
    shell : {"bash", "zsh"}
    """
    flags, batch_flags = list(_flags(parser())), list(_flags(batch_parser()))
    either = dict([*flags, *batch_flags])
    takes_words = {flag: action.choices for flag, action in either.items() if action.choices}
    takes_numbers = [
        flag for flag, action in either.items() if action.type is not None and not action.choices
    ]
    choices = "\n".join(
        f'        {flag}) words="{" ".join(map(str, words))}" flags="" ;;'
        for flag, words in takes_words.items()
    )
    script = _SCRIPT.format(
        flags=" ".join(flag for flag, _ in flags),
        batch_flags=" ".join(flag for flag, _ in batch_flags),
        choices=choices,
        values="|".join(takes_numbers),
    )
    return (_ZSH if shell == "zsh" else "") + script


def _flags(of: argparse.ArgumentParser) -> Iterable[tuple[str, argparse.Action]]:
    """Yield every long flag with what it does."""
    for action in of._actions:
        for flag in action.option_strings:
            if flag.startswith("--"):
                yield flag, action
