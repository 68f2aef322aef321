"""Capillary surfaces: minimised natively or by Surface Evolver, remeshed as they evolve."""
