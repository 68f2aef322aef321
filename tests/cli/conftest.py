from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers import zoo

import remeshvec
from remeshvec import write_mesh
from remeshvec.cli import batch_command as _batch_command


@pytest.fixture
def asked(monkeypatch):
    """Note what the command asks of the library, which answers as ever."""
    seen, real = [], remeshvec.remesh

    def note(V, F, L=None, **options):
        seen.append({"L": L} | options)
        return real(V, F, L, **options)

    monkeypatch.setattr("remeshvec.remesh", note)
    return seen


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Six meshes in two folders, two of the same name."""
    monkeypatch.chdir(tmp_path)
    for k, name in enumerate(
        ["a/x.obj", "a/y.obj", "b/x.obj", "b/c/z.ply", "b/c/v.off", "b/u.obj"]
    ):
        path = Path("in", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        V, F = zoo.grid(6 + k, 6)
        write_mesh(path, V + 0.2 * np.sin(3 * V[:, ::-1]), F)
    return tmp_path


@pytest.fixture
def calls(monkeypatch):
    """Note which files are remeshed, in this process."""
    seen, real = [], _batch_command._remesh_file

    def note(job, options):
        seen.append(job.output)
        return real(job, options)

    monkeypatch.setattr(_batch_command, "_remesh_file", note)
    return seen
