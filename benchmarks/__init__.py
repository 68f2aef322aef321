"""Benchmarks: run from the root of the repository, with the package installed.

- ``python -m benchmarks``: time and memory beside other libraries, threads, start, phases; by parts
  (``--help`` lists them), into ``docs/benchmarks.md``, ``threads.md``, ``start.md`` and plots
- ``python -m benchmarks.presets``: what each preset costs and brings
- ``python -m benchmarks.quality``: quality of every preset, beside the targets
- ``python -m benchmarks.control``: what features cost, tolerances and deviations kept
- ``python -m benchmarks.scans``: one command from a scan to an even surface; noise and holes
- ``python -m benchmarks.ablation``: what each ingredient of the default preset brings
- ``python -m benchmarks.pictures``: a picture of every feature, into ``docs/pictures/``
- ``pytest benchmarks``: phases, whole calls and starts one at a time, with pytest-benchmark

Peers and plots come with ``pip install remeshvec[peers]``; PMP is an executable that the environment
variable ``REMESHVEC_PMP`` names (`peers.pmp`).
"""
