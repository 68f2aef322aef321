"""Pictures of a mesh before and after, with PyVista (the extra ``[viz]``)."""

from .pictures import (
    PICTURE_SUFFIXES,
    ViewerMissingError,
    picture,
    require_viewer,
    show,
    three_quarter_view,
)

__all__ = [
    "PICTURE_SUFFIXES",
    "ViewerMissingError",
    "picture",
    "require_viewer",
    "show",
    "three_quarter_view",
]


def __dir__() -> list[str]:
    return list(__all__)
