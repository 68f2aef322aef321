"""Surface Evolver [Brakke 1992] as a backend: datafiles, dumps, and runs of the real program.

Written for version 2.70. The program runs as a subprocess with a scratch directory as its home, a script
of commands, and a time limit.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Literal

import numpy as np

from ..core.arguments import choice, count, function, number, text
from ..core.arguments import path as as_path
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..errors import MeshFormatError, OptionError
from ..files.disk import reason, write_file
from ..mesh.edges import halfedge_ends
from .errors import EvolverError
from .minimize import Minimum, StepCallback, measured
from .problem import CapillaryProblem, as_problem, with_surface
from .steps import with_restored_volumes

__all__ = ["EvolverBackend", "read_dump", "write_fe"]

# Default number of steps.
_EVOLVER_STEPS = {"flow": 10, "newton": 8}

# Gradient steps before Newton steps are tried, and gradient steps per step of the flow.
_WARM_UP, _GRADIENT_STEPS = 5, 20

_SECTION = re.compile(r"^(vertices|edges|faces|facets|bodies|read)\b", re.IGNORECASE | re.MULTILINE)
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)


# --- files ---------------------------------------------------------------------------------------


def write_fe(path: str | Path, problem: CapillaryProblem) -> Path:
    """Write a problem as a datafile of Surface Evolver.

    Fixed vertices and wires are marked ``fixed``. A body lists its faces, the prescribed volume, the
    offset as its ``volconst``, and the density. The gravity constant is always written, since its default
    is 1. With ``symmetric_content``, the volume of a surface that is not closed means the same as here.

    Parameters
    ----------
    path : str or path
    problem : CapillaryProblem

    Raises
    ------
    MeshFormatError
        The file cannot be written.
    OptionError
        Gravity is not along the z axis, as Surface Evolver requires.
    """
    as_problem(problem)
    file = Path(as_path(path, "path"))
    if problem.density and np.any(problem.gravity[:2]):
        raise OptionError("Surface Evolver knows gravity along z only; turn the problem")
    edges, of_face = _numbered_edges(problem.F)
    wires = {tuple(edge) for edge in np.sort(problem.fixed_edges, axis=1).tolist()}
    gravity = -float(problem.gravity[2]) if problem.density else 0.0
    lines = ["symmetric_content", f"gravity_constant {gravity!r}", "", "vertices"]
    for k, (point, held) in enumerate(zip(problem.V.tolist(), problem.fixed.tolist(), strict=True)):
        lines.append(f"{k + 1} {point[0]!r} {point[1]!r} {point[2]!r}{' fixed' * held}")
    lines += ["", "edges"]
    for k, (a, b) in enumerate(edges.tolist()):
        lines.append(f"{k + 1} {a + 1} {b + 1}{' fixed' * ((a, b) in wires)}")
    lines += ["", "faces"]
    for k, (a, b, c) in enumerate(of_face.tolist()):
        lines.append(f"{k + 1} {a} {b} {c} tension {problem.tension!r}")
    lines += ["", *_bodies(problem), "read", ""]
    write_file(file, "\n".join(lines).encode("ascii"))
    return file


def _bodies(problem: CapillaryProblem) -> list[str]:
    if not len(problem.targets) and not problem.density:
        return []
    lines = ["bodies"]
    for g in range(max(1, len(problem.targets))):
        faces = " ".join(str(f + 1) for f in np.flatnonzero(problem.body == g))
        # The offset belongs to the only body. With several bodies, it is unknown which one has it.
        offset = problem.volume_offset if len(problem.targets) < 2 else 0.0
        volume = f" volume {float(problem.targets[g]) + offset!r}" if len(problem.targets) else ""
        density = f" density {problem.density!r}" if problem.density else ""
        lines.append(f"{g + 1} {faces}{volume} volconst {offset!r}{density}")
    return [*lines, ""]


def _numbered_edges(F: IntArray) -> tuple[IntArray, IntArray]:
    """Edges (k, 2), and the numbers of the three edges of every face: from 1, negative if reversed."""
    start, end = halfedge_ends(F)
    edges, index = np.unique(np.sort([start, end], axis=0), axis=1, return_inverse=True)
    sign = np.where(start < end, 1, -1)
    return edges.T, ((index.ravel() + 1) * sign).reshape(-1, 3)


def read_dump(path: str | Path) -> tuple[FloatArray, IntArray, BoolArray]:
    """Read vertices, faces and fixed vertices from a dump, or from a datafile of plain triangles.

    Returns
    -------
    V : (n, 3) float64
        In the order of their numbers.
    F : (m, 3) int64
    fixed : (n,) bool

    Raises
    ------
    MeshFormatError
        The file cannot be read, lacks a section, or has faces that are not triangles.
    """
    file = Path(as_path(path, "path"))
    try:
        sections = _sections(file.read_text(encoding="latin-1"))
        vertices = _records(sections["vertices"])
        edges = {k: (int(row[0]), int(row[1])) for k, row in _records(sections["edges"]).items()}
        order = sorted(vertices)
        V = np.array([[float(x) for x in vertices[k][:3]] for k in order]).reshape(len(order), 3)
        F = _corners_of(_records(sections["faces"]), edges, {k: i for i, k in enumerate(order)})
    except OSError as error:
        raise MeshFormatError(f"cannot read {file}: {reason(error)}") from error
    except (KeyError, IndexError, ValueError) as error:
        raise MeshFormatError(f"{file}: not a datafile of Surface Evolver ({error!r})") from error
    if not np.isfinite(V).all():
        raise MeshFormatError(f"{file}: a vertex is NaN or infinite")
    return V, F, np.array(["fixed" in vertices[k] for k in order], np.bool_)


def _sections(text: str) -> dict[str, str]:
    """Text of every section, by its name."""
    parts = _SECTION.split(_COMMENT.sub(" ", text).replace("\\\n", " "))
    names = [name.lower().replace("facets", "faces") for name in parts[1::2]]
    return dict(zip(names, parts[2::2], strict=True))


def _corners_of(
    faces: dict[int, list[str]], edges: dict[int, tuple[int, int]], index: dict[int, int]
) -> IntArray:
    """Corners of every face: where its three edges start."""
    F = []
    for k in sorted(faces):
        numbers = [int(word) for word in faces[k][:3]]
        corners = [index[edges[abs(e)][0 if e > 0 else 1]] for e in numbers]
        if len(set(corners)) < 3 or _is_plain_number(faces[k][3:4]):
            raise ValueError(f"face {k} is not a triangle")
        F.append(corners)
    return np.array(F, np.int64).reshape(-1, 3)


def _records(section: str) -> dict[int, list[str]]:
    """Words of every line, by the number at its start."""
    rows = (line.split() for line in section.splitlines())
    return {int(row[0]): row[1:] for row in rows if row and row[0].isdigit()}


def _is_plain_number(words: list[str]) -> bool:
    return bool(words) and re.fullmatch(r"[-+]?\d+", words[0]) is not None


# --- the program ---------------------------------------------------------------------------------


class EvolverBackend:
    """Minimise with Surface Evolver; replaces the native solver in `evolve`.

    Called like `minimize`. "flow" is its gradient descent with an optimising scale (``g``). "newton" is
    its ``hessian`` after a step of scale 0, which restores volumes. Where the energy rises or Newton
    steps fail, gradient steps come before them or replace them.

    Parameters
    ----------
    executable : str
        Name or path of the program; Debian's package is ``evolver-nox``.
    timeout : float
        Time limit per run, in seconds.

    Raises
    ------
    EvolverError
        The program is not installed.
    """

    def __init__(self, executable: str | Path = "evolver", timeout: float = 120.0) -> None:
        name = as_path(executable, "executable")
        self.timeout = number(timeout, "timeout", above=0.0, unit="seconds")
        found = shutil.which(name)
        if found is None:
            raise EvolverError(
                f"{name} is not installed: apt install evolver-nox, or name its path"
            )
        self.executable = found

    def __call__(
        self,
        problem: CapillaryProblem,
        method: Literal["flow", "newton"] = "flow",
        *,
        tol: float = 1e-6,
        steps: int | None = None,
        callback: StepCallback | None = None,
    ) -> Minimum:
        """Minimise; see `minimize`. ``callback`` is called once, at the end."""
        as_problem(problem)
        tolerance = number(tol, "tol", above=0.0)
        choice(method, "method", tuple(_EVOLVER_STEPS))
        most = _EVOLVER_STEPS[method] if steps is None else count(steps, "steps")
        if callback is not None:
            function(callback, "callback")
        moved = self._lowered(problem, _scripts(method, most))
        result = measured(moved, tolerance, "all steps done")
        if callback is not None:
            callback(1, moved, result.energy, result.residual)
        return result

    def _lowered(self, problem: CapillaryProblem, scripts: list[str]) -> CapillaryProblem:
        """Run scripts until one does not raise the energy; the result of the last one is always taken."""
        before = with_restored_volumes(problem).energy()
        for script in scripts[:-1]:
            try:
                moved = with_surface(problem, self.run(problem, script))
            except EvolverError:
                continue
            if moved.energy() <= before + 1e-9 * abs(before):
                return moved
        return with_surface(problem, self.run(problem, scripts[-1]))

    def run(self, problem: CapillaryProblem, script: str) -> FloatArray:
        """Run commands on a problem; returns the vertices (n, 3).

        The commands must not change the triangles.

        Raises
        ------
        EvolverError
            The program failed, took too long or wrote no dump; the message ends with its last output.
        """
        V, F, _ = self.run_freely(problem, script)
        if len(V) != len(problem.V) or len(F) != len(problem.F):
            raise EvolverError("the commands changed the triangles")
        V[problem.fixed] = problem.V[problem.fixed]
        return V

    def run_freely(
        self, problem: CapillaryProblem, script: str
    ) -> tuple[FloatArray, IntArray, BoolArray]:
        """Run commands that may refine or remove triangles; returns V, F and fixed, as `read_dump`.

        Raises
        ------
        EvolverError
            As for `run`.
        """
        as_problem(problem)
        if not text(script, "script").isascii():
            raise OptionError(f"script must be ASCII; got {script!r}")
        with tempfile.TemporaryDirectory(prefix="remeshvec-") as folder:
            return read_dump(self._run_in(Path(folder), problem, script))

    def energy(self, problem: CapillaryProblem) -> float:
        """Return the energy that Surface Evolver computes for a surface as it is, offset included."""
        as_problem(problem)
        with tempfile.TemporaryDirectory(prefix="remeshvec-") as folder:
            self._run_in(Path(folder), problem, 'printf "%.17g\\n", total_energy >> "energy.txt";')
            text = (Path(folder) / "energy.txt").read_text(encoding="ascii")
        return float(text) + problem.energy_offset

    def _run_in(self, folder: Path, problem: CapillaryProblem, script: str) -> Path:
        write_fe(folder / "data.fe", problem)
        commands = folder / "commands"
        commands.write_text(f'{script}\ndump "out.dmp";\nq\nq\n', encoding="ascii")
        try:
            done = subprocess.run(
                [self.executable, "-x", "-f", "commands", "data.fe"],
                cwd=folder,
                env={**os.environ, "HOME": str(folder)},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=self.timeout,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise EvolverError(f"Surface Evolver took more than {self.timeout:g} s") from error
        said = "\n".join((done.stdout + done.stderr).splitlines()[-8:])
        if done.returncode:
            raise EvolverError(f"Surface Evolver failed (exit {done.returncode}):\n{said}")
        dump = folder / "out.dmp"
        if not dump.is_file():
            raise EvolverError(f"Surface Evolver wrote no dump:\n{said}")
        return dump


def _scripts(method: str, steps: int) -> list[str]:
    """Scripts to try in this order, until one does not raise the energy."""
    if method == "flow":
        return [f"g {_GRADIENT_STEPS * steps};"]
    # A step of scale 0 restores the volumes, which `hessian` expects.
    newton = "m 0; g;" + " hessian;" * steps
    return [newton, f"g {_WARM_UP}; {newton}", f"g {10 * _GRADIENT_STEPS};"]
