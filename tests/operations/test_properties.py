"""Every phase on random meshes with random options: the arrays stay valid, the topology stays."""

import numpy as np
import pytest
from helpers import zoo
from helpers.siblings import sheets_at_places, siblings_of
from helpers.structure import (
    assert_on_reference,
    assert_same_bits,
    assert_valid,
    copied,
    faces_of,
    featured,
    locate,
    project,
    shape_of,
)
from helpers.threads import shuffled
from hypothesis import example, given
from hypothesis import strategies as st

from data.shapes import topology
from remeshvec import remesh
from remeshvec.core.vocabulary import DEAD, FIXED
from remeshvec.input.prepare import prepare
from remeshvec.mesh.blocks import make_blocks
from remeshvec.operations.classify import classify_edges
from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.fit import fit_vertices
from remeshvec.operations.flip import FlipLimits, flip_edges
from remeshvec.operations.frames import FRAME_SIZE, measure_frames
from remeshvec.operations.lloyd import Pace, run_lloyd_round, turn_velocities
from remeshvec.operations.project import read_lengths
from remeshvec.operations.relax import relax_vertices
from remeshvec.operations.siblings import collapse_siblings
from remeshvec.operations.slide import slide_vertices
from remeshvec.operations.split import compact, split_long_edges
from remeshvec.operations.unfold import undo_folded_edges, undo_folds
from remeshvec.operations.untangle import untangle_vertices

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
        "passes": st.integers(1, 3),
        "rounds": st.integers(0, 3),
        "room": st.sampled_from([0.0, 0.125, 1.0]),
        "per_block": st.sampled_from([5, 24, 100, 10**6]),
    }
)
CONTROLS = st.fixed_dictionaries(
    {
        "varies": st.booleans(),
        "feature_angle": st.sampled_from([None, "auto", 20.0, 50.0]),
        "boundary": st.sampled_from(["free", "split", "fixed"]),
        "share": st.sampled_from([0.0, 0.02, 0.1]),
        "seed": st.integers(0, 1000),
    },
    optional={
        "feature_edges": st.just(True),
        "fixed_vertices": st.just(True),
        "fixed_faces": st.just(True),
        "face_labels": st.just(True),
    },
)
PLAIN = {"varies": False, "feature_angle": None, "boundary": "free", "share": 0.0, "seed": 0}


def cosine(degrees):
    return float(np.cos(np.radians(degrees)))


def wishes(F, controls):
    """Random parts of a mesh to be kept, as keywords; a share of each kind."""
    rng = np.random.default_rng(controls["seed"])
    some = lambda n: rng.choice(n, round(controls["share"] * n), replace=False)  # noqa: E731
    edges = np.unique(
        np.sort(np.vstack([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1), axis=0
    )
    kept = {
        "feature_edges": edges[some(len(edges))],
        "fixed_vertices": np.unique(F)[some(len(np.unique(F)))],
        "fixed_faces": some(len(F)),
        "face_labels": rng.integers(2, size=len(F)) if controls["share"] else np.zeros(len(F), int),
    }
    kept = {name: value for name, value in kept.items() if name in controls}
    return {name: controls[name] for name in ("feature_angle", "boundary")} | kept


class Phases:
    """The phases in any order, with all arrays checked after each.

    Each runs twice, the second time with its blocks in some other order: the bits must be the same.
    """

    def __init__(self, V, F, length, options, controls, patch):
        patch.setattr("remeshvec.mesh.blocks.FACES_PER_BLOCK", options["per_block"])
        prepared = prepare(V, F, False)
        self.o = options
        self.mesh = mesh = prepared.mesh
        self.blocks = make_blocks(mesh)
        self.slits = bool(prepared.dirt.keys() & {"non_manifold_edges", "inconsistent_edges"})
        mesh.X[:, 3] = length * prepared.scale
        if controls["varies"]:
            mesh.X[:, 3] *= 1 + 0.4 * np.sin(3 * mesh.X[:, 0] + mesh.X[:, 1])
        source = prepared.vertex_source
        wanted = wishes(source[mesh.origin.reshape(-1, 3)].astype(np.int64), controls)
        self.built = featured(mesh, vertex_source=source, **wanted)
        self.reference = self.built.reference
        self.shape = None if self.slits else shape_of(faces_of(mesh))
        self.corners = held(mesh)
        self.sheets = set(sheets_at_places(self.mesh).values())
        self.before = mesh.X.copy()
        self.limits = CollapseLimits(
            options["collapse"],
            options["split"],
            cosine(options["foldover"]),
            options["quadric_reach"],
            options["sliver_check"],
        )
        self.check("prepare")

    def run(self, name, phase):
        """Run ``phase(mesh, parallel)``, which changes the mesh or returns another one."""
        other, blocks = copied(self.mesh), self.blocks
        found = phase(self.mesh, False) or self.mesh
        with shuffled(len(name)):
            again = phase(other, True) or other
        assert_same_bits(found, again)
        if found is not self.mesh:
            self.mesh, blocks = found, make_blocks(found)
        self.blocks = blocks
        self.check(name)

    def check(self, phase):
        try:
            assert_valid(self.mesh, slits=self.slits)
            assert_on_reference(self.mesh, self.reference)
            if not self.slits:
                assert shape_of(faces_of(self.mesh)) == self.shape
            assert held(self.mesh) == self.corners, "a fixed vertex moved or went"
            assert set(sheets_at_places(self.mesh).values()) <= self.sheets, "a sheet came off"
            size = len(self.reference.origin)
            used = self.mesh.vertex_halfedge >= 0
            assert self.mesh.birth[used].min() >= 0 and self.mesh.birth[used].max() < size
        except AssertionError as error:
            raise AssertionError(f"after {phase}: {error}") from error

    def split(self):
        """Rounds, whose flags stay true of a mesh that is split in place."""
        for _ in range(12):
            size = len(self.mesh.X), (self.mesh.vertex_halfedge != DEAD).sum()
            self.run("split", self.one_round)
            if size == (len(self.mesh.X), (self.mesh.vertex_halfedge != DEAD).sum()):
                return

    def one_round(self, mesh, parallel):
        siblings = siblings_of(mesh) if self.slits else None
        longest, shortest = self.o["split"], self.o["collapse"]
        flags = classify_edges(mesh, self.blocks, longest, shortest, parallel)
        refined, _ = split_long_edges(mesh, self.blocks, longest, parallel, siblings, flags)
        if refined is mesh:
            fresh = classify_edges(mesh, self.blocks, longest, shortest, parallel)
            assert np.array_equal(flags.mask, fresh.mask) and fresh.n_long == 0
        return refined

    def collapse(self):
        self.run("collapse", self.collapse_once)
        if self.slits:
            siblings = siblings_of(self.mesh)
            self.run("siblings", lambda m, p: void(collapse_siblings(m, *siblings, self.limits)))

    def collapse_once(self, mesh, parallel):
        """With the flags that are known, and without."""
        other = copied(mesh)
        longest, shortest = self.limits.longest, self.limits.shortest
        flags = classify_edges(mesh, self.blocks, longest, shortest, parallel)
        tallies = [
            collapse_short_edges(m, self.blocks, self.limits, parallel, f)
            for m, f in ((mesh, flags), (other, None))
        ]
        assert np.array_equal(*tallies)
        assert_same_bits(mesh, other)

    def flip(self):
        o = self.o
        limits = FlipLimits(cosine(o["flip_normal"]), o["delaunay_ties"], o["sliver_check"])
        for passes in (1, o["passes"]):
            self.run("flip", lambda m, p, n=passes: void(flip_edges(m, self.blocks, limits, p, n)))

    def relax(self):
        self.before = self.mesh.X.copy()
        self.run("slide", lambda m, p: slide_vertices(m, self.blocks, self.reference, p))
        self.run("relax", lambda m, p: relax_vertices(m, self.blocks, self.o["stiffness"], p))
        if self.o["project"]:
            self.run("project", lambda m, p: project(m, self.reference, self.blocks, p))
        self.run("unfold", lambda m, p: void(undo_folds(m, self.blocks, self.before, p)))
        self.run("lengths", lambda m, p: void(read_lengths(m, self.blocks, self.reference, p)))

    def pack(self):
        """Close the holes, and leave room or none."""
        self.run("compact", lambda m, p: compact(m, self.blocks, p, self.o["room"]))

    def untangle(self):
        tree, o = self.reference.tree, self.o
        arguments = (self.blocks, tree, o["project"], cosine(42), o["rounds"])
        self.run("untangle", lambda m, p: void(untangle_vertices(m, *arguments, p)))

    def even_out(self):
        """Trades and Lloyd rounds, and what folds is taken back."""
        limits = FlipLimits(cosine(self.o["flip_normal"]), True, self.o["sliver_check"], 0.4)
        self.run("trade", lambda m, p: void(flip_edges(m, self.blocks, limits, p)))
        before = self.mesh.X.copy()
        self.run("lloyd", self.lloyd_rounds)
        self.run("unfold edges", lambda m, p: void(undo_folded_edges(m, self.blocks, before, p)))

    def lloyd_rounds(self, mesh, parallel):
        frames, velocity = np.empty((len(mesh.X), FRAME_SIZE)), np.zeros((len(mesh.X), 3))
        measure_frames(mesh, self.blocks, self.o["stiffness"], frames, parallel)
        for varies in (False, True):
            turn_velocities(mesh, self.blocks, frames, velocity, parallel)
            pace = Pace(3.0, 0.85, 0.05)
            run_lloyd_round(mesh, self.blocks, frames, velocity, pace, varies, parallel)

    def finish(self):
        self.run("compact", lambda m, p: compact(m, self.blocks, p))
        self.untangle()
        if self.o["fit"]:
            tree = self.reference.tree
            self.run("fit", lambda m, p: fit_vertices(m, self.blocks, tree, 0.2, p))
        weights = locate(self.mesh, self.reference, self.blocks)
        self.check("locate")
        assert weights.min() >= -1e-12 and weights.sum(axis=1) == pytest.approx(1)


def void(_):
    """Return nothing, for phases that count."""


def held(mesh):
    """Fixed vertices: where they lie and where they were born, bit for bit."""
    fixed = np.flatnonzero((mesh.kind == FIXED) & (mesh.vertex_halfedge != DEAD))
    return sorted((mesh.X[v, :3].tobytes(), int(mesh.birth[v])) for v in fixed)


SWEEP = ["split", "collapse", "flip", "relax"]


def run(mesh, options, controls=PLAIN, steps=(*SWEEP, *SWEEP)):
    V, F = zoo.ZOO[mesh["name"]].make()
    length = mesh["factor"] * zoo.mean_edge(V, F)
    V, F = zoo.perturb(V, F, mesh["amount"], mesh["seed"])
    with pytest.MonkeyPatch.context() as patch:
        phases = Phases(V, F, length, options, controls, patch)
        for step in steps:
            getattr(phases, step)()
        phases.finish()


@given(MESHES, OPTIONS)
def test_every_phase_keeps_the_mesh_valid(mesh, options):
    run(mesh, options)


@given(MESHES, OPTIONS, CONTROLS)
def test_every_phase_keeps_curves_and_what_is_held(mesh, options, controls):
    run(mesh, options, controls)


STEPS = st.lists(st.sampled_from([*SWEEP, "pack", "untangle", "even_out"]), max_size=10)


@given(MESHES, OPTIONS, CONTROLS, STEPS)
def test_phases_in_any_order(mesh, options, controls, steps):
    run(mesh, options, controls, steps)


@pytest.mark.parametrize("angle", [None, 40.0])
@pytest.mark.parametrize("name", [*zoo.TIDY, *zoo.DIRTY])
def test_every_shape_through_every_phase(name, angle):
    """The whole zoo, in many blocks, badly shaken."""
    options = {
        "split": 4 / 3, "collapse": 0.8, "foldover": 60.0, "quadric_reach": 0.5, "sliver_check": False,
        "flip_normal": 60.0, "delaunay_ties": True, "stiffness": 20.0,
        "project": True, "fit": True, "passes": 2, "rounds": 2, "room": 0.5, "per_block": 24,
    }  # fmt: skip
    mesh = {"name": name, "amount": 0.15, "seed": 1, "factor": 0.8}
    controls = {**PLAIN, "feature_angle": angle, "varies": angle is not None}
    run(mesh, options, controls, [*SWEEP, "pack", *SWEEP])


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
        "feature_angle": st.sampled_from(["auto", None, 30]),
        "boundary": st.sampled_from(["free", "split", "fixed"]),
        "gradation": st.floats(1.1, 3.0),
        "tol": st.floats(0.0, 0.3),
    },
)


def sheets(F):
    """Number of faces at the edges that have more than two."""
    return {len(users) for users in zoo.edge_faces(F).values()} - {1, 2}


def assert_proper(result, F, is_tidy=False):
    """Whole faces, each once; non-manifold edges as in the input; the topology of a tidy mesh."""
    shape = shape_of(result.F)
    assert np.isfinite(result.V).all()
    assert shape["proper"] and shape["duplicate faces"] == 0
    assert zoo.unreferenced(result.V, result.F) == 0
    once = list({frozenset(f): f for f in topology.proper(F)}.values())
    assert sheets(result.F) == sheets(once)
    if not sheets(once) and "inconsistent_edges" not in result.report.dirt:
        assert shape["oriented"] and shape["manifold"]
    if is_tidy:
        assert shape == shape_of(F)


def made(mesh):
    """A perturbed mesh, and the length asked for."""
    V, F = zoo.ZOO[mesh["name"]].make()
    length = mesh["factor"] * zoo.mean_edge(V, F)
    return *zoo.perturb(V, F, mesh["amount"], mesh["seed"]), length


@given(MESHES, CALLS)
@example({"name": "bipyramid", "amount": 0.0, "seed": 0, "factor": 4.0}, {})
def test_every_call_returns_a_proper_mesh(mesh, call):
    V, F, length = made(mesh)
    result = remesh(V, F, length, **call)
    assert_proper(result, F, zoo.ZOO[mesh["name"]].is_tidy)
    again = remesh(V, F, length, **call)
    assert again.V.tobytes() == result.V.tobytes() and np.array_equal(again.F, result.F)


@given(MESHES, CONTROLS)
def test_every_controlled_call_returns_a_proper_mesh(mesh, controls):
    """With parts of all kinds that are to be kept, and a length at every vertex."""
    V, F, L = made(mesh)
    used = np.array(topology.proper(F))
    kept = wishes(used, controls)
    for name in ("fixed_faces", "face_labels"):  # in terms of the faces that are whole
        if name in kept and len(used) < len(F):
            del kept[name]
    if controls["varies"]:
        L = L * (1 + 0.5 * np.sin(3 * V[:, 0] + V[:, 1]))
    result = remesh(V, F, L, **kept)
    assert_proper(result, F, zoo.ZOO[mesh["name"]].is_tidy)
    claimed = np.flatnonzero(result.vertex_map >= 0)
    assert np.array_equal(result.V[result.vertex_map[claimed]], V[claimed])
    if "fixed_vertices" in kept:
        assert (result.vertex_map[kept["fixed_vertices"]] >= 0).all()
    if "fixed_faces" in kept and zoo.ZOO[mesh["name"]].is_tidy:
        assert (result.face_map[kept["fixed_faces"]] >= 0).all()


def soup(seed):
    """Twelve random faces over seven vertices."""
    rng = np.random.default_rng(seed)
    F = rng.integers(0, 7, size=(12, 3))
    return rng.normal(size=(7, 3)), F


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
@example(soup(10), 1.0)
@example(soup(0), 0.3)
def test_any_soup_becomes_a_proper_mesh(soup, L):
    V, F = soup
    if all(len(set(f)) < 3 for f in F.tolist()):
        return
    result = remesh(V, F, L, iterations=3)
    assert_proper(result, F)
    kept = {frozenset(f) for f in F.tolist() if len(set(f)) == 3}
    assert zoo.components(result.F) <= len(kept)
