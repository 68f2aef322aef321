"""Scenes of trimesh, as glTF files hold them: one mesh per object and material, images inside."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..interop.mesh_data import MeshData, corner_values
from ..interop.objects import COLOUR, MATERIAL, UV, read_trimesh
from .materials import WHITE, Material, image_bytes, known_materials, unique_names

__all__ = ["read_parts", "read_scene", "scene_bytes"]

# Data on faces that a scene can hold.
_ON_FACES = {"object", "material", "color"}


def read_scene(scene: Any) -> MeshData:
    """Join all meshes of a scene in place."""
    parts = [mesh for mesh in scene.dump(concatenate=False) if hasattr(mesh, "faces")]
    if not parts:
        raise ValueError("it holds no triangle mesh")
    return read_parts(parts)


def read_parts(parts: list[Any]) -> MeshData:
    """Join meshes of trimesh; where there are several, each is an object.

    Texture coordinates lie on corners, colours are called ``"color"``, as other files have them.
    """
    read = [_with_file_names(read_trimesh(mesh)) for mesh in parts]
    start = np.cumsum([0, *(len(part.V) for part in read)])
    out = MeshData(
        np.concatenate([part.V for part in read]),
        np.concatenate([part.F + n for part, n in zip(read, start, strict=False)]),
    )
    for side in ("on_vertices", "on_faces", "on_corners"):
        counts = [len(part.V if side == "on_vertices" else part.F) for part in read]
        tables = [getattr(part, side) for part in read]
        for name in dict.fromkeys(name for table in tables for name in table):
            values = _joined([table.get(name) for table in tables], counts)
            if values is not None:
                getattr(out, side)[name] = values
    _read_materials(out, parts)
    out.extra["scene"] = [(dict(part.metadata), part.visual.kind) for part in parts]
    if len(parts) > 1:
        names = (str(part.metadata.get("name") or "mesh") for part in parts)
        out.extra["object"] = unique_names(names)
        out.on_faces["object"] = _number_of_part(parts)
    features = ("uv", "material", "object")
    out.feature_data = tuple(name for name in features if name in out.on_corners | out.on_faces)
    return out


def _with_file_names(data: MeshData) -> MeshData:
    """Give data of a trimesh the names that files use."""
    uv = data.on_vertices.pop(UV, None)
    if uv is not None:
        data.on_corners["uv"] = corner_values(uv, data.F)
    for table in (data.on_vertices, data.on_faces):
        if COLOUR in table:
            table["color"] = table.pop(COLOUR)
    data.on_faces.pop(MATERIAL, None)
    return data


def _number_of_part(parts: list[Any]) -> NDArray[np.int64]:
    return np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])


def _read_materials(data: MeshData, parts: list[Any]) -> None:
    """Put the materials of the parts into a mesh."""
    looks = [getattr(part.visual, "material", None) for part in parts]
    different = list({id(look): look for look in looks if look is not None}.values())
    if not different:
        return
    names = unique_names(str(getattr(look, "name", None) or "") for look in different)
    data.extra["material"] = names
    data.extra["materials"] = [_read_material(*it) for it in zip(names, different, strict=True)]
    number = {id(look): k for k, look in enumerate(different)}
    labels = np.array([number.get(id(look), -1) for look in looks])
    data.on_faces["material"] = labels[_number_of_part(parts)]


def _read_material(name: str, look: Any) -> Material:
    image = getattr(look, "baseColorTexture", None) or getattr(look, "image", None)
    factor = getattr(look, "baseColorFactor", None)
    color = WHITE if factor is None else tuple(float(x) / 255 for x in np.asarray(factor)[:4])
    return Material(name, color, None if image is None else _png(image), look)


def _png(image: Any) -> bytes:
    """Return an image of PIL as PNG, whose pixels are those of the image."""
    content = io.BytesIO()
    image.save(content, format="PNG")
    return content.getvalue()


def _joined(arrays: list[Any], counts: list[int]) -> Any:
    """Concatenate arrays, with zeros for missing ones; None if their shapes differ."""
    known = [x for x in arrays if x is not None]
    if len({x.shape[1:] for x in known}) > 1:
        return None
    blank = [np.zeros((n, *known[0].shape[1:]), known[0].dtype) for n in counts]
    return np.concatenate([b if x is None else x for x, b in zip(arrays, blank, strict=True)])


def scene_bytes(trimesh: Any, data: MeshData, file_type: str) -> tuple[bytes, set[str]]:
    """Return a file of a scene, and the names of the data in it; all data lie on vertices or faces."""
    scene = trimesh.Scene()
    for name, mesh in _parts(trimesh, data):
        scene.add_geometry(mesh, geom_name=name, node_name=name)
    held = {*data.on_vertices, *(set(data.on_faces) & _ON_FACES)}
    return bytes(scene.export(file_type=file_type)), held


def _parts(trimesh: Any, data: MeshData) -> Iterator[tuple[str, Any]]:
    """Make one mesh per object and material; yields their names too."""
    none = np.zeros(len(data.F), np.int64)
    labels = np.stack([data.on_faces.get("object", none), data.on_faces.get("material", none)])
    pairs, member = np.unique(labels, axis=1, return_inverse=True)
    materials = _trimesh_materials(trimesh, data)
    objects, scene = data.extra.get("object", []), data.extra.get("scene", [])
    titles = [objects[k] if 0 <= k < len(objects) else "mesh" for k in pairs[0]]
    for number, name in enumerate(unique_names(titles)):
        rows = np.flatnonzero(member.ravel() == number)
        part, look = pairs[:, number]
        metadata, kind = scene[part] if 0 <= part < len(scene) else ({}, None)
        material = materials[look] if 0 <= look < len(materials) else None
        mesh = _trimesh(trimesh, _rows(data, rows), material, kind)
        mesh.metadata.update(metadata)
        yield name, mesh


def _rows(data: MeshData, rows: NDArray[np.int64]) -> MeshData:
    """Return some faces of a mesh with their vertices."""
    used, F = np.unique(data.F[rows], return_inverse=True)
    on_vertices = {name: x[used] for name, x in data.on_vertices.items()}
    on_faces = {name: x[rows] for name, x in data.on_faces.items()}
    return MeshData(data.V[used], F.reshape(-1, 3), on_vertices, on_faces)


def _trimesh_materials(trimesh: Any, data: MeshData) -> list[Any]:
    return [
        _trimesh_material(trimesh, material) if material.native is None else material.native
        for material in known_materials(data)
    ]


def _trimesh_material(trimesh: Any, material: Material) -> Any:
    content = image_bytes(material)
    image = None
    if content is not None:
        from PIL import Image

        image = Image.open(io.BytesIO(content)).copy()  # a copy is written as PNG, without loss
    return trimesh.visual.material.PBRMaterial(
        name=material.name,
        baseColorFactor=np.rint(255 * np.array(material.color)).astype(np.uint8),
        baseColorTexture=image,
        metallicFactor=0.0,
        roughnessFactor=1.0,
    )


def _trimesh(trimesh: Any, data: MeshData, material: Any, kind: str | None) -> Any:
    """Make a mesh that looks as its data say; ``kind`` tells which of them were its looks before."""
    mesh = trimesh.Trimesh(data.V, data.F, process=False)
    uv, colour = data.on_vertices.get("uv"), data.on_vertices.get("color")
    if kind in (None, "texture") and (uv is not None or material is not None):
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
        if colour is not None:
            mesh.visual.vertex_attributes["color"] = _with_alpha(_bytes(colour))
    elif colour is not None and kind in (None, "vertex"):
        mesh.visual.vertex_colors = _bytes(colour)
    elif "color" in data.on_faces and kind in (None, "face"):
        mesh.visual.face_colors = _bytes(data.on_faces["color"])
    for name, values in data.on_vertices.items():
        if name not in ("uv", "color", "normal") and values.dtype.kind in "fiub":
            plain = values.astype(np.uint8) if values.dtype.kind == "b" else values
            mesh.vertex_attributes[name if name.startswith("_") else f"_{name}"] = plain
    return mesh


def _with_alpha(colour: Any) -> Any:
    return np.column_stack([colour, np.full(len(colour), 255, np.uint8)][: 5 - colour.shape[1]])


def _bytes(colour: Any) -> Any:
    return np.rint(255 * colour).astype(np.uint8) if colour.dtype.kind == "f" else colour
