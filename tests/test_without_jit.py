"""The kernels as plain Python: out-of-range reads raise, and the numbers are those of the JIT."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zoo

from remeshvec import remesh

ROOT = Path(__file__).resolve().parents[1]

SCRIPT = """
import json, sys
import numpy as np, numba
assert numba.config.DISABLE_JIT
sys.path.insert(0, "tests")
import zoo
from remeshvec import edge_sets, remesh
edge_sets.FACES_PER_BLOCK = 20
found = {}
for name, factor, preset in json.loads(sys.argv[1]):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.02)
    result = remesh(V, F, factor * zoo.mean_edge(V, F), preset=preset, iterations=2)
    found[name] = [result.V.tolist(), result.F.tolist(), result.birth_face.tolist()]
print(json.dumps(found))
"""

CASES = [
    ("triangle", 0.5, "fine"),
    ("square", 0.5, "default"),
    ("tetrahedron", 0.6, "default"),
    ("octahedron", 2.5, "fast"),
    ("bowtie", 0.6, "fast"),
    ("three_half_discs", 0.8, "default"),
    ("annulus", 1.2, "fine"),
    ("torus", 1.5, "default"),
    ("sliver_fan", 1.0, "default"),
    ("coincident_vertices", 0.5, "default"),
]


def in_plain_python(*arguments):
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, *arguments], env=env, cwd=ROOT, capture_output=True, text=True, check=False
    )


def test_whole_calls_agree_with_the_jit(monkeypatch):
    monkeypatch.setattr("remeshvec.edge_sets.FACES_PER_BLOCK", 20)
    done = in_plain_python("-c", SCRIPT, json.dumps(CASES))
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    for name, factor, preset in CASES:
        V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.02)
        expected = remesh(V, F, factor * zoo.mean_edge(V, F), preset=preset, iterations=2)
        V2, F2, birth = (np.array(array) for array in found[name])
        assert np.array_equal(F2, expected.F), name
        assert pytest.approx(expected.V, abs=1e-12) == V2, name
        assert len(birth) == len(expected.birth_face)


@pytest.mark.parametrize(
    ("file", "expression"),
    [
        ("test_halfedge.py", "tidy or compact or pinched or cut"),
        ("test_split.py", "template or one_round or kinds"),
        ("test_collapse.py", "link or single or boundary_guard or overshoot or foldover_refuses"),
        ("test_flip.py", "single or dart or duplicates or poles or sliver_check"),
        ("test_relax.py", "formula or stiffness or fixed"),
        ("test_bvh.py", "size_of_tree or without_area or hint"),
        ("test_untangle.py", "reach or left_alone or told_to"),
    ],
)
def test_kernel_tests_pass_as_plain_python(file, expression):
    done = in_plain_python("-m", "pytest", "-x", f"tests/{file}", "-k", expression)
    assert done.returncode == 0, done.stdout[-3000:]
    assert "passed" in done.stdout
