"""Completions in the shells themselves."""

import shutil
import subprocess

import pytest

from remeshvec.cli.arguments import parser
from remeshvec.cli.command import main
from remeshvec.cli.completions import completion_script


def completed(line, tmp_path):
    """Complete the last word of a line in bash; returns the proposals."""
    words = " ".join(f"'{word}'" for word in line.split(" "))
    script = (
        completion_script("bash")
        + f"COMP_WORDS=({words}); COMP_CWORD=$(({len(line.split(' '))} - 1)); _remeshvec\n"
        + 'printf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    done = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize(
    ("line", "proposals"),
    [
        ("remeshvec a.obj --preset ", ["default", "even", "fast", "fine"]),
        ("remeshvec a.obj --preset fi", ["fine"]),
        ("remeshvec a.obj --len", ["--length", "--lengths"]),
        ("remeshvec b", ["batch"]),
        ("remeshvec batch x --tab", ["--table"]),
        ("remeshvec a.obj --tab", []),
        ("remeshvec a.obj --length ", []),
    ],
)
def test_bash_completes(line, proposals, tmp_path):
    assert completed(line, tmp_path) == proposals


@pytest.mark.skipif(shutil.which("zsh") is None, reason="needs zsh")
def test_zsh_reads_the_script():
    script = "autoload -U compinit && compinit -D\n" + completion_script("zsh")
    subprocess.run(["zsh", "-c", script], check=True, capture_output=True)


def test_the_command_prints_them(capsys):
    assert main(["completions", "bash"]) == 0
    shown = capsys.readouterr().out
    assert shown == completion_script("bash")
    for action in parser()._actions:
        assert all(flag in shown for flag in action.option_strings if flag.startswith("--"))
    assert main(["completions", "zsh"]) == 0
    assert capsys.readouterr().out.endswith(shown)
    for words in (["completions"], ["completions", "fish"], ["completions", "bash", "zsh"]):
        assert main(words) == 2
        assert "bash or zsh" in capsys.readouterr().err
