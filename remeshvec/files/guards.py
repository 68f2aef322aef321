"""What a mesh file must pass before a library may read it.

libigl's readers trust the file: they allocate what a header claims, read past short lines into
memory that was never written, and abort the whole process on a face with one corner. The guards
here refuse such files and hand over a *copy* that holds only what was checked: points with three
numbers and faces with enough indices, without comments, normals, colours and texture coordinates.
Texture seams can thus not split a vertex. Every guard raises ``ValueError`` with the reason;
`mesh_files.read_mesh` adds the file's name.
"""

from __future__ import annotations

import re
import stat
from pathlib import Path
from typing import NamedTuple

__all__ = [
    "MeshCopy",
    "check_obj",
    "check_off",
    "check_room",
    "check_stl",
    "checked_bytes",
    "off_copy",
    "text_lines",
]

# The whole file is held in memory, and copied once; beyond this a 32-bit index would not do either.
MAX_BYTES = 4 << 30

# A number that fits a double (the exponent stops at 307), and an index that fits 32 bits. Both are
# stricter than what the formats' informal definitions say; what is left out is never written.
NUMBER = rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE](?:\+?(?:[0-2]?\d{1,2}|30[0-7])|-\d{1,3}))?"
POINT = NUMBER + rb"[ \t]+" + NUMBER + rb"[ \t]+" + NUMBER
POINT_LINE = re.compile(rb"[ \t]*(" + POINT + rb")(?:[ \t].*)?")
# readOBJ reads lines of 2047 characters and takes the rest of a longer one for a new line, readOFF
# stops at 999, readSTL at 255; points are cut to their three numbers, faces are measured in OBJ.
LONGEST_OBJ_LINE, LONGEST_POINT = 2000, 200

OBJ_ELEMENT = re.compile(rb"^[ \t]*[vf](?:[ \t].*)?$", re.MULTILINE)
OBJ_GOOD_ELEMENT = re.compile(
    rb"^[ \t]*((?:v[ \t]+" + POINT + rb"(?=[ \t\n]|\Z))"
    rb"|(?:f(?:[ \t]+-?\d{1,9}(?:/-?\d*){0,2}(?=[ \t\n]|\Z)){3,}(?=[ \t]*$)))",
    re.MULTILINE,
)
OFF_KEYWORD = re.compile(rb"(?:ST)?C?N?OFF")
STL_FACET = ((b"facet",), (b"outer", b"loop"), *[(b"vertex",)] * 3, (b"endloop",), (b"endfacet",))


class MeshCopy(NamedTuple):
    """What libigl may read: checked content, the suffix that fits it, and the faces in it."""

    content: bytes
    suffix: str
    faces: int


def checked_bytes(path: Path) -> bytes:
    """Return the content of a file that is there, regular, of bearable size, and what it claims.

    Raises
    ------
    ValueError
        The file is missing, empty, no regular file, too large, compressed, or of another format
        than its suffix says.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise ValueError("there is no such file") from None
    if stat.S_ISDIR(status.st_mode):
        raise ValueError("it is a folder")
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("it is not a regular file")
    if status.st_size > MAX_BYTES:
        raise ValueError(f"it has {status.st_size:,} bytes; the limit is {MAX_BYTES:,}")
    data = path.read_bytes()
    if not data.strip():
        raise ValueError("it is empty")
    _check_suffix(data, path.suffix.lower())
    return data


def text_lines(data: bytes) -> list[bytes]:
    """Return the lines that say something, without comments, of a text in any 8-bit encoding."""
    if b"\0" in data:
        raise ValueError("it holds binary data or UTF-16 where text is expected")
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"#" in data:
        data = re.sub(rb"#[^\r\n]*", b"", data)
    return [line for line in map(bytes.strip, data.splitlines()) if line]


def check_obj(data: bytes) -> MeshCopy:
    """Return the ``v`` and ``f`` lines of an OBJ file, faces reduced to indices of vertices."""
    text = b"\n".join(text_lines(re.sub(rb"\\[ \t]*\r?\n", b" ", data)))
    good = OBJ_GOOD_ELEMENT.findall(text)
    if len(good) != len(OBJ_ELEMENT.findall(text)):
        _refuse_first_bad_obj_line(text)
    if not any(line[:1] == b"v" for line in good):
        raise ValueError("it has no vertices (no line that starts with 'v')")
    if max(map(len, good)) > LONGEST_OBJ_LINE:
        raise ValueError(f"a line has more than {LONGEST_OBJ_LINE} characters")
    content = re.sub(rb"/[/\d-]*", b"", b"\n".join(good))
    return MeshCopy(content + b"\n", ".obj", sum(line[:1] == b"f" for line in good))


def check_off(data: bytes) -> MeshCopy:
    """Return an OFF file (also COFF, NOFF and STOFF) reduced to points and indices."""
    lines = text_lines(data)
    keyword, *counts = lines[0].split() if lines else [b""]
    if not OFF_KEYWORD.fullmatch(keyword):
        raise ValueError(f"it does not start with OFF, COFF or NOFF but with {_shown(keyword)}")
    if counts[:1] == [b"BINARY"]:
        raise ValueError("binary OFF is not supported")
    body = 1 if counts else 2
    counts = counts or b" ".join(lines[1:2]).split()
    if len(counts) < 2 or not all(re.fullmatch(rb"\d{1,9}", word) for word in counts[:2]):
        raise ValueError("the numbers of vertices and faces are missing or wrong")
    n, m = int(counts[0]), int(counts[1])
    check_room(n + m, len(lines) - body, "lines")
    if len(lines) - body > n + m:
        raise ValueError(f"{len(lines) - body:,} lines follow where the header says {n + m:,}")
    return off_copy(lines[body:], n, m)


def off_copy(lines: list[bytes], n: int, m: int) -> MeshCopy:
    """Check `n` lines of points and `m` lines of faces, and write them as OFF.

    An ASCII PLY file whose vertices begin with x, y, z and whose faces begin with the list of
    indices has the same body as an OFF file, so it takes this way too.
    """
    points = [_obj_point(line) for line in lines[:n]]
    faces = [_face(line) for line in lines[n : n + m]]
    header = b"OFF\n%d %d 0" % (n, m)
    return MeshCopy(b"\n".join([header, *points, *faces]) + b"\n", ".off", m)


def check_room(needed: int, available: int, unit: str) -> None:
    """Refuse a header that promises more than the file holds."""
    if needed > available:
        raise ValueError(
            f"the header promises at least {needed:,} {unit}, but only {available:,} follow: "
            "the file is cut short, or the header is wrong"
        )


def check_stl(data: bytes) -> MeshCopy:
    """Return an STL file, ASCII in a canonical form, binary without trailing bytes.

    A binary file may begin with ``solid`` as well: what counts is whether the size fits.
    """
    claimed = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    size = 84 + 50 * claimed
    if len(data) == size and claimed:
        return MeshCopy(data, ".stl", claimed)
    if data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        return _ascii_stl_copy(data)
    if len(data) < 84 or b"\0" not in data:
        raise ValueError("it neither starts with 'solid' nor has the header of a binary STL")
    check_room(50 * claimed, len(data) - 84, "bytes")
    # readSTL takes a header of "solid" with a size that does not fit for ASCII.
    return MeshCopy(b" " * 80 + data[80:size], ".stl", claimed)


def _ascii_stl_copy(data: bytes) -> MeshCopy:
    """Check the facets line by line; the names of the solids go, their facets are joined."""
    keywords = (b"solid", b"endsolid")
    words = [line.lower().split() for line in data.splitlines() if line.strip()]
    if words[-1][0] != b"endsolid":
        raise ValueError("it does not end with 'endsolid': the file is cut short")
    facets = [line for line in words if line[0] not in keywords]
    for k, line in enumerate(facets):
        expected = STL_FACET[k % 7]
        if tuple(line[: len(expected)]) != expected:
            raise ValueError(
                f"{_shown(b' '.join(line))} stands where {_shown(b' '.join(expected))} belongs"
            )
    if len(facets) % 7:
        raise ValueError("the last facet is not complete")
    content = [b"solid"]
    for k in range(0, len(facets), 7):
        content += [b"facet normal 0 0 0", b"outer loop"]
        content += [b"vertex " + _obj_point(b" ".join(line[1:])) for line in facets[k + 2 : k + 5]]
        content += [b"endloop", b"endfacet"]
    return MeshCopy(b"\n".join([*content, b"endsolid\n"]), ".stl", len(facets) // 7)


def _obj_point(line: bytes) -> bytes:
    """Return the first three numbers of a line."""
    match = POINT_LINE.fullmatch(line)
    if match is None or len(match[1]) > LONGEST_POINT:
        raise ValueError(f"{_shown(line)} is not a point: three finite numbers are needed")
    return match[1]


def _face(line: bytes) -> bytes:
    """Return the number of corners and as many indices."""
    size, *corners = line.split()
    k = int(size) if size.isdigit() and len(size) < 10 else -1
    if k < 3 or len(corners) < k:
        raise ValueError(f"{_shown(line)} is not a face: a number of corners (3 or more), indices")
    del corners[k:]
    if not all(map(bytes.isdigit, corners)) or max(map(len, corners)) > 9:
        raise ValueError(f"{_shown(line)} has an index that is not a number from 0 to 999,999,999")
    return b" ".join([size, *corners])


def _refuse_first_bad_obj_line(text: bytes) -> None:
    for match in OBJ_ELEMENT.finditer(text):
        if OBJ_GOOD_ELEMENT.fullmatch(match[0]):
            continue
        if match[0].lstrip()[:1] == b"f":
            raise ValueError(f"{_shown(match[0])} is not a face: three or more indices are needed")
        if POINT_LINE.fullmatch(match[0].lstrip()[1:]) is None:
            raise ValueError(f"{_shown(match[0])} is not a point: three finite numbers are needed")


def _check_suffix(data: bytes, suffix: str) -> None:
    """Refuse content that plainly is something else than the suffix says."""
    if data[:2] == b"\x1f\x8b" or data[:4] == b"PK\x03\x04":
        raise ValueError("it is compressed; unpack it first")
    found = _format_of(data)
    if found and found != suffix and not (suffix == ".stl" and b"\0" in data):
        raise ValueError(f"the content is {found[1:].upper()}, not {suffix[1:].upper()}")
    if suffix == ".ply" and found != ".ply":
        raise ValueError("it does not start with 'ply'")


def _format_of(data: bytes) -> str | None:
    """Return the suffix of a format that names itself in its first bytes."""
    head = data[:512].removeprefix(b"\xef\xbb\xbf").lstrip()
    if re.match(rb"ply[ \t]*\r?\n", head):
        return ".ply"
    if re.match(rb"(?:ST)?C?N?OFF\s", head):
        return ".off"
    if re.match(rb"solid\b[^\r\n]*[\r\n]+\s*facet\b", head, re.IGNORECASE):
        return ".stl"
    return ".json" if head[:1] == b"{" else None


def _shown(line: bytes) -> str:
    """Return a line as it can stand in a message: short, and in characters that print."""
    text = line[:60].decode("ascii", "replace").replace("�", "?")
    return repr(text + ("..." if len(line) > 60 else ""))
