"""Mesh files for tests: unusual but legal ones, and hostile ones with the reason for refusing them.

Several of the hostile files abort the process of readers that trust a file, such as libigl's.
"""

from __future__ import annotations

import json
import struct

import numpy as np

V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
F = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
FACES_OFF = b"3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
OFF = b"OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n" + FACES_OFF


def ply(form="ascii", n=4, faces=None, m=None, point="double", index="int"):
    """Return a PLY file; `n` and `m` are what the header claims."""
    faces = F.tolist() if faces is None else faces
    header = (
        f"ply\nformat {form} 1.0\ncomment made by a test\nelement vertex {n}\n"
        + "".join(f"property {point} {axis}\n" for axis in "xyz")
        + f"element face {len(faces) if m is None else m}\n"
        + f"property list uchar {index} vertex_indices\nend_header\n"
    )
    if form == "ascii":
        points = "".join(f"{x} {y} {z}\n" for x, y, z in V.tolist())
        lists = "".join(" ".join(map(str, [len(face), *face])) + "\n" for face in faces)
        return (header + points + lists).encode()
    order = "<" if "little" in form else ">"
    kind = order + ("f8" if point == "double" else "f4")
    lists = [bytes([len(face)]) + np.array(face, order + "i4").tobytes() for face in faces]
    return header.encode() + V.astype(kind).tobytes() + b"".join(lists)


def binary_ply(**kwargs):
    return ply("binary_little_endian", **kwargs)


def stl(triangles=V[F], claimed=None, header=b"made by a test"):
    facets = [bytes(12) + t.astype("<f4").tobytes() + bytes(2) for t in triangles]
    count = len(triangles) if claimed is None else claimed
    return header.ljust(80) + struct.pack("<I", count) + b"".join(facets)


def ascii_stl():
    facets = [
        "facet normal 0 0 1\n outer loop\n"
        + "".join(f"  vertex {x} {y} {z}\n" for x, y, z in triangle)
        + " endloop\nendfacet\n"
        for triangle in V[F].tolist()
    ]
    return ("solid part\n" + "".join(facets) + "endsolid part\n").encode()


def as_json(verts=None, faces=None):
    content = {"verts": V.tolist() if verts is None else verts}
    return json.dumps(content | {"faces": F.tolist() if faces is None else faces}).encode()


def with_textures(obj):
    """Rewrite faces in all four forms, with two texture coordinates at vertex 1: a seam."""
    obj = obj.replace(b"f 1 3 2", b"vt 0 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 3/1/1 2/1/1")
    return obj.replace(b"f 1 2 4", b"f 1/2 2/2 4/2").replace(b"f 2 3 4", b"f 2//1 3//1 4//1")


# Unusual but legal: each holds the tetrahedron (V, F).
LEGAL = {
    "plain.obj": OBJ,
    "capitals.OBJ": OBJ,
    "carriage returns.obj": OBJ.replace(b"\n", b"\r\n"),
    "old mac.obj": OBJ.replace(b"\n", b"\r"),
    "tabs.obj": OBJ.replace(b" ", b"\t"),
    "indented.obj": b"  " + OBJ.replace(b"\n", b"\n  "),
    "byte order mark.obj": b"\xef\xbb\xbf" + OBJ,
    "latin-1 comment.obj": b"# caf\xe9\n" + OBJ,
    "comment at the end of a line.obj": OBJ.replace(b"f 1 3 2", b"f 1 3 2 # one"),
    "comment longer than a line buffer.obj": b"# " + b"f 1 2 " * 5000 + b"\n" + OBJ,
    "continued line.obj": OBJ.replace(b"f 1 3 2", b"f 1 \\\n3 2"),
    "continued line of an old mac.obj": OBJ.replace(b"\n", b"\r").replace(b"f 1 ", b"f 1 \\\r", 1),
    "comment that ends with a backslash.obj": OBJ.replace(b"f 1 3", b"# C:\\a\\\nf 1 3"),
    "tabs beside a group.obj": b"g a\n" + OBJ.replace(b"f ", b"f\t"),
    "form feeds.obj": b"g a\x0cf 1 2 3\n" + OBJ.replace(b"f ", b"f\x0c"),
    "separators in a name.obj": "g a\u2028f 1 2 3\x85f 1 2 3\x1cf 1 2 3\x0bf 1 2 3\n".encode()
    + OBJ,
    "negative indices.obj": OBJ.replace(b"f 3 1 4", b"f -2 -4 -1"),
    "texture seam and normals.obj": with_textures(OBJ),
    "face with and without texture.obj": OBJ.replace(b"f 1 3 2", b"vt 0 0\nf 1/1 3 2"),
    "colours.obj": OBJ.replace(b"v 1 0 0", b"v 1 0 0 .5 .5 .5"),
    "homogeneous.obj": OBJ.replace(b"v 1 0 0", b"v 1 0 0 1"),
    "more normals than vertices.obj": b"vn 0 0 1\n" * 9 + OBJ,
    "other elements.obj": b"mtllib a.mtl\no thing\ng a\ns off\n" + OBJ + b"l 1 2\np 1\n",
    "no newline at the end.obj": OBJ.rstrip(),
    "plain.off": OFF,
    "comments.off": OFF.replace(b"OFF\n", b"OFF\n# one\n\n").replace(b"1 0 0", b"#\n1 0 0 # x"),
    "counts beside the keyword.off": OFF.replace(b"OFF\n", b"OFF "),
    "no number of edges.off": OFF.replace(b"4 4 6", b"4 4"),
    "carriage returns.off": OFF.replace(b"\n", b"\r\n"),
    "colours of vertices.off": b"C"
    + OFF.replace(b"0 0 0\n1 0 0\n", b"0 0 0 9 9 9 255\n1 0 0 0 0 255 255\n"),
    "normals.off": b"N" + OFF.replace(b"1 0 0\n", b"1 0 0 0 0 1\n"),
    "colours of faces.off": OFF.replace(b"3 0 2 1", b"3 0 2 1 .33333333333333 0 1"),
    "plain.ply": ply(),
    "little endian.ply": binary_ply(),
    "big endian.ply": ply("binary_big_endian"),
    "single precision.ply": binary_ply(point="float"),
    "carriage returns.ply": ply().replace(b"\n", b"\r\n"),
    "singular name.ply": binary_ply().replace(b"vertex_indices", b"vertex_index"),
    "separators in a comment.ply": ply().replace(
        b"by a test", "\u2028element face 9\x0cproperty int a\x85end_header".encode()
    ),
    "new type names.ply": binary_ply().replace(b"uchar int", b"uint8 int32"),
    "binary.stl": stl(),
    "binary that begins with solid.stl": stl(header=b"solid part"),
    "binary that begins like ascii.stl": stl(header=b"solid part\nfacet normal"),
    "binary with bytes behind.stl": stl(header=b"solid") + b"abcd",
    "ascii.stl": ascii_stl(),
    "ascii without a name.stl": ascii_stl().replace(b" part", b""),
    "ascii with a long name.stl": ascii_stl().replace(b"part", b"part " * 100),
    "ascii in capitals.stl": ascii_stl().upper(),
    "ascii with carriage returns.stl": ascii_stl().replace(b"\n", b"\r\n"),
    "plain.json": as_json(),
    "integers.json": as_json(verts=V.astype(int).tolist()),
    "byte order mark.json": b"\xef\xbb\xbf" + as_json(),
    "other keys.json": as_json()[:-1] + b', "name": "tetrahedron"}',
}

# Content and a part of the message.
HOSTILE = {
    "empty.obj": (b"", "empty"),
    "blank.off": (b" \n\n", "empty"),
    "empty.ply": (b"", "empty"),
    "empty.stl": (b"", "empty"),
    "empty.json": (b"", "empty"),
    "unknown suffix.mesh": (OBJ, "suffix '.mesh' is not one of"),
    "no suffix": (OBJ, "suffix '' is not one of"),
    "compressed.obj": (b"\x1f\x8b\x08" + bytes(range(200)), "compressed"),
    "zip.stl": (b"PK\x03\x04" + bytes(200), "compressed"),
    "off as.obj": (OFF, "content is OFF, not OBJ"),
    "ply as.stl": (ply(), "content is PLY, not STL"),
    "obj as.ply": (OBJ, "does not start with 'ply'"),
    "obj as.off": (OBJ, "not with OFF, COFF or NOFF"),
    "obj as.stl": (OBJ, "neither starts with 'solid'"),
    "obj as.json": (OBJ, "not JSON"),
    "utf-16.obj": (OBJ.decode().encode("utf-16"), "binary data or UTF-16"),
    "zero index.obj": (OBJ + b"f 0 1 2\n", "face 4 (counted from 0) names a vertex outside"),
    "index out of range.obj": (OBJ + b"f 1 2 99\n", "names a vertex outside"),
    "negative index out of range.obj": (OBJ + b"f -9 1 2\n", "names a vertex outside"),
    "index that overflows.obj": (OBJ + b"f 1 2 4294967297\n", "names a vertex outside"),
    "index that is a float.obj": (OBJ + b"f 1.5 2 3\n", "is not a face"),
    "index that is a word.obj": (OBJ + b"f a b c\n", "is not a face"),
    "face with one corner.obj": (OBJ + b"f 1\n", "is not a face"),
    "face with two corners.obj": (OBJ + b"f 1 2\n", "'f 1 2' is not a face"),
    "face without corners.obj": (OBJ + b"f\n", "is not a face"),
    "cut short.obj": (OBJ[:-3], "is not a face"),
    "two coordinates.obj": (OBJ + b"v 1 2\n", "'v 1 2' is not a point"),
    "decimal comma.obj": (OBJ.replace(b"v 1 0 0", b"v 1,5 0 0"), "is not a point"),
    "nan.obj": (OBJ.replace(b"v 1", b"v nan"), "is not a point"),
    "inf.obj": (OBJ.replace(b"v 1", b"v inf"), "is not a point"),
    "too large for a double.obj": (OBJ.replace(b"v 1", b"v 1e400"), "is not a point"),
    "no faces.obj": (OBJ.split(b"f")[0], "no faces"),
    "no vertices.obj": (b"f 1 2 3\n", "no vertices"),
    "comments only.obj": (b"# nothing\n", "no faces"),
    "no keyword.off": (OFF[4:], "not with OFF, COFF or NOFF"),
    "four dimensions.off": (b"4" + OFF, "not with OFF, COFF or NOFF"),
    "binary.off": (b"OFF BINARY\n" + struct.pack(">iii", 4, 4, 0) + bytes(64), "binary"),
    "keyword only.off": (b"OFF\n", "numbers of vertices and faces"),
    "negative counts.off": (OFF.replace(b"4 4 6", b"-4 4 6"), "numbers of vertices and faces"),
    "counts that overflow.off": (OFF.replace(b"4 4 6", b"9" * 30 + b" 4 6"), "numbers of vertices"),
    "too few vertices.off": (OFF.replace(b"4 4 6", b"9 4 6"), "header promises"),
    "too few faces.off": (OFF.replace(b"4 4 6", b"4 9 6"), "header promises"),
    "huge counts.off": (OFF.replace(b"4 4 6", b"999999999 999999999 0"), "header promises"),
    "more lines than counts.off": (OFF.replace(b"4 4 6", b"3 4 6"), "header says 7"),
    "huge polygon.off": (OFF.replace(b"3 0 2 1", b"2000000000 0 2 1"), "is not a face"),
    "negative polygon.off": (OFF.replace(b"3 0 2 1", b"-3 0 2 1"), "is not a face"),
    "two corners.off": (OFF.replace(b"3 0 2 1", b"2 0 2"), "is not a face"),
    "cut short.off": (OFF[:-4], "is not a face"),
    "index out of range.off": (OFF.replace(b"3 0 2 1", b"3 0 2 9"), "names a vertex outside"),
    "negative index.off": (OFF.replace(b"3 0 2 1", b"3 0 2 -1"), "has an index that is not"),
    "nan.off": (OFF.replace(b"1 0 0", b"nan 0 0"), "is not a point"),
    "word.off": (OFF.replace(b"1 0 0", b"one 0 0"), "is not a point"),
    "header cut short.ply": (ply().split(b"end_header")[0], "header has no end"),
    "header only.ply": (ply().split(b"0.0")[0], "header promises"),
    "huge counts.ply": (ply(n=10**11), "header promises"),
    "huge counts, binary.ply": (binary_ply(n=10**11), "header promises"),
    "huge number of faces.ply": (binary_ply(m=10**11), "header promises"),
    "counts that overflow.ply": (binary_ply(n=10**30), "not PLY: 'element vertex 1000"),
    "negative counts.ply": (ply(n=-4), "not PLY: 'element vertex -4"),
    "unknown type.ply": (ply(point="quad"), "not PLY: 'property quad x"),
    "no format.ply": (ply().replace(b"format ascii 1.0\n", b""), "ASCII or binary"),
    "element twice.ply": (ply().replace(b"element face", b"element vertex"), "element"),
    "no faces in the header.ply": (ply().replace(b"element face", b"element edge"), "'face'"),
    "no z.ply": (ply().replace(b"double z", b"double w"), "lack x, y or z"),
    "no list.ply": (ply().replace(b"vertex_indices", b"colours"), "lack the list"),
    "no faces.ply": (ply(faces=[]), "no faces"),
    "cut short.ply": (ply()[:-6], "'3' does not have the columns"),
    "cut short by two faces.ply": (ply()[:-18], "header promises"),
    "cut short, binary.ply": (binary_ply()[:-6], "cut short within the element 'face'"),
    "cut short within points.ply": (binary_ply()[:-60], "header promises"),
    "wrong length of a list.ply": (ply().replace(b"3 0 2 1", b"9 0 2 1"), "have the columns"),
    "negative length of a list.ply": (ply().replace(b"3 0 2 1", b"-3 0 2 1"), "have the columns"),
    "words.ply": (ply().replace(b"3 0 2 1", b"3 x 2 1"), "'x' in the column 'vertex_indices'"),
    "underscores.ply": (ply().replace(b"1.0", b"1_0"), "'1_0' in the column"),
    "nan.ply": (ply().replace(b"1.0", b"nan"), "vertex 1 (counted from 0) is not finite"),
    "floats for indices.ply": (
        ply().replace(b"3 0 2 1", b"3 0 2 1.5"),
        "values that are not integers",
    ),
    "negative index.ply": (ply(faces=[[0, 1, -1]]), "names a vertex outside"),
    "index out of range.ply": (binary_ply(faces=[[0, 1, 99]]), "names a vertex outside"),
    "negative index, binary.ply": (binary_ply(faces=[[0, 1, -1]]), "names a vertex outside"),
    "lists of length 0.ply": (binary_ply(faces=[[], []]), "face 0 (counted from 0) has fewer"),
    "negative length of a list, binary.ply": (
        binary_ply().replace(b"uchar", b"char").replace(b"\3", b"\xfd"),
        "a list has a wrong length",
    ),
    "long list, binary.ply": (
        binary_ply(faces=[[0, 1, 2] * 85]).replace(b"uchar", b"ushort"),
        "a list has a wrong length",
    ),
    "nan, binary.ply": (
        binary_ply().replace(struct.pack("<d", 1), struct.pack("<d", np.nan)),
        "vertex 1 (counted from 0) is not finite",
    ),
    "cut short.stl": (stl()[:-20], "header promises"),
    "huge counts.stl": (stl(claimed=2**32 - 1), "header promises"),
    "no faces.stl": (stl(V[F][:0]), "no faces"),
    "short.stl": (bytes(50), "neither starts with 'solid'"),
    "nan.stl": (
        stl(np.full((2, 3, 3), np.nan)),
        "facet 0 (counted from 0) has a corner that is NaN",
    ),
    "ascii cut short.stl": (ascii_stl()[:-40], "cut short"),
    "ascii header only.stl": (b"solid part\n", "cut short"),
    "ascii without facets.stl": (b"solid part\nendsolid part\n", "no faces"),
    "ascii with four corners.stl": (
        ascii_stl().replace(b"vertex", b"vertex 0 0 0\nvertex", 1),
        "was found where 'endloop' is expected",
    ),
    "ascii with two coordinates.stl": (
        ascii_stl().replace(b"vertex 0.0 0.0 0.0", b"vertex 0.0 0.0"),
        "'vertex 0.0 0.0' is not a point",
    ),
    "ascii with a long word.stl": (ascii_stl().replace(b"outer", b"o" * 250), "was found where"),
    "ascii with nan.stl": (ascii_stl().replace(b"vertex 1.0", b"vertex nan"), "is not a point"),
    "a list.json": (b"[[0, 0, 0]]", "of the form"),
    "wrong keys.json": (b'{"vertices": [[0, 0, 0]], "faces": [[0, 0, 0]]}', "of the form"),
    "cut short.json": (as_json()[:-5], "not JSON"),
    "not utf-8.json": (b'{"caf\xe9": 1}', "not UTF-8"),
    "nested too deeply.json": (b'{"verts": ' + b"[" * 200_000, "nested too deeply"),
    "words.json": (as_json(verts=[["0", "0", "0"]] * 4), "list of [x, y, z]"),
    "truth.json": (as_json(verts=[[True, 0, 0]] * 4), "list of [x, y, z]"),
    "two coordinates.json": (as_json(verts=[[0, 0]] * 4), "list of [x, y, z]"),
    "ragged points.json": (as_json(verts=[[0, 0, 0], [1, 0], [0, 1, 0]]), "list of [x, y, z]"),
    "no points.json": (as_json(verts=[]), "no vertices"),
    "faces no list.json": (as_json(faces=3), "list of lists of integers"),
    "floats for indices.json": (as_json(faces=[[0, 1, 2.0]]), "list of lists of integers"),
    "two corners.json": (
        as_json(faces=[[0, 1, 2], [0, 1]]),
        "face 1 (counted from 0) has fewer",
    ),
    "no faces.json": (as_json(faces=[]), "no faces"),
    "index out of range.json": (as_json(faces=[[0, 1, 4]]), "names a vertex outside"),
    "negative index.json": (as_json(faces=[[0, 1, -1]]), "names a vertex outside"),
    "huge index.json": (as_json(faces=[[0, 1, 10**30]]), "cannot read"),
    "too large for a double.json": (as_json().replace(b"1.0", b"1e400"), "not finite"),
    "nan.json": (as_json().replace(b"1.0", b"NaN"), "not finite"),
}
