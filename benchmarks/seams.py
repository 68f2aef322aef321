"""Quality along the cuts of a surface in parts, beside one call at the same places.

``python -m benchmarks.seams pretzel-x100 8`` cuts a mesh into about eight parts. A zone holds
the faces within three target lengths of the cuts or rims of a round and away from those of later ones;
the interior is twelve away from all. ``python -m benchmarks.seams memory pretzel-x100 4`` measures
memory instead.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from remeshvec import remesh
from remeshvec.input.recipe import make_recipe
from remeshvec.large import remesh_large as large
from remeshvec.large.engine import Engine
from remeshvec.large.plans import ROUNDS
from remeshvec.large.request import read_large_options
from remeshvec.large.scratch import load as load_arrays
from remeshvec.large.scratch import read_json
from remeshvec.large.source import read_source
from remeshvec.large.tasks import MOVE

from .meshes import FloatArray, IntArray, load
from .tables import table

NEAR, FAR = 3.0, 12.0


class Zone(NamedTuple):
    """Faces of a mesh, and what is measured of them."""

    n_faces: int
    area_error: float  # percent
    valence6: float  # percent of the vertices
    in_band: float  # percent of the edges in [4/5, 4/3] L
    angle_p1: float  # degrees
    angle_least: float

    @classmethod
    def of(cls, V: FloatArray, F: IntArray, chosen: NDArray[np.bool_], L: float) -> Zone:
        """Measure some faces of a mesh without boundary."""
        corners = V[F[chosen]]
        sides = np.stack([np.roll(corners, -1 - c, 1)[:, 0] - corners[:, c] for c in range(3)], 1)
        length = np.linalg.norm(sides, axis=2)
        double_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        a, b, c = np.sort(length, axis=1).T
        angle = np.degrees(np.arccos(np.clip((b * b + c * c - a * a) / (2 * b * c), -1, 1)))
        valence = np.bincount(F.ravel(), minlength=len(V))[np.unique(F[chosen])]
        return cls(
            int(chosen.sum()),
            100.0 * float(np.abs(double_area / double_area.mean() - 1.0).mean()),
            100.0 * float((valence == 6).mean()),
            100.0 * float(((length >= 0.8 * L) & (length <= L * 4 / 3)).mean()),
            float(np.percentile(angle, 1.0)),
            float(angle.min()),
        )

    def __str__(self) -> str:
        return (
            f"{self.area_error:.2f}, {self.valence6:.1f}, {self.in_band:.2f}, {self.angle_p1:.1f}, "
            f"{self.angle_least:.1f}"
        )


def in_parts(
    V: FloatArray, F: IntArray, L: float, folder: Path, part_faces: int
) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """Remesh in parts into a folder; returns the cuts and rims of every round, and the report.

    As `remesh_large` does it, but the scratch folder stays.
    """
    wanted = read_large_options({})
    recipe = make_recipe(wanted)
    scratch = folder / "scratch"
    scratch.mkdir()
    large.write_scratch((V, F), L, wanted, recipe, scratch)
    large.remesh_parts(
        read_source((V, F)), scratch, Engine(1, None), (wanted, recipe), part_faces, False,
        folder / "out", perf_counter(),
    )  # fmt: skip
    frame = read_json(scratch / "index" / "notes.json")
    points = {}
    for step in ROUNDS:
        if step.kind != MOVE:
            for noun in ("cuts", "rims"):
                found = load_arrays(scratch / step.name / "parts", noun)[noun]
                points[f"{noun} of {step.name}"] = found / frame["scale"] + np.array(
                    frame["centre"]
                )
    return points, read_json(folder / "out" / "report.json")


def zones(
    V: FloatArray, F: IntArray, L: float, points: dict[str, FloatArray]
) -> dict[str, NDArray[np.bool_]]:
    """Faces near the cuts and rims of every round, but not of later ones; and far from all."""
    centroids = V[F].mean(axis=1)
    found, far = {}, np.full(len(F), np.inf)
    for name, at in reversed(points.items()):
        if len(at):
            distance = cKDTree(at).query(centroids, distance_upper_bound=2 * FAR * L)[0]
            found[name] = (distance <= NEAR * L) & (far > 2 * NEAR * L)
            far = np.minimum(far, distance)
    return {"all": np.ones(len(F), np.bool_), **dict(reversed(found.items())),
            "interior": far > FAR * L}  # fmt: skip


def main(name: str, count: int) -> None:
    """Print a table of zones, in parts and in one call, and the CPU time of both."""
    sample = load(name)
    V, F, L = sample.V, sample.F, sample.length
    remesh(V, F[: len(F) // 50], L)  # loads the kernels
    with tempfile.TemporaryDirectory(prefix="remeshvec-seams-") as folder:
        start = process_time()
        points, report = in_parts(V, F, L, Path(folder), -(-len(F) // count))
        middle = process_time()
        parts = [np.load(Path(folder) / "out" / f"{name}.npy") for name in ("V", "F")]
        call = remesh(V, F, L)
        end = process_time()
    whole = np.asarray(call.V), np.asarray(call.F)
    rows = []
    ours, theirs = (zones(*mesh, L, points) for mesh in (parts, whole))
    for name, chosen in ours.items():
        if chosen.any() and theirs[name].any():
            zone, other = Zone.of(*parts, chosen, L), Zone.of(*whole, theirs[name], L)
            rows.append([name, f"{zone.n_faces:,}", str(zone), str(other)])
    print(f"{sample.name}, {len(F):,} faces, {count} parts\n")
    print(table(["zone", "faces", "in parts: E, v6, band, p1, worst", "one call there"], rows, 1))
    print("\nrounds: " + "; ".join(
        f"{step['name']} {step['parts']} parts, {step['faces']:,} faces, {step['seconds']:.1f} s"
        for step in report["rounds"]
    ))  # fmt: skip
    print(
        f"CPU: {middle - start:.1f} s in parts with ingest and output, {end - middle:.1f} s one call"
    )


CHILD = """
import resource, sys
from remeshvec import remesh_large
remesh_large(sys.argv[1], float(sys.argv[2]), out=sys.argv[1] + "/out", part_faces=int(sys.argv[3]),
             workers=2)
for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN):
    print(resource.getrusage(who).ru_maxrss // 1024)
"""


def memory(name: str, count: int) -> None:
    """Print the largest resident memory of the parent and of a worker, of two."""
    sample = load(name)
    with tempfile.TemporaryDirectory(prefix="remeshvec-seams-") as folder:
        for name, array in (("V", sample.V), ("F", sample.F.astype(np.int32))):
            np.save(Path(folder) / f"{name}.npy", array)
        command = [sys.executable, "-c", CHILD, folder, repr(float(sample.length))]
        command.append(str(-(-len(sample.F) // count)))
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    parent, worker = done.stdout.split()
    print(f"{sample.name}, {len(sample.F):,} faces, {count} parts, two workers: largest resident "
          f"memory of the parent {parent} MB, of a worker {worker} MB")  # fmt: skip


if __name__ == "__main__":
    if sys.argv[1] == "memory":
        memory(sys.argv[2], int(sys.argv[3]))
    else:
        main(sys.argv[1], int(sys.argv[2]))
