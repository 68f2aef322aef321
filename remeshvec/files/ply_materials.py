"""Materials in PLY files: comments name images and libraries, a number on every face chooses one.

``TextureFile`` and ``texnumber`` are those of MeshLab; ``mtllib`` and ``usemtl`` those of OBJ.
"""

from __future__ import annotations

import os
from collections import defaultdict
from pathlib import Path

import numpy as np

from ..interop.mesh_data import Data, MeshData
from .materials import Material, in_line, known_materials, relative, unique_names

__all__ = ["read_materials", "written_materials"]

_IMAGE, _LIBRARY, _NAME, _NUMBER = "TextureFile", "mtllib", "usemtl", "texnumber"


def read_materials(data: MeshData, comments: list[str], folder: Path) -> None:
    """Put materials that comments name into a mesh; all other comments are kept as they are."""
    said = defaultdict(list)
    for line in comments:
        keyword, _, operand = line.strip().partition(" ")
        said[keyword].append(operand.strip())
    has_textures = bool(said[_IMAGE]) and "uv" in data.on_corners
    data.extra["comments"] = comments
    if not (said[_NAME] or has_textures):
        return
    data.extra["comments"] = [
        line for line in comments if line.split(" ")[0] not in (_IMAGE, _LIBRARY, _NAME)
    ]
    images = [Path(os.path.realpath(folder / name)) for name in said[_IMAGE]]
    names = said[_NAME] or unique_names(image.stem for image in images)
    if said[_LIBRARY]:
        data.extra["mtllib"] = [os.path.realpath(folder / name) for name in said[_LIBRARY]]
    else:
        shown = [*images, *[None] * len(names)][: len(names)]
        pairs = zip(names, shown, strict=True)
        data.extra["materials"] = [Material(name, image=image) for name, image in pairs]
    data.extra["material"] = names
    number = data.on_faces.pop(_NUMBER, data.on_faces.get("material"))
    data.on_faces["material"] = (
        np.zeros(len(data.F), np.int32) if number is None else number.astype(np.int32)
    )


def written_materials(data: MeshData, path: Path) -> tuple[list[str], Data]:
    """Return the comments of a file and the data on its faces, with the materials as PLY has them."""
    comments, on_faces = list(data.extra.get("comments", [])), dict(data.on_faces)
    if "material" not in on_faces or not data.extra.get("material"):
        return comments, on_faces
    materials = known_materials(data)
    # Those with images come first, so that their numbers count the images.
    order = sorted(range(len(materials)), key=lambda k: materials[k].image is None)
    libraries = data.extra.get("mtllib", [])
    comments += [f"{_LIBRARY} {in_line(relative(library, path))}" for library in libraries]
    names = [materials[k].name for k in order]
    images = [it.image for k in order if isinstance((it := materials[k]).image, Path)]
    if libraries or names != unique_names(image.stem for image in images):
        comments += [f"{_NAME} {in_line(name)}" for name in names]
    comments += [f"{_IMAGE} {in_line(relative(image, path))}" for image in images]
    label = on_faces.pop("material")
    number = np.r_[np.argsort(order), -1].astype(np.int32)
    label = np.where((label >= 0) & (label < len(order)), label, len(order))
    if len(order) > 1 or (label != 0).any():
        on_faces[_NUMBER] = number[label]
    return comments, on_faces
