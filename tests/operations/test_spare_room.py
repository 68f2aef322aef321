"""Room for splits in place: what compaction and splits leave free, and that nothing else changes."""

import numpy as np
import pytest
from helpers.dead_elements import CLOSED, OPEN, holed, numbers, spotted, with_room
from helpers.structure import (
    assert_on_reference,
    assert_same_bits,
    assert_valid,
    blocks_of,
    copied,
    one_block,
    packed,
)

from remeshvec.core.vocabulary import DEAD, INNER
from remeshvec.mesh.blocks import make_blocks
from remeshvec.operations.classify import REMOVED, classify_edges
from remeshvec.operations.split import SPARE, compact, split_long_edges


@pytest.mark.parametrize("per_block", [16, 100, 10**6])
@pytest.mark.parametrize("name", [*OPEN, *CLOSED])
def test_compaction_is_that_of_the_twin(name, per_block, monkeypatch):
    """Live elements in their order, bit for bit; room only where it is asked for."""
    mesh, reference = holed(name, 0, 50, monkeypatch)
    expected = packed(mesh)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    before = copied(mesh)
    done = compact(mesh, blocks, False)
    assert_same_bits(done, expected)
    assert_same_bits(mesh, before)
    assert_on_reference(done, reference)
    roomy = compact(mesh, blocks, False, 0.3)
    assert_valid(roomy)
    assert_same_bits(packed(roomy), expected)
    free = [int(0.3 * n) for n in live_faces(mesh, blocks)]
    assert numbers(roomy) == numbers(mesh)
    assert len(roomy.origin) // 3 == numbers(mesh)[0] + sum(free)
    assert len(roomy.X) == numbers(mesh)[1] + sum(n // 2 for n in free)
    end = 0
    for n, room in zip(live_faces(mesh, blocks), free, strict=True):
        dead = roomy.origin.reshape(-1, 3)[end : end + n + room] == DEAD
        assert not dead[:n].any() and dead[n:].all()
        end += n + room
    assert (roomy.kind[roomy.vertex_halfedge == DEAD] == INNER).all()
    assert np.isfinite(roomy.X).all() and (roomy.X[:, 3] > 0).all()


def live_faces(mesh, blocks):
    alive = np.r_[0, np.cumsum(mesh.origin[::3] != DEAD)]
    return np.diff(alive[blocks.face]).tolist()


@pytest.mark.parametrize("per_block", [16, 10**6])
@pytest.mark.parametrize("name", ["torus", "annulus"])
def test_a_new_mesh_has_room_in_every_block(name, per_block, monkeypatch):
    """For as many splits as are worth it."""
    mesh, _ = holed(name, 0, 50, monkeypatch)
    refined, count = split_long_edges(mesh, blocks_of(mesh, per_block, monkeypatch), 0.2, False)
    assert count > 0
    assert_valid(refined)
    faces, vertices = numbers(refined)
    assert SPARE * faces - len(mesh.origin) / per_block - 1 <= len(refined.source) - faces
    assert len(refined.source) - faces <= SPARE * faces
    assert (len(refined.X) - vertices) * 2 <= SPARE * faces
    blocks = make_blocks(refined)
    flags = classify_edges(refined, blocks, 0.2, 0.0, False)
    assert flags.n_gone == len(refined.source) - faces
    assert (flags.mask == REMOVED).sum() == flags.n_gone


def test_compaction_forgets_garbage():
    """Whatever dead elements held, a mesh with room is the same but for them."""
    mesh, _ = spotted("genus_2")
    for room in (0.0, 0.5):
        done = [
            compact(
                with_room(mesh, 60, 40, np.random.default_rng(seed)), one_block(mesh), False, room
            )
            for seed in range(3)
        ]
        for other in done[1:]:
            assert_same_bits(done[0], other)
