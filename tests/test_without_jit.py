"""The kernels as plain Python: out-of-range reads raise, and the numbers are those of the JIT."""

import json

import numpy as np
import pytest
from helpers import zoo
from helpers.processes import run_python, surroundings

from remeshvec import remesh

SCRIPT = """
import json, sys
import numpy as np, numba
assert numba.config.DISABLE_JIT
sys.path.insert(0, "tests")
from helpers import zoo
from remeshvec import remesh
from remeshvec.mesh import blocks
blocks.FACES_PER_BLOCK = 20
found = []
for name, factor, options in json.loads(sys.argv[1]):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.02)
    L = factor * zoo.mean_edge(V, F)
    if options.pop("varies", False):
        L = L * (1 + 0.4 * np.sin(3 * V[:, 0]))
    result = remesh(V, F, L, iterations=2, **options)
    found.append([result.V.tolist(), result.F.tolist(), result.birth_face.tolist()])
print(json.dumps(found))
"""

CASES = [
    ("triangle", 0.5, {"preset": "fine"}),
    ("square", 0.5, {}),
    ("tetrahedron", 0.6, {}),
    ("octahedron", 2.5, {"preset": "fast"}),
    ("bowtie", 0.6, {"preset": "fast"}),
    ("three_half_discs", 0.8, {}),
    ("annulus", 1.2, {"preset": "fine"}),
    ("torus", 1.5, {}),
    ("sliver_fan", 1.0, {}),
    ("coincident_vertices", 0.5, {}),
    ("cube", 0.5, {"feature_angle": 40.0, "varies": True}),
    ("closed_cylinder", 0.8, {"varies": True}),
    ("two_cubes_on_an_edge", 0.6, {"feature_angle": 40.0}),
    ("moebius", 1.5, {}),
    ("grid", 0.7, {"fixed_faces": [7, 20], "boundary": "split", "feature_edges": [[16, 17]]}),
    ("planar_delaunay", 2.0, {"face_labels": [k % 2 for k in range(242)]}),
    ("octahedron", 0.9, {"max_deviation": 0.05}),
]


def in_plain_python(*arguments):
    return run_python(*arguments, env=surroundings() | {"NUMBA_DISABLE_JIT": "1"}).stdout


def test_whole_calls_agree_with_the_jit(monkeypatch):
    monkeypatch.setattr("remeshvec.mesh.blocks.FACES_PER_BLOCK", 20)
    found = json.loads(in_plain_python("-c", SCRIPT, json.dumps(CASES)))
    for (name, factor, options), parts in zip(CASES, found, strict=True):
        V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.02)
        L, options = factor * zoo.mean_edge(V, F), dict(options)
        if options.pop("varies", False):
            L = L * (1 + 0.4 * np.sin(3 * V[:, 0]))
        expected = remesh(V, F, L, iterations=2, **options)
        V2, F2, birth = (np.array(array) for array in parts)
        assert np.array_equal(F2, expected.F), name
        assert pytest.approx(expected.V, abs=1e-12) == V2, name
        assert len(birth) == len(expected.birth_face)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "expression"),
    [
        ("mesh/test_halfedge.py", "tidy or compact or pinched or cut"),
        ("features/test_polyline.py", "links or neighbours or arcs"),
        ("features/test_closest_on_curve.py", "smallest_loops or stretch"),
        ("operations/test_project.py", "trust or look_away or lengths_are or annulus"),
        ("operations/test_slide.py", "annulus or l_prism or hole or half_discs or pinned"),
        ("operations/test_unfold.py", "twin and 0.5 or concave"),
        ("operations/test_split_curves.py", "halves or frozen or siblings or births"),
        ("operations/test_collapse_curves.py", "turn or held or seams"),
        ("operations/test_collapse_siblings.py", "seams or overlap"),
        ("operations/test_split.py", "template or one_round or kinds"),
        ("operations/test_collapse.py", "link or single or boundary_guard or overshoot or refuses"),
        ("operations/test_flip.py", "single or dart or duplicates or poles or sliver_check"),
        ("operations/test_lloyd.py", "annulus or velocity or bounded or degenerate"),
        ("operations/test_frames.py", "annulus or degenerate"),
        ("operations/test_relax.py", "formula or stiffness or only_inner"),
        ("reference/test_bvh.py", "size_of_tree or without_area or hint"),
        ("operations/test_untangle.py", "reach or left_alone or told_to"),
        ("scans/test_triangulate.py", "few or straight or edge or taken"),
    ],
)
def test_kernel_tests_pass_as_plain_python(file, expression):
    assert "passed" in in_plain_python("-m", "pytest", "-x", f"tests/{file}", "-k", expression)
