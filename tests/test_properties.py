"""Every phase on random meshes with random options: the arrays stay valid, the topology stays."""

import numpy as np
import pytest
import zoo
from hypothesis import example, given
from hypothesis import strategies as st
from structure import assert_valid, faces_of, locate, project, shape_of

from remeshvec import remesh
from remeshvec.edge_sets import make_blocks
from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.fit import fit_vertices
from remeshvec.operations.flip import FlipLimits, flip_edges
from remeshvec.operations.relax import RelaxOptions, relax_vertices
from remeshvec.operations.split import compact, split_long_edges
from remeshvec.operations.untangle import untangle_vertices
from remeshvec.prepare import build_reference, prepare

MESHES = st.fixed_dictionaries(
    {
        "name": st.sampled_from([*zoo.TIDY, *zoo.DIRTY]),
        "amount": st.sampled_from([0.0, 0.02, 0.1, 0.3]),
        "seed": st.integers(0, 10**6),
        "factor": st.sampled_from([0.35, 0.7, 1.0, 1.5, 4.0]),
    }
)
OPTIONS = st.fixed_dictionaries(
    {
        "split": st.floats(1.2, 2.0),
        "collapse": st.floats(0.0, 1.1),
        "foldover": st.floats(2.0, 88.0),
        "quadric_reach": st.sampled_from([0.0, 0.5, 3.0]),
        "sliver_check": st.booleans(),
        "flip_normal": st.floats(10.0, 89.0),
        "delaunay_ties": st.booleans(),
        "stiffness": st.sampled_from([0.0, 20.0, 80.0]),
        "project": st.booleans(),
        "fit": st.booleans(),
        "per_block": st.sampled_from([5, 24, 100, 10**6]),
    }
)


def cosine(degrees):
    return float(np.cos(np.radians(degrees)))


class Phases:
    """The phases in the order of a sweep, with all arrays checked after each."""

    def __init__(self, V, F, length, options, patch):
        patch.setattr("remeshvec.edge_sets.FACES_PER_BLOCK", options["per_block"])
        prepared = prepare(V, F, False)
        self.o, self.length = options, length * prepared.scale
        self.slits = bool(prepared.dirt.keys() & {"non_manifold_edges", "inconsistent_edges"})
        self.mesh = prepared.mesh
        self.reference = build_reference(self.mesh, self.length, False)
        self.shape = None if self.slits else shape_of(faces_of(self.mesh))
        self.check("prepare")

    def check(self, phase):
        self.blocks = make_blocks(self.mesh)
        try:
            assert_valid(self.mesh, slits=self.slits)
            if not self.slits:
                assert shape_of(faces_of(self.mesh)) == self.shape
            size = len(self.reference.origin)
            used = self.mesh.vertex_halfedge >= 0
            assert self.mesh.birth[used].min() >= 0 and self.mesh.birth[used].max() < size
        except AssertionError as error:
            raise AssertionError(f"after {phase}: {error}") from error

    def split(self):
        for _ in range(12):
            self.mesh, count = split_long_edges(
                self.mesh, self.blocks, self.o["split"] * self.length, False
            )
            self.check("split")
            if not count:
                return

    def collapse(self):
        o = self.o
        limits = CollapseLimits(
            o["collapse"] * self.length,
            o["split"] * self.length,
            cosine(o["foldover"]),
            o["quadric_reach"] * self.length,
            o["sliver_check"],
        )
        collapse_short_edges(self.mesh, self.blocks, limits, False)
        self.check("collapse")

    def flip(self):
        o = self.o
        limits = FlipLimits(cosine(o["flip_normal"]), o["delaunay_ties"], o["sliver_check"])
        for _ in range(2):
            flip_edges(self.mesh, self.blocks, limits, False)
            self.check("flip")

    def relax(self):
        o = self.o
        options = RelaxOptions(o["stiffness"], o["project"])
        relax_vertices(self.mesh, self.blocks, options, False)
        self.check("relax")
        if o["project"]:
            project(self.mesh, self.reference, self.blocks)
            self.check("project")

    def finish(self):
        self.mesh = compact(self.mesh, self.blocks, False)
        self.check("compact")
        tree = self.reference.tree
        untangle_vertices(self.mesh, self.blocks, tree, self.o["project"], cosine(42), False)
        self.check("untangle")
        if self.o["fit"]:
            fit_vertices(self.mesh, self.blocks, tree, 0.2 * self.length, False)
            self.check("fit")
        weights = locate(self.mesh, self.reference, self.blocks)
        self.check("locate")
        assert weights.min() >= -1e-12 and weights.sum(axis=1) == pytest.approx(1)


def run(mesh, options, sweeps=2):
    V, F = zoo.ZOO[mesh["name"]].make()
    length = mesh["factor"] * zoo.mean_edge(V, F)
    V, F = zoo.perturb(V, F, mesh["amount"], mesh["seed"])
    with pytest.MonkeyPatch.context() as patch:
        phases = Phases(V, F, length, options, patch)
        for _ in range(sweeps):
            phases.split()
            phases.collapse()
            phases.flip()
            phases.relax()
        phases.finish()


@given(MESHES, OPTIONS)
def test_every_phase_keeps_the_mesh_valid(mesh, options):
    run(mesh, options)


@pytest.mark.parametrize("name", zoo.TIDY)
def test_every_shape_through_every_phase(name):
    """The whole zoo, in many blocks, badly shaken."""
    options = {
        "split": 4 / 3, "collapse": 0.8, "foldover": 60.0, "quadric_reach": 0.5, "sliver_check": False,
        "flip_normal": 60.0, "delaunay_ties": True, "stiffness": 20.0,
        "project": True, "fit": True, "per_block": 24,
    }  # fmt: skip
    run({"name": name, "amount": 0.15, "seed": 1, "factor": 0.8}, options)


CALLS = st.fixed_dictionaries(
    {},
    optional={
        "preset": st.sampled_from(["fast", "default", "fine"]),
        "iterations": st.integers(1, 6),
        "split": st.floats(1.2, 2.0),
        "collapse": st.floats(0.0, 1.1),
        "foldover": st.floats(2.0, 88.0),
        "sliver_check": st.booleans(),
        "project": st.booleans(),
        "untangle_angle": st.floats(1.0, 60.0),
        "fit": st.booleans(),
        "threads": st.integers(1, 3),
    },
)


@given(MESHES, CALLS)
@example({"name": "bipyramid", "amount": 0.0, "seed": 0, "factor": 4.0}, {})
def test_every_call_returns_a_proper_mesh(mesh, call):
    V, F = zoo.ZOO[mesh["name"]].make()
    length = mesh["factor"] * zoo.mean_edge(V, F)
    V, F = zoo.perturb(V, F, mesh["amount"], mesh["seed"])
    result = remesh(V, F, length, **call)
    assert np.isfinite(result.V).all()
    shape = shape_of(result.F)
    assert shape["oriented"] and shape["manifold"] and shape["proper"]
    assert zoo.unreferenced(result.V, result.F) == 0
    if zoo.ZOO[mesh["name"]].is_tidy:
        assert shape == shape_of(F)
    again = remesh(V, F, length, **call)
    assert again.V.tobytes() == result.V.tobytes() and np.array_equal(again.F, result.F)


@st.composite
def soups(draw):
    """Random faces over few vertices: non-manifold, pinched, doubled, degenerate, all at once."""
    n = draw(st.integers(3, 9))
    corner = st.integers(0, n - 1)
    F = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=25))
    seed = draw(st.integers(0, 1000))
    V = np.random.default_rng(seed).normal(size=(n, 3))
    return V, np.array(F, np.int64)


@given(soups(), st.sampled_from([0.3, 1.0, 5.0]))
def test_any_soup_becomes_a_proper_mesh(soup, L):
    V, F = soup
    if all(len(set(f)) < 3 for f in F.tolist()):
        return
    result = remesh(V, F, L, iterations=3)
    shape = shape_of(result.F)
    assert shape["oriented"] and shape["manifold"] and shape["proper"], shape
    assert np.isfinite(result.V).all()
    kept = {frozenset(f) for f in F.tolist() if len(set(f)) == 3}
    assert zoo.components(result.F) <= len(kept)
