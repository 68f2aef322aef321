"""Benchmarks: run from the root of the repository, with the package installed.

- ``python -m benchmarks.compare``: time and quality beside trueform, gpytoolbox and PyMeshLab
- ``python -m benchmarks.quality``: quality of every preset, beside the targets
- ``python -m benchmarks.start``: import, first call, compilation
- ``python -m benchmarks.threads``: one thread against several, same bytes
- ``python -m benchmarks.control``: what features cost, tolerances and deviations kept
- ``python -m benchmarks.pictures``: a picture of every feature, into ``docs/pictures/``
- ``pytest benchmarks``: one phase at a time

Each writes a page into ``docs/``; the peers come with ``pip install remeshvec[peers]``.
"""
