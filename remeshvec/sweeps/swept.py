"""What sweeps start from, what comes of them, and how good that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.vocabulary import FloatArray, Mesh
from ..input.constraints import ConstraintMasks
from ..reference.build import FeaturedReference
from .flaws import volume_change
from .loop import Stop
from .work import Work

__all__ = ["Start", "Swept", "start_of"]

# Shorter edges are worth their faces if no more than this share of the flaws is left.
_WORTH = 0.5

# A surface of which more than this share has another sheet near is looked at for a lost volume: rods and
# tubes thinner than L lose three quarters of it, without a fold. Others lose a few percent at most.
_MOSTLY = 0.1
_LOSS = 0.1


class Start(NamedTuple):
    """What the sweeps start from."""

    mesh: Mesh  # with its lengths and features; sweeps work on copies
    featured: FeaturedReference
    marks: ConstraintMasks | None = None  # None for parts of a surface
    gap: FloatArray | None = None  # (m,) see `find_gaps`; None where lengths are not bound by it
    clearance: dict[str, float] | None = None  # what was done where sheets are near, see `Report`


def start_of(
    mesh: Mesh,
    featured: FeaturedReference,
    marks: ConstraintMasks | None = None,
    gap: FloatArray | None = None,
) -> Start:
    """Copy a mesh that sweeps will change, but for what the reference holds already: 28 bytes a face."""
    reference = featured.reference
    if not np.array_equal(reference.origin, mesh.origin):  # a part, beside a larger reference
        return Start(mesh.copy(), featured, marks, gap)
    is_same = np.array_equal(reference.X[:, 3], mesh.X[:, 3])  # not where long rims raise lengths
    X = reference.X if is_same else mesh.X.copy()
    kept = mesh._replace(origin=reference.origin[:0], X=X[:0]).copy()
    return Start(kept._replace(origin=reference.origin, X=X), featured, marks, gap)


@dataclass(frozen=True)
class Swept:
    """A mesh after the sweeps."""

    start: Start
    work: Work
    stop: Stop
    counts: list[dict[str, int]]
    n_flaws: int  # vertices at flaws that the mesh did not have before
    n_crossings: int = 0  # vertices of faces that cross others and did not, where they were counted

    @property
    def is_clean(self) -> bool:
        """Whether nothing wrong is known."""
        return not (self.n_flaws or self.n_crossings)

    @property
    def loss(self) -> float:
        """Share of its volume by which a closed surface has changed."""
        return volume_change(self.start.mesh, self.work.mesh)

    @property
    def has_lost(self) -> bool:
        """Whether a surface that is thin at many places has lost much of its volume."""
        gap = self.start.gap
        return gap is not None and np.isfinite(gap).mean() > _MOSTLY and self.loss > _LOSS

    def is_far_better(self, other: Swept) -> bool:
        """Whether no more than half of what is wrong with another one is wrong with this."""
        if other.is_clean:
            return self.is_clean and self.loss < _WORTH * other.loss
        if self.n_flaws > other.n_flaws:
            return False
        return self.n_flaws + self.n_crossings <= _WORTH * (other.n_flaws + other.n_crossings)
