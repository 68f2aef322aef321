"""Meshes with dead elements, and with target lengths that make a few edges long."""

from __future__ import annotations

import numpy as np

from helpers import naive, zoo
from helpers.structure import blocks_of, built, faces_of, featured, one_block
from remeshvec.core.vocabulary import DEAD, Mesh
from remeshvec.mesh.blocks import make_blocks
from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.split import SPARE, compact

OPEN = ["grid", "annulus", "planar_delaunay", "cylinder"]
CLOSED = ["torus", "genus_2", "closed_cylinder", "l_prism", "icosphere"]


def with_room(mesh, n_faces, n_vertices, rng=None):
    """The mesh with dead faces and vertices at its end, whose other arrays hold anything."""
    rng = rng or np.random.default_rng(0)
    anything = lambda n: rng.integers(-5, 10**6, n).astype(np.int32)  # noqa: E731
    dead = Mesh(
        np.full(3 * n_faces, DEAD, np.int32),
        anything(3 * n_faces),
        anything(3 * n_faces),
        anything(n_faces),
        np.full(n_vertices, DEAD, np.int32),
        anything(n_vertices),
        rng.uniform(0.5, 2.0, (n_vertices, 4)),
        rng.integers(0, 5, n_vertices).astype(np.uint8),
        anything(n_vertices),
    )
    return Mesh(*(np.concatenate(pair) for pair in zip(mesh, dead, strict=True)))


def spotted(name, seed=0, count=3):
    """Mesh with features; short target lengths around some vertices, so that few edges are long."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=1, noise=0.2, seed=seed)
    mesh = built(V, F, ordered=True)
    reference = featured(mesh, 2 * longest_edge(V, F), feature_angle=40.0).reference
    add_spots(mesh, zoo.mean_edge(V, F), seed, count)
    return mesh, reference


def longest_edge(V, F):
    return max(naive.edge_length(V, e) for e in naive.edges(F))


def add_spots(mesh, length, seed, count):
    """Shorten the target lengths in the closed rings of some vertices."""
    rng = np.random.default_rng(seed)
    ring = naive.neighbours(faces_of(mesh))
    for v in rng.choice(sorted(ring), min(count, len(ring)), replace=False).tolist():
        around = [v, *sorted(ring[v])]
        mesh.X[around, 3] = length * rng.uniform(0.4, 0.8, len(around))


def few_long(name, seed=0):
    mesh, reference = spotted(name, seed, 1)
    return compact(mesh, one_block(mesh), False, 4.0), reference


def holed(name, seed, per_block, monkeypatch, count=6):
    """Mesh in many blocks with the holes of collapses, room at their ends, and spots of short lengths."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=2, noise=0.3, seed=seed)
    mesh = built(V, F, ordered=True)
    L = zoo.mean_edge(V, F)
    reference = featured(mesh, L, feature_angle=40.0).reference
    mesh = compact(mesh, blocks_of(mesh, per_block, monkeypatch), False, SPARE)
    limits = CollapseLimits(0.8, 1.5, 0.7, 0.5, False)
    collapse_short_edges(mesh, make_blocks(mesh), limits, False)
    mesh.X[:, 3] = 2 * longest_edge(mesh.X[:, :3], faces_of(mesh))
    add_spots(mesh, L, seed, count)
    return mesh, reference


def numbers(mesh):
    """Live faces and vertices."""
    return len(faces_of(mesh)), int((mesh.vertex_halfedge != DEAD).sum())
