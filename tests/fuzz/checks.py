"""What must hold after any call of `remesh`; `failures` says what does not."""

from __future__ import annotations

import hashlib
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import igl
import numpy as np

import remeshvec
from tests.helpers.complexes import edges_of, patch_euler_numbers, shape

from .cases import Case, area_of, edge_sum

# Names of all invariants, in the order in which they are looked at.
INVARIANTS = {
    "exception": "only exceptions of the package's own are raised",
    "inputs": "the caller's arrays stay as they are",
    "finite": "coordinates, lengths and weights are finite",
    "indices": "faces name vertices that exist, every vertex is used, no face repeats a corner",
    "non-manifold": "no edge of more than two faces where the input had none",
    "topology": "clean input keeps its Euler number, components, loops and orientation",
    "complex": "sheets that meet keep the Euler number of each",
    "zero-area": "no face without area where the input had none",
    "turned": "no face lies against an oriented input",
    "births": "births are faces of the input with weights that sum to one",
    "on-input": "vertices lie where their births say, where the result ends on the input",
    "kept": "fixed vertices and faces are there, bit for bit",
    "size": "no more faces than the area, the edges and the lengths explain",
    "area": "the area does not grow",
    "threads": "one thread and two give the same bits",
    # Found from outside, by whoever started the process:
    "time": "a call ends in time",
    "crash": "the process lives on",
    "memory": "memory stays in bounds",
}

EPS = np.finfo(float).eps
_FLAT = 1e-12  # height over longest side, below which a face has no area
# Faces as computed from the length may be so many times more.
_SIZE_FACTOR = 6
# How far vertices may be from their births, in target lengths.
_OFF_INPUT = 0.3


def run_call(case: Case, threads: int | None = None) -> Any:
    L = remeshvec.Adaptive(case.L[1]) if isinstance(case.L, tuple) else case.L
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return remeshvec.remesh(case.V, case.F, L, threads=threads, **case.options)


def failures(case: Case) -> dict[str, str]:
    """Call, and return the invariants that do not hold with what was found."""
    arrays = [case.V, case.F, case.L, *case.options.values()]
    arrays = [array for array in arrays if isinstance(array, np.ndarray)]
    before = [array.tobytes() for array in arrays]
    found: dict[str, str] = {}
    try:
        result = run_call(case)
        found |= judge(case, result)
        if case.threads:
            found |= dict(_compare_threads(case))
    except remeshvec.RemeshvecError:
        pass
    except MemoryError as error:
        found["memory"] = str(error)
    except Exception as error:
        found["exception"] = f"{type(error).__name__}: {error}"[:200]
    if before != [array.tobytes() for array in arrays]:
        found["inputs"] = "an array was written to"
    return found


def judge(case: Case, result: Any) -> dict[str, str]:
    """Return what is wrong with a result."""
    found = dict(_arrays(result))
    if not found:
        for check in (_surface, _births, _kept, _amount):
            found |= dict(check(case, result))
    return found


def _arrays(result: Any) -> Iterator[tuple[str, str]]:
    V, F = result
    if not (np.isfinite(V).all() and np.isfinite(result.lengths).all()):
        yield "finite", f"{int((~np.isfinite(V).all(axis=1)).sum())} vertices are not finite"
    if not len(F) or F.min() < 0 or F.max() >= len(V):
        yield "indices", f"{len(F)} faces, out of range of {len(V)} vertices"
        return
    if len(np.unique(F)) != len(V):
        yield "indices", f"{len(V) - len(np.unique(F))} vertices that no face uses"
    repeated = int((np.roll(F, 1, axis=1) == F).any(axis=1).sum())
    if repeated:
        yield "indices", f"{repeated} faces repeat a corner"


class Input:
    """What is true of an input."""

    def __init__(self, V: np.ndarray, F: np.ndarray) -> None:
        self.proper = bool((np.roll(F, 1, axis=1) != F).all())
        self.shape: dict[str, Any] = {}
        if not self.proper:
            self.manifold = self.has_area = self.clean = self.is_complex = False
            return
        self.manifold = bool((edges_of(F).faces <= 2).all())
        self.has_area = not is_flat(V, F, 1e3).any()
        self.shape = shape(F)
        used = V[np.unique(F)]
        apart = len(np.unique(used, axis=0)) == len(used)
        unique = self.shape["duplicate faces"] == 0
        self.clean = bool(
            self.shape["manifold"] and self.shape["oriented"] and apart and unique and self.has_area
        )
        self.is_complex = apart and unique and self.has_area and not self.manifold


def is_flat(V: np.ndarray, F: np.ndarray, factor: float = 1.0) -> np.ndarray:
    """Faces whose height is a rounding error, of their longest side or of the coordinates."""
    P = V[F]
    scale = max(float(np.abs(P - P[:1, :1]).max()), 1e-300)
    P = (P - P[:1, :1]) / scale
    longest = np.linalg.norm(P - np.roll(P, -1, axis=1), axis=2).max(axis=1)
    twice_area = np.linalg.norm(np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]), axis=1)
    rounding = 4 * EPS * float(np.abs(V).max()) / scale
    least = factor * np.maximum(_FLAT * longest, rounding)
    return ~(twice_area > least * longest)


def _surface(case: Case, result: Any) -> Iterator[tuple[str, str]]:
    V, F = result
    F = np.asarray(F, np.int64)
    given = Input(case.V, case.F)
    if given.manifold and given.proper:
        many = int((edges_of(F).faces > 2).sum())
        # Welding and turning what is dirty may join sheets.
        if many and (given.clean or (given.shape["manifold"] and given.shape["oriented"])):
            yield "non-manifold", f"{many} edges of more than two faces"
    if given.clean:
        now = shape(F)
        changed = {k: (given.shape[k], now[k]) for k in now if now[k] != given.shape[k]}
        if changed:
            yield "topology", f"before and after: {changed}"
    if given.is_complex:
        euler, before = patch_euler_numbers(F), patch_euler_numbers(case.F)
        if euler != before:
            yield (
                "complex",
                f"{len(before)} patches of {sum(before)}, now {len(euler)} of {sum(euler)}",
            )
    if given.has_area:
        flat = int(is_flat(V, F).sum())
        if flat:
            yield "zero-area", f"{flat} of {len(F)} faces"
    if given.clean and "project" not in case.options:
        n_turned = count_turned(case.V, case.F, V, F, result.lengths)
        if n_turned:
            yield "turned", f"{n_turned} of {len(F)} faces"


def count_turned(V0, F0, V, F, lengths) -> int:
    """Faces against the input: no face of it that agrees with them lies about as near as the nearest.

    Within twice the distance, and a fifth of a length more, so that thin sheets, noise and chords of
    holes that are smaller than a length count as agreeing.
    """
    origin, scale = V0[F0[0, 0]], float(np.ptp(V0[F0].reshape(-1, 3), axis=0).max())
    V0, V, lengths = (V0 - origin) / scale, (V - origin) / scale, lengths / scale
    n0, n = (
        np.cross(X[G[:, 1]] - X[G[:, 0]], X[G[:, 2]] - X[G[:, 0]]) for X, G in ((V0, F0), (V, F))
    )
    middle = V[F].mean(axis=1)
    squared, closest, _ = igl.point_mesh_squared_distance(middle, V0, F0)
    longest = np.linalg.norm(V[F] - V[F[:, [1, 2, 0]]], axis=2).max(axis=1)
    suspects = np.flatnonzero((n * n0[closest]).sum(axis=1) < 0)[:300]
    count = 0
    for f in suspects:
        local = max(lengths[F[f]].mean(), longest[f])
        reach = 2 * np.sqrt(max(squared[f], 0.0)) + 0.2 * local
        agrees = np.flatnonzero(n0 @ n[f] > 0)
        if len(agrees):
            nearest = igl.point_mesh_squared_distance(middle[f][None], V0, F0[agrees])[0]
            count += float(np.ravel(nearest)[0]) > reach**2
        else:
            count += 1
    return count


def _births(case: Case, result: Any) -> Iterator[tuple[str, str]]:
    for name, face, weights in (
        ("vertex", result.birth_face, result.birth_barycentric),
        ("corner", result.corner_birth_face, result.corner_birth_barycentric),
    ):
        if face.min() < 0 or face.max() >= len(case.F):
            yield "births", f"{name}: faces out of range"
            return
        if not np.isfinite(weights).all() or weights.min() < -1e-9:
            yield "births", f"{name}: weights down to {weights.min()}"
        if abs(weights.sum(axis=-1) - 1).max() > 1e-9:
            yield "births", f"{name}: weights that do not sum to one"
    if result.face_birth.min() < 0 or result.face_birth.max() >= len(case.F):
        yield "births", "face: out of range"
    if case.options.get("project", True) and not result.report.options.fit_rounds:
        corners = case.V[case.F[result.birth_face]]
        at = np.einsum("nc,ncx->nx", result.birth_barycentric, corners)
        away = np.linalg.norm(at - result.V, axis=1)
        # Moves that would fold a face are taken back, and end a little off the input.
        rounding = 64 * EPS * float(np.abs(case.V[case.F]).max())
        far = away > _OFF_INPUT * result.lengths + rounding
        if far.any():
            yield "on-input", f"{int(far.sum())} vertices up to {away.max():.2g} away"


def _kept(case: Case, result: Any) -> Iterator[tuple[str, str]]:
    V, F, used = result.V, result.F, np.unique(case.F)
    fixed = case.options.get("fixed_vertices")
    given = Input(case.V, case.F)
    if fixed is not None and given.clean:
        fixed = np.intersect1d(fixed, used)
        at = result.vertex_map[fixed]
        if (at < 0).any() or V[at].tobytes() != case.V[fixed].tobytes():
            yield "kept", f"{int((at < 0).sum())} fixed vertices are missing, or others moved"
    if not given.clean:
        return
    for name in ("fixed_faces", "selection"):
        mask = case.options.get(name)
        if mask is None:
            continue
        faces = np.flatnonzero(mask if name == "fixed_faces" else ~mask)
        at = result.face_map[faces]
        if (at < 0).any():
            yield "kept", f"{int((at < 0).sum())} faces of {name} are missing"
        elif not (np.sort(V[F[at]], axis=1) == np.sort(case.V[case.F[faces]], axis=1)).all():
            yield "kept", f"faces of {name} have moved"


def _amount(case: Case, result: Any) -> Iterator[tuple[str, str]]:
    shortest = float(result.lengths.min())
    area, edges = area_of(case.V, case.F), edge_sum(case.V, case.F)
    most = _SIZE_FACTOR * (area / shortest / (0.433 * shortest) + edges / shortest)
    if len(result.F) > most + 6 * len(case.F) + 100:
        yield (
            "size",
            f"{len(result.F)} faces, {len(case.F)} before; {most:.0f} at most for its length",
        )
    grown = area_of(np.asarray(result.V, float), result.F) / max(area, 1e-300)
    if grown > 1.3 and "project" not in case.options:
        yield "area", f"{grown:.3g} times that of the input"


@contextmanager
def small_blocks() -> Iterator[None]:
    """Let small meshes be cut into blocks that threads share."""
    work, blocks = (sys.modules[f"remeshvec.{name}"] for name in ("sweeps.work", "mesh.blocks"))
    with patch.object(work, "_PARALLEL_FACES", 0), patch.object(blocks, "FACES_PER_BLOCK", 100):
        yield


def _compare_threads(case: Case) -> Iterator[tuple[str, str]]:
    with small_blocks():
        one, two = (_digest(run_call(case, threads)) for threads in (1, 2))
    if one != two:
        yield "threads", f"differ: {[k for k in one if one[k] != two[k]]}"


def _digest(result: Any) -> dict[str, str]:
    names = ("V", "F", "birth_face", "birth_barycentric", "vertex_map", "face_map", "corners")
    return {
        name: hashlib.sha256(np.ascontiguousarray(getattr(result, name)).tobytes()).hexdigest()
        for name in names
    }
