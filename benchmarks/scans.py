"""Scans: one command from a raw surface to an even one; ways to remove noise and to close holes.

``python -m benchmarks.scans`` writes docs/scans.md and the picture on it. pymeshfix and PyVista are
measured beside where they are installed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import igl
import numpy as np

from data.shapes.scans import ACCEPTANCE, mask_surface, scan
from remeshvec import denoise, quality, read_mesh, remesh, repair, smooth, write_mesh

from .bilateral import bilateral, face_normals
from .panels import FloatArray, IntArray
from .tables import DOCS, machine, machine_line, page, table, write_page

Mesh = tuple[FloatArray, IntArray]
FLAGS = "--keep-largest --fill-holes 100 --denoise 20 --up z"
SPREADS = (0.35, 0.6, 1.0)  # of bilateral filtering
CHILD = """
import json, resource, sys
from remeshvec.cli import main
status = main(sys.argv[1:])
print(json.dumps([status, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]), file=sys.stderr)
"""


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    arguments = parser.parse_args(argv)
    facts = machine()
    picture = arguments.output / "pictures" / "scan_command.jpg"
    run = _command(picture)
    write_page(arguments.output, "scans.md", _page(facts, run, _noise_table(), _hole_table()))


def _command(picture: Path) -> dict[str, Any]:
    """Run the command on the scan twice, and keep the second run, whose kernels are compiled."""
    V, F = scan()
    with tempfile.TemporaryDirectory(prefix="remeshvec-scan-") as folder:
        source, target = Path(folder, "scan.ply"), Path(folder, "clean.ply")
        write_mesh(source, V, F)
        words = [str(source), "-o", str(target), *FLAGS.split(), "--picture", str(picture)]
        for _ in range(2):
            start = perf_counter()
            done = subprocess.run(
                [sys.executable, "-c", CHILD, *words], capture_output=True, text=True, check=True
            )
            seconds = perf_counter() - start
        status, memory = json.loads(done.stderr.splitlines()[-1])
        assert status == 0
        after = quality(*read_mesh(target)[:2])
    said = next(line for line in done.stdout.splitlines() if line.startswith("note: repaired"))
    return {
        "before": quality(V, F), "after": after, "seconds": seconds, "memory": memory,
        "said": said.removeprefix("note: repaired: "),
    }  # fmt: skip


# --- noise ---------------------------------------------------------------------------------------


def _noise_table() -> str:
    rows = []
    for name, true, noisy in _noisy_meshes():
        for way, method in _WAYS.items():
            start = process_time()
            V = method(*noisy)
            seconds = process_time() - start
            rows.append([name, way, *_errors(true, (V, noisy[1])), f"{1e3 * seconds:.0f}"])
    head = ["mesh", "", "RMS, edges", "normals", "volume", "p1 of angles", "CPU ms"]
    return table(head, rows, text_columns=2)


_WAYS: dict[str, Callable[[FloatArray, IntArray], FloatArray]] = {
    "nothing": lambda V, F: V,
    "`denoise`, 10": lambda V, F: denoise(V, F, 10),
    "`denoise`, 20": lambda V, F: denoise(V, F, 20),
    "`denoise`, 40": lambda V, F: denoise(V, F, 40),
    **{
        f"bilateral, {spread}": lambda V, F, spread=spread: bilateral(V, F, spread)
        for spread in SPREADS
    },
    "`smooth`, 3 steps, volume kept": lambda V, F: smooth(V, F, iterations=3, keep_volume=True),
}


def _noisy_meshes() -> list[tuple[str, Mesh, Mesh]]:
    """Names, true surfaces and noisy meshes of them."""
    rng = np.random.default_rng(0)
    found = []
    for name, length in (("creature.obj", 0.02), ("bracket.obj", 1.5)):
        V, F = remesh(*read_mesh(Path("data", name))[:2], length)
        F = np.asarray(F, np.int64)
        for size in (0.15, 0.3):
            noisy = V + size * length * rng.normal(size=V.shape)
            found.append((f"{Path(name).stem}, {size} edges", (V, F), (noisy, F)))
    creature = read_mesh("data/creature.obj")[:2]
    body = repair(
        *scan(0.03, ACCEPTANCE._replace(islands=0, handles=0, holes=0)), keep_largest=True
    )
    found.append(("marching cubes, noise", creature, (body.V, body.F)))
    found.append(("marching cubes, mask", creature, mask_surface(0.03)))
    return found


def _errors(true: Mesh, found: Mesh) -> list[str]:
    V, F = found
    squares, face, _ = igl.point_mesh_squared_distance(V[F].mean(axis=1), *true)
    cosine = (face_normals(V, F)[0] * face_normals(*true)[0][face]).sum(axis=1)
    now, was = quality(V, F), quality(*true)
    turned = np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean()
    return [
        f"{np.sqrt(squares.mean()) / now.edge_mean:.3f}", f"{turned:.1f}",
        f"{100 * ((now.volume or 0) / (was.volume or 1) - 1):+.2f} %", f"{now.min_angle_p1:.1f}",
    ]  # fmt: skip


# --- holes ---------------------------------------------------------------------------------------


def _hole_table() -> str:
    V, F, open_ = _with_holes()
    fillers: dict[str, Callable[[], Mesh]] = {
        "`repair`": lambda: tuple(repair(V, open_, fill_holes="all")),  # type: ignore[return-value]
    }
    if find_spec("pymeshfix"):
        fillers["pymeshfix"] = lambda: _with_pymeshfix(V, open_, False)
        fillers["pymeshfix, refined"] = lambda: _with_pymeshfix(V, open_, True)
    if find_spec("pyvista"):
        fillers["PyVista"] = lambda: _with_pyvista(V, open_)
    rows = []
    for name, fill in fillers.items():
        fill()
        start = process_time()
        found = fill()
        seconds = process_time() - start
        q = quality(*found)
        away = igl.point_mesh_squared_distance(V, *found)[0].max() ** 0.5
        volume = "turned faces" if q.volume is None else f"{_share(q.volume, V, F):+.2f} %"
        even = quality(*remesh(*found))
        rows.append(
            [name, str(q.boundary_loops), volume, f"{away / q.edge_mean:.1f}",
             f"{even.min_angle_p1:.1f}", f"{1e3 * seconds:.0f}"]
        )  # fmt: skip
    head = ["", "holes left", "volume", "farthest, edges", "p1 after `remesh`", "CPU ms"]
    return table(head, rows)


def _share(volume: float, V: FloatArray, F: IntArray) -> float:
    return 100 * (volume / float(quality(V, F).volume or 1) - 1)


def _with_holes() -> tuple[FloatArray, IntArray, IntArray]:
    V, F = remesh(*read_mesh("data/creature.obj")[:2], 0.02)
    F = np.asarray(F, np.int64)
    places = np.random.default_rng(0).choice(len(V), 12, replace=False)
    away = np.linalg.norm(V[F].mean(axis=1)[:, None] - V[places], axis=2)
    return V, F, F[(away > 0.02 + 0.008 * np.arange(12)).all(axis=1)]


def _with_pymeshfix(V: FloatArray, F: IntArray, refine: bool) -> Mesh:
    from pymeshfix import PyTMesh

    mesh = PyTMesh()
    mesh.set_quiet(True)
    mesh.load_array(V, F.astype(np.int32))
    mesh.fill_small_boundaries(0, refine)
    points, faces = mesh.return_arrays()
    return np.asarray(points, float), np.asarray(faces, np.int64)


def _with_pyvista(V: FloatArray, F: IntArray) -> Mesh:
    import pyvista as pv

    closed = pv.PolyData.from_regular_faces(V, F).fill_holes(1e3).triangulate()
    return np.asarray(closed.points, float), np.asarray(closed.regular_faces, np.int64)


# --- the page ------------------------------------------------------------------------------------


NOISE = """Distance of the centres of faces to the true surface in mean edges, angle between normals in
degrees, change of the volume. `bilateral` filters normals as Zheng et al. (2011) do, with the spread of
normals given."""

CHOICE = """At heavy noise, and on marching cubes of noisy fields, the low-pass filter of `denoise` has
the better normals, and it alone makes faces rounder. On masks the two are alike. On a part with light
noise bilateral filtering keeps creases and is better, but only with the right spread, which the noise
decides: what is best in one row is among the worst in another. A filter without such a constant, ten
times as fast, is what the package has. The flow of `smooth` removes noise, and the shape with it."""

HOLES = """Twelve holes in a creature, with 303 edges in all. PyVista loses the winding of faces, and
takes a radius in place of a number of edges. pymeshfix is under the AGPL, writes to the terminal, and
keeps one component only in its usual call. So `repair` closes holes itself, with the bends of Liepa
(2003), and takes libigl for sheets that meet in an edge and SciPy for vertices that are close. Faces
that cross are for pymeshfix, before the call."""


def _page(facts: dict[str, str], run: dict[str, Any], noise: str, holes: str) -> str:
    before, after = run["before"], run["after"]
    assert after.is_closed and after.components == 1 and after.min_angle_p1 >= 40
    rows = [
        ["faces", f"{before.faces:,}", f"{after.faces:,}"],
        ["components", f"{before.components:,}", str(after.components)],
        ["boundary loops", str(before.boundary_loops), str(after.boundary_loops)],
        ["handles of the surface", "", str(1 - after.euler_number // 2)],
        [
            "smallest angle, 1st percentile",
            f"{before.min_angle_p1:.1f}",
            f"{after.min_angle_p1:.1f}",
        ],
        ["smallest angle", f"{before.min_angle:.1f}", f"{after.min_angle:.1f}"],
    ]
    threads = os.environ.get("NUMBA_NUM_THREADS", "as many as cores")
    return page(
        "Scans",
        "`python -m benchmarks.scans` writes this page. How to clean a scan is shown in "
        "[from a mask or a scan](guides/scans.md).",
        machine_line(facts),
        "## One command",
        f"Marching cubes of a noisy field with {ACCEPTANCE.islands:,} islands, {ACCEPTANCE.handles} "
        f"handles and {ACCEPTANCE.holes} holes (`data/shapes/scans.py`), to a closed, even surface and "
        "its picture:",
        f"```sh\nremeshvec scan.ply -o clean.ply {FLAGS} --picture scan.jpg\n```",
        f"From start to end of the process {run['seconds']:.1f} s (threads for the kernels: {threads}), "
        f"{run['memory']:,.0f} MB at the peak, of which the picture is a part. Islands that touch others "
        "or the body are fewer components. Handles stay: they belong to the surface.",
        table(["", "before", "after"], rows),
        f"The command says: {run['said']}.",
        "![The picture that the command makes](pictures/scan_command.jpg)",
        "## Noise",
        NOISE.replace("\n", " "),
        CHOICE.replace("\n", " "),
        noise,
        "## Holes",
        HOLES.replace("\n", " "),
        holes,
    )


if __name__ == "__main__":
    main()
