"""`remeshvec batch` in tests: run it on the meshes of the fixture `folder`, read what it wrote."""

from __future__ import annotations

import csv
from pathlib import Path

from remeshvec.cli.command import main

# What the fixture makes, by the names of the outputs.
ALL = ["a/x.obj", "a/y.obj", "b/c/v.off", "b/c/z.ply", "b/u.obj", "b/x.obj"]


def batch(*words):
    return main(["batch", *words, "--quiet"])


def here(*words):
    """Run with one worker, so that `calls` sees it."""
    return batch("in/**/*.*", "--out", "out", "--workers", "1", "--preset", "fast", *words)


def table(path="out/results.csv"):
    with open(path, newline="") as file:
        return {row["output"]: row for row in csv.DictReader(file)}


def outputs(root="out"):
    files = (p.relative_to(root).as_posix() for p in Path(root).rglob("*") if p.is_file())
    return sorted(name for name in files if name not in ("results.csv", "summary.json"))
