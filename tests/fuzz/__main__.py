"""The command: ``python -m tests.fuzz --minutes 10 --seed 1``, or ``--case N`` for one case."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from .cases import Case, make_case, shrunk
from .checks import INVARIANTS
from .children import Child

# Cases of one seed; the next seed has others.
PER_SEED = 1_000_000


def main() -> int:
    """Run cases, print what fails, and a summary."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", type=int, help="run this case alone, and make it smaller")
    parser.add_argument("--bounds", action="store_true", help="with checks of all array indices")
    parser.add_argument("--shrink", type=float, default=5.0, help="seconds per finding")
    parser.add_argument("--ignore", nargs="*", default=[], choices=INVARIANTS, metavar="INVARIANT")
    parser.add_argument("--keep", type=Path, help="folder for the smaller meshes, as .npz")
    given = parser.parse_args()
    child, counts, kinds = Child(given.bounds), Counter[str](), Counter[tuple[str, str]]()
    numbers = (
        [given.case]
        if given.case is not None
        else range(given.seed * PER_SEED, (given.seed + 1) * PER_SEED)
    )
    end, calls = time.monotonic() + 60 * given.minutes, 0
    try:
        for number in numbers:
            if given.case is None and time.monotonic() > end:
                break
            case = make_case(number)
            calls += 1
            found = child.run(case)
            for name, what in found.items():
                if name in given.ignore:
                    continue
                counts[name] += 1
                kinds[name, case.kind] += 1
                smaller = case
                if kinds[name, case.kind] <= 2 or given.case is not None:
                    smaller = _shrink(case, name, child, given.shrink)
                print(f"{name}: {what}\n  python -m tests.fuzz --case {number}\n  {case}")
                if smaller is not case:
                    print(f"  smaller: {smaller}")
                if given.keep is not None:
                    _keep(given.keep, name, smaller)
                sys.stdout.flush()
    except KeyboardInterrupt:
        pass
    finally:
        child.stop()
    print(f"{calls} calls, {sum(counts.values())} findings")
    for name, count in counts.most_common():
        which = {kind: n for (one, kind), n in kinds.most_common() if one == name}
        print(f"  {name} ({INVARIANTS[name]}): {count}, {which}")
    return 1 if counts else 0


def _shrink(case: Case, name: str, child: Child, seconds: float) -> Case:
    end = time.monotonic() + seconds

    def still_fails(smaller: Case) -> bool:
        left = end - time.monotonic()
        return left > 0 and name in child.run(smaller)

    # A call that hangs, or compiles, would take all the time there is.
    return case if name in ("time", "memory", "crash") else shrunk(case, still_fails)


def _keep(folder: Path, name: str, case: Case) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    L = np.nan if case.L is None else case.L[1] if isinstance(case.L, tuple) else case.L
    arrays = {key: value for key, value in case.options.items() if isinstance(value, np.ndarray)}
    np.savez(folder / f"{name}_{case.number}.npz", V=case.V, F=case.F, L=L, **arrays)


if __name__ == "__main__":
    sys.exit(main())
