"""Random meshes and options, thrown at `remesh`, and checks of what comes back.

``python -m tests.fuzz --minutes 10 --seed 1`` runs as many cases as fit; a case follows from one number.
"""
