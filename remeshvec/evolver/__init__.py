"""Capillary surfaces: minimised natively or by Surface Evolver, remeshed as they evolve."""

from .errors import EvolverError
from .evolve import Evolution, Frame, evolve, write_frames
from .minimize import Minimum, minimize
from .necks import cut_necks
from .problem import CapillaryProblem
from .surface_evolver import EvolverBackend, read_dump, write_fe

__all__ = [
    "CapillaryProblem",
    "Evolution",
    "EvolverBackend",
    "EvolverError",
    "Frame",
    "Minimum",
    "cut_necks",
    "evolve",
    "minimize",
    "read_dump",
    "write_fe",
    "write_frames",
]


def __dir__() -> list[str]:
    return list(__all__)
