"""Make the meshes in this folder, and check them.

``python data/make_meshes.py`` writes the meshes and the table in README.md; with ``--check`` it
writes nothing, makes every mesh again and says which file differs.  Needs NumPy and libigl.
Everything is seeded: on one platform the files come out byte for byte.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import igl
import numpy as np
from shapes import bracket, sculpted
from shapes.sculpted import Floats, Ints

HERE = Path(__file__).resolve().parent
TABLE_HEAD = (
    "| file | vertices | faces | Euler number | boundary loops | components | SHA-256 |\n"
    "|---|---|---|---|---|---|---|\n"
)

MESHES: dict[
    str, tuple[Callable[[], tuple[Floats | Ints, ...]], int]
] = {  # name -> maker, decimals
    "creature.obj": (sculpted.creature, 5),
    "bracket.obj": (bracket.bracket, 6),
    "wavy_sheet.obj": (sculpted.wavy_sheet, 5),
    "pretzel.off": (sculpted.pretzel, 5),
    "linked_rings.off": (sculpted.linked_rings, 5),
    "thin_sheet.obj": (sculpted.thin_sheet, 5),
    "vase.obj": (sculpted.vase, 5),  # with texture coordinates
}
MATERIAL = "newmtl painted\nKd 1 1 1\nmap_Kd vase.png\n"


def as_text(name: str, V: Floats, F: Ints, decimals: int, uv: Floats | None = None) -> str:
    """Write OBJ or OFF with as many digits as the mesh needs; texture coordinates (m, 3, 2) in OBJ."""
    V = np.round(V, decimals) + 0.0  # + 0.0 turns -0 into 0
    rows = [" ".join(f"{x:.{decimals}f}".rstrip("0").rstrip(".") for x in p) for p in V]
    if uv is not None:
        known, at = np.unique(uv.reshape(-1, 2).round(decimals), axis=0, return_inverse=True)
        corners = np.stack([F, at.reshape(F.shape)], axis=2).reshape(-1, 6) + 1
        head = [f"mtllib {name[:-4]}.mtl"]
        textures = [f"vt {s:.{decimals}f} {t:.{decimals}f}" for s, t in known.tolist()]
        faces = ["f {}/{} {}/{} {}/{}".format(*f) for f in corners.tolist()]
        return "\n".join(
            [*head, *("v " + row for row in rows), *textures, "usemtl painted", *faces, ""]
        )
    if name.endswith(".obj"):
        faces = ["f {} {} {}".format(*f) for f in (F + 1).tolist()]
        return "\n".join([*("v " + row for row in rows), *faces, ""])
    faces = ["3 {} {} {}".format(*f) for f in F.tolist()]
    return "\n".join(["OFF", f"{len(V)} {len(F)} 0", *rows, *faces, ""])


def validated(name: str, V: Floats, F: Ints, decimals: int) -> None:
    """Stop on a mesh that is not what README.md promises."""
    V = np.round(V, decimals)
    checks = {
        "edge-manifold": igl.is_edge_manifold(F),
        "vertex-manifold": bool(igl.is_vertex_manifold(F).all()),
        "without flat faces": bool((igl.doublearea(V, F) > 0).all()),
        "without unreferenced vertices": len(np.unique(F)) == len(V),
        "oriented": len(np.unique(directed_edges(F), axis=0)) == 3 * len(F),
    }
    wrong = [what for what, ok in checks.items() if not ok]
    if wrong:
        raise SystemExit(f"{name} is not {' or '.join(wrong)}")


def directed_edges(F: Ints) -> Ints:
    """Return the edges of the faces, one row a corner."""
    return np.vstack([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])


def table_row(name: str, V: Floats, F: Ints, text: str) -> str:
    """Count, and hash."""
    edges = len(np.unique(np.sort(directed_edges(F), axis=1), axis=0))
    loops = len(igl.boundary_loop_all(F)) if len(igl.boundary_facets(F)[0]) else 0
    parts = len(np.unique(igl.facet_components(F)[1]))
    counts = f"{len(V):,} | {len(F):,} | {len(V) - edges + len(F)} | {loops} | {parts}"
    return f"| {name} | {counts} | `{hashlib.sha256(text.encode()).hexdigest()}` |\n"


def as_png(image: Ints, palette: Ints) -> bytes:
    """Write a PNG file with a palette, not compressed, so that it is the same with every zlib."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        check = zlib.crc32(kind + content).to_bytes(4, "big")
        return len(content).to_bytes(4, "big") + kind + content + check

    height, width = image.shape
    size = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    rows = np.column_stack([np.zeros(height, np.uint8), image.astype(np.uint8)]).tobytes()
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        [
            chunk(b"IHDR", size + bytes([8, 3, 0, 0, 0])),
            chunk(b"PLTE", palette.astype(np.uint8).tobytes()),
            chunk(b"IDAT", zlib.compress(rows, 0)),
            chunk(b"IEND", b""),
        ]
    )


def main() -> int:
    """Write or check the meshes and the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, report differences")
    check = parser.parse_args().check
    different, table = [], TABLE_HEAD
    for name, (make, decimals) in MESHES.items():
        V, F, *uv = make()
        validated(name, V, F, decimals)
        text = as_text(name, V, F, decimals, *uv)
        table += table_row(name, V, F, text)
        path = HERE / name
        if check and (not path.exists() or path.read_bytes() != text.encode()):
            different.append(name)
        if not check:
            path.write_bytes(text.encode())
            print(f"{name:<18}{len(V):>7} vertices{len(F):>7} faces{len(text) / 1e3:>7.0f} kB")
    for name, content in (
        ("vase.mtl", MATERIAL.encode()),
        ("vase.png", as_png(*sculpted.vase_texture())),
    ):
        path = HERE / name
        if check and (not path.exists() or path.read_bytes() != content):
            different.append(name)
        if not check:
            path.write_bytes(content)
    readme = HERE / "README.md"
    text = readme.read_text(encoding="utf-8")
    start, stop = text.rindex("| file |"), text.rindex("|\n") + 2
    if check and text[start:stop] != table:
        different.append("README.md")
    if not check:
        readme.write_text(text[:start] + table + text[stop:], encoding="utf-8")
    for name in different:
        print(f"{name} differs from what this script makes", file=sys.stderr)
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
