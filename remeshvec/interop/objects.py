"""Mesh objects of other libraries, recognised by their attributes, so that no library is imported.

These are trimesh.Trimesh, pyvista.PolyData, meshio.Mesh and open3d.geometry.TriangleMesh. A reader
returns the mesh with its data, and a function ``wrap`` that makes a new object of the same type.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..core.check import as_mesh
from ..errors import MeshInputError
from .mesh_data import Data, MeshData
from .meshio_data import is_meshio, read_meshio

__all__ = ["is_mesh_object", "read_object"]


def is_mesh_object(value: Any) -> bool:
    """Tell whether a value has the attributes of a mesh that `read_object` knows."""
    return any(knows(value) for knows, _ in _KINDS)


def read_object(mesh: Any) -> MeshData:
    """Return the arrays of a mesh object and its data.

    Raises
    ------
    MeshInputError
        The object does not hold triangles, or its type is unknown.
    """
    for knows, read in _KINDS:
        if knows(mesh):
            data = read(mesh)
            as_mesh(data.V, data.F)  # checked before data are indexed by faces
            return data
    if isinstance(mesh, str | os.PathLike):
        raise MeshInputError(f"{mesh} is a path: remesh_file remeshes files, read_mesh reads them")
    raise MeshInputError(
        f"{type(mesh).__module__}.{type(mesh).__qualname__} is not a mesh of a known type; "
        f"{_remedy(mesh)}"
    )


def _remedy(value: Any) -> str:
    """Say what to give instead of something that is not a mesh."""
    if _has(value, "combine", "n_blocks", "keys"):  # pyvista.MultiBlock
        return "remesh its blocks one by one, or blocks.combine().extract_surface() as one"
    if _has(value, "geometry", "graph", "to_mesh"):  # trimesh.Scene
        return "remesh the meshes of scene.dump() one by one, or scene.to_mesh() as one"
    return "give V and F, or an object of trimesh, pyvista, meshio or open3d"


def _has(value: Any, *names: str) -> bool:
    return all(hasattr(value, name) for name in names)


def _rows(data: Any, count: int) -> Data:
    """Return the arrays by name that have ``count`` rows."""
    arrays = {str(name): np.asarray(data[name]) for name in data.keys()}  # noqa: SIM118
    return {name: x for name, x in arrays.items() if x.ndim >= 1 and len(x) == count}


# -- trimesh ----------------------------------------------------------------------------------

# Names that do not collide with names of attributes.
UV, COLOUR, MATERIAL = "visual:uv", "visual:colour", "visual:material"


def _is_trimesh(value: Any) -> bool:
    return _has(value, "vertices", "faces", "visual", "vertex_attributes", "face_attributes")


def read_trimesh(mesh: Any) -> MeshData:
    """Read a ``trimesh.Trimesh`` with colours, texture coordinates and attributes."""
    V, F = np.array(mesh.vertices), np.array(mesh.faces)
    on_vertices = _rows(mesh.vertex_attributes, len(V))
    on_faces = _rows(mesh.face_attributes, len(F))
    feature_data = []
    visual = mesh.visual
    if visual.kind == "texture" and visual.uv is not None and len(visual.uv) == len(V):
        on_vertices[UV] = np.asarray(visual.uv)
        feature_data.append(UV)
        materials = getattr(visual, "face_materials", None)
        if materials is not None and len(materials) == len(F):
            on_faces[MATERIAL] = np.asarray(materials)
            feature_data.append(MATERIAL)
    elif visual.kind == "vertex":
        on_vertices[COLOUR] = np.asarray(visual.vertex_colors)
    elif visual.kind == "face":
        on_faces[COLOUR] = np.asarray(visual.face_colors)
    return MeshData(
        V, F, on_vertices, on_faces, {}, tuple(feature_data), (), partial(_to_trimesh, mesh)
    )


def _to_trimesh(mesh: Any, data: MeshData) -> Any:
    new = type(mesh)(
        vertices=data.V,
        faces=data.F,
        vertex_attributes={k: x for k, x in data.on_vertices.items() if k not in (UV, COLOUR)},
        face_attributes={k: x for k, x in data.on_faces.items() if k not in (COLOUR, MATERIAL)},
        metadata=dict(mesh.metadata),
        process=False,
    )
    if UV in data.on_vertices:
        options = {"face_materials": data.on_faces[MATERIAL]} if MATERIAL in data.on_faces else {}
        new.visual = type(mesh.visual)(
            uv=data.on_vertices[UV], material=mesh.visual.material, **options
        )
    elif COLOUR in data.on_vertices:
        new.visual.vertex_colors = data.on_vertices[COLOUR]
    elif COLOUR in data.on_faces:
        new.visual.face_colors = data.on_faces[COLOUR]
    return new


# -- pyvista ----------------------------------------------------------------------------------


def _is_pyvista(value: Any) -> bool:
    return _has(value, "points", "point_data", "cell_data", "GetNumberOfCells")


def read_pyvista(mesh: Any) -> MeshData:
    """Read a ``pyvista.PolyData`` with point, cell and field data; polygons are triangulated."""
    if not _has(mesh, "is_all_triangles"):  # regular_faces raises where polygons are mixed
        raise MeshInputError(f"{type(mesh).__name__} is not a surface; use mesh.extract_surface()")
    others = mesh.n_lines + mesh.n_verts
    if others:
        _warn(f"{others} lines and vertex cells are not remeshed and are left out")
    surface = mesh if mesh.is_all_triangles and not others else mesh.triangulate()
    if not surface.n_cells:
        raise MeshInputError("the PolyData has no faces")
    on_points = _rows(surface.point_data, surface.n_points)
    feature_data = [name for name in [surface.point_data.active_texture_coordinates_name] if name]
    normals = [name for name in [surface.point_data.active_normals_name] if name]
    return MeshData(
        np.array(surface.points),
        np.array(surface.regular_faces),
        on_points,
        _rows(surface.cell_data, surface.n_cells),
        {},
        tuple(feature_data),
        tuple(normals),
        partial(_to_pyvista, mesh),
    )


def _to_pyvista(mesh: Any, data: MeshData) -> Any:
    new = type(mesh).from_regular_faces(data.V, data.F)
    for name, values in data.on_vertices.items():
        new.point_data[name] = values
    for name, values in data.on_faces.items():
        new.cell_data[name] = values
    for name in mesh.field_data.keys():  # noqa: SIM118
        new.field_data[name] = mesh.field_data[name]
    for old, now in ((mesh.point_data, new.point_data), (mesh.cell_data, new.cell_data)):
        now.active_scalars_name = old.active_scalars_name
    for kind in ("active_texture_coordinates_name", "active_normals_name"):
        setattr(new.point_data, kind, getattr(mesh.point_data, kind))
    return new


# -- open3d -----------------------------------------------------------------------------------


def _is_open3d(value: Any) -> bool:
    return _has(value, "vertices", "triangles", "triangle_uvs", "vertex_colors")


def read_open3d(mesh: Any) -> MeshData:
    """Read an ``open3d.geometry.TriangleMesh`` with colours, texture coordinates and materials."""
    V, F = np.array(mesh.vertices), np.array(mesh.triangles)
    data = MeshData(V, F, wrap=partial(_to_open3d, mesh))
    if mesh.has_vertex_colors():
        data.on_vertices[COLOUR] = np.array(mesh.vertex_colors)
    feature_data = []
    if mesh.has_triangle_uvs():
        data.on_corners[UV] = np.array(mesh.triangle_uvs).reshape(-1, 3, 2)
        feature_data.append(UV)
    if mesh.has_triangle_material_ids():
        data.on_faces[MATERIAL] = np.array(mesh.triangle_material_ids)
        feature_data.append(MATERIAL)
    data.feature_data = tuple(feature_data)
    return data


def _to_open3d(mesh: Any, data: MeshData) -> Any:
    new = type(mesh)()
    new.vertices = type(mesh.vertices)(np.asarray(data.V, np.float64))
    new.triangles = type(mesh.triangles)(np.asarray(data.F, np.int32))
    if COLOUR in data.on_vertices:
        new.vertex_colors = type(mesh.vertex_colors)(data.on_vertices[COLOUR])
    if UV in data.on_corners:
        new.triangle_uvs = type(mesh.triangle_uvs)(data.on_corners[UV].reshape(-1, 2))
    if MATERIAL in data.on_faces:
        ids = type(mesh.triangle_material_ids)(data.on_faces[MATERIAL].astype(np.int32))
        new.triangle_material_ids = ids
    if mesh.has_textures():
        new.textures = mesh.textures
    if mesh.has_triangle_normals():
        new.compute_triangle_normals()
    if mesh.has_vertex_normals():
        new.compute_vertex_normals()
    return new


def _warn(text: str) -> None:
    warnings.warn(text, stacklevel=5)


_KINDS: list[tuple[Callable[[Any], bool], Callable[[Any], MeshData]]] = [
    (_is_trimesh, read_trimesh),
    (_is_pyvista, read_pyvista),
    (_is_open3d, read_open3d),
    (is_meshio, read_meshio),
]
