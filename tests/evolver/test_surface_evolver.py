"""Surface Evolver: files, and the real program where it is installed."""

import shutil

import numpy as np
import pytest
from helpers import zoo

from data.shapes.films import cone
from remeshvec import MeshFormatError, OptionError
from remeshvec.evolver import (
    CapillaryProblem,
    EvolverBackend,
    EvolverError,
    evolve,
    minimize,
    read_dump,
    write_fe,
)

needs_evolver = pytest.mark.skipif(
    shutil.which("evolver") is None,
    reason="Surface Evolver is not installed (apt install evolver-nox)",
)


def drop(n=24, **options):
    return evolve(CapillaryProblem(*cone(n, 1.0), volume=1.0, **options), [0.25]).minimum.problem


def film():
    V, F = zoo.cylinder(16, 7)
    return V * [1, 1, 0.4], F


PROBLEMS = {
    "ball": lambda: CapillaryProblem(*zoo.icosphere(2), volume=4.0, tension=2.0),
    "film": lambda: CapillaryProblem(*film(), energy_offset=1.5),
    "heavy drop": lambda: drop(density=2.0, gravity=(0, 0, -1.5), volume_offset=0.25),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_files_come_back(name, tmp_path):
    problem = PROBLEMS[name]()
    V, F, fixed = read_dump(write_fe(tmp_path / "a.fe", problem))
    assert np.array_equal(V, problem.V) and np.array_equal(F, problem.F)
    assert np.array_equal(fixed, problem.fixed)
    text = (tmp_path / "a.fe").read_text()
    assert "gravity_constant" in text and "symmetric_content" in text
    assert ("bodies" in text) == (name != "film")
    assert text.count(" fixed") == problem.fixed.sum() + len(problem.fixed_edges)


def test_bad_files(tmp_path):
    file = tmp_path / "a.dmp"
    for text in (
        "", "vertices\n1 0 0 0\nedges\n1 1 2\n", "vertices\n1 0 0 0\nedges\n1 1 9\nfaces\n1 1 1 1\n",
        "vertices\n1 0 0\nedges\n1 1 1\nfaces\n1 1 1 1\n",
        "vertices\n1 0 0\n2 1 0\n3 0 1\nedges\n1 1 2\n2 2 3\n3 3 1\nfaces\n1 1 2 3\n",
        "vertices\n1 0 0 0\n2 1 0 0\n3 0 1 nan\nedges\n1 1 2\n2 2 3\n3 3 1\nfaces\n1 1 2 3\n",
    ):  # fmt: skip
        file.write_text(text)
        with pytest.raises(MeshFormatError, match=r"a\.dmp"):
            read_dump(file)


def test_gravity_is_along_z(tmp_path):
    problem = CapillaryProblem(*zoo.icosphere(1), density=1.0, gravity=(1.0, 0, 0))
    with pytest.raises(OptionError, match="along z"):
        write_fe(tmp_path / "a.fe", problem)


def test_an_absent_program_is_named():
    with pytest.raises(EvolverError, match="apt install evolver-nox"):
        EvolverBackend("no-such-evolver")
    with pytest.raises(OptionError, match="timeout"):
        EvolverBackend("sh", timeout=0)


@needs_evolver
@pytest.mark.parametrize("name", PROBLEMS)
def test_energies_agree(name):
    problem = PROBLEMS[name]()
    found = EvolverBackend().energy(problem)
    assert found == pytest.approx(problem.energy(), rel=1e-12)


@needs_evolver
@pytest.mark.parametrize("name", PROBLEMS)
def test_minima_on_the_same_triangles_agree(name):
    problem = PROBLEMS[name]()
    ours = minimize(minimize(problem, "flow", steps=30).problem, "newton", tol=1e-10)
    assert ours.converged
    theirs = EvolverBackend()(ours.problem, "newton", steps=4)
    assert theirs.energy == pytest.approx(ours.energy, rel=1e-9)
    assert theirs.residual < 1e-6
    assert np.array_equal(theirs.V[problem.fixed], problem.V[problem.fixed])


@needs_evolver
def test_gradient_steps_lower_the_energy():
    problem = CapillaryProblem(*zoo.cylinder(24, 9))
    seen = []
    found = EvolverBackend()(problem, "flow", steps=2, callback=lambda *args: seen.append(args))
    assert found.energy < problem.energy() - 0.1
    assert len(seen) == 1


@needs_evolver
def test_it_serves_the_same_loop():
    V, F = zoo.cube()
    problem = CapillaryProblem(V / np.ptp(V), F, volume=1.0)
    done = evolve(problem, [0.3], backend=EvolverBackend(), tol=1e-6)
    assert done.minimum.converged
    assert done.minimum.area == pytest.approx((36 * np.pi) ** (1 / 3), rel=0.01)


@needs_evolver
def test_failures_are_told(tmp_path):
    backend = EvolverBackend()
    problem = PROBLEMS["ball"]()
    with pytest.raises(EvolverError, match=r"(?s)exit 104.*syntax"):
        backend.run(problem, "gg rubbish ;")
    with pytest.raises(EvolverError, match="changed the triangles"):
        backend.run(problem, "r;")
    with pytest.raises(EvolverError, match="more than"):
        EvolverBackend(timeout=0.5).run(problem, "g 100000000;")
    with pytest.raises(EvolverError, match="no dump"):
        backend.run(problem, "q\nq\n")
