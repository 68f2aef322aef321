"""Files as a whole: checked before they are read, written completely or not at all."""

from __future__ import annotations

import gzip
import io
import json
import os
import re
import secrets
import shutil
import stat
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..core import arguments
from ..errors import MeshFormatError

__all__ = [
    "FilePath",
    "check_regular",
    "check_writable",
    "checked_bytes",
    "format_suffix",
    "named_errors",
    "reason",
    "unpacked",
    "write_file",
]

FilePath = str | os.PathLike[str]

# A file is held in memory as a whole, together with its numbers.
MAX_BYTES = 4 << 30


@contextmanager
def named_errors(action: str, path: Path) -> Iterator[None]:
    """Turn errors of any kind into one that names the file and the reason.

    Raises
    ------
    MeshFormatError
    """
    try:
        yield
    except Exception as error:  # on a broken file, libraries raise errors of any type
        raise MeshFormatError(f"cannot {action} {path}: {reason(error)}") from error


def reason(error: Exception) -> str:
    """Describe an error in one line."""
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    if isinstance(error, json.JSONDecodeError):
        return f"it is not JSON: {error}"
    if isinstance(error, UnicodeDecodeError):
        return "it is not UTF-8"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return " ".join(str(error).split()) or type(error).__name__


def check_regular(path: Path) -> None:
    """Refuse a path that does not lead to a regular file.

    Raises
    ------
    ValueError
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise ValueError("there is no such file") from None
    if stat.S_ISDIR(mode):
        raise ValueError("it is a folder")
    if not stat.S_ISREG(mode):
        raise ValueError("it is not a regular file")


def format_suffix(path: FilePath) -> str:
    """Return the suffix that tells the format, in lower case: ``.obj`` for ``a.OBJ`` and ``a.obj.gz``."""
    name = Path(path)
    return Path(name.stem if _is_packed(name) else name).suffix.lower()


def _is_packed(path: Path) -> bool:
    return path.suffix.lower() == ".gz"


def unpacked(data: bytes) -> bytes:
    """Return the content of a gzip file, up to the largest size that is read.

    Raises
    ------
    ValueError
        The file is damaged, or its content is too large.
    """
    try:
        with gzip.open(io.BytesIO(data)) as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise ValueError(f"it is not a complete gzip file: {error}") from None
    if len(content) > MAX_BYTES:
        raise ValueError(f"it unpacks to more than {MAX_BYTES:,} bytes, the limit")
    return content


def checked_bytes(path: Path) -> bytes:
    """Return the content of a regular file, not too large, whose format matches its suffix.

    Files whose names end with ``.gz`` are unpacked.

    Raises
    ------
    ValueError
        The file is missing, empty, not regular, too large, compressed, or not in the format of its
        suffix.
    """
    check_regular(path)
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise ValueError(f"it has {size:,} bytes; the limit is {MAX_BYTES:,}")
    data = path.read_bytes()
    if _is_packed(path):
        data = unpacked(data)
    if not data.strip():
        raise ValueError("it is empty")
    _check_suffix(data, format_suffix(path))
    return data


def _check_suffix(data: bytes, suffix: str) -> None:
    """Refuse content that is clearly in another format than that of the suffix."""
    if data[:2] == b"\x1f\x8b" or data[:4] == b"PK\x03\x04":
        raise ValueError("it is compressed; unpack it first, or name it .gz")
    found = _format_of(data)
    if found and found != suffix and not (suffix == ".stl" and b"\0" in data):
        raise ValueError(f"the content is {found[1:].upper()}, not {suffix[1:].upper()}")
    if suffix == ".ply" and found != ".ply":
        raise ValueError("it does not start with 'ply'")


def _format_of(data: bytes) -> str | None:
    """Return the suffix of a format that is recognised by its first bytes."""
    head = data[:512].removeprefix(b"\xef\xbb\xbf").lstrip()
    if re.match(rb"ply[ \t]*\r?\n", head):
        return ".ply"
    if re.match(rb"(?:ST)?C?N?OFF\s", head):
        return ".off"
    if re.match(rb"solid\b[^\r\n]*[\r\n]+\s*facet\b", head, re.IGNORECASE):
        return ".stl"
    return ".json" if head[:1] == b"{" else None


def write_file(path: FilePath, content: bytes) -> None:
    """Write a temporary file beside the target, then rename it: nobody sees a half-written file.

    The content reaches the disk before the name, so this holds even after a loss of power. It is packed
    if the name ends with ``.gz``, without a time, so that the same content gives the same bits.

    Raises
    ------
    MeshFormatError
        The file cannot be written.
    """
    with named_errors("write", Path(arguments.path(path, "path"))):
        target = Path(path).resolve()  # a link stays a link
        if _is_packed(Path(path)):
            content = gzip.compress(content, 6, mtime=0)
        part = target.with_name(f".{secrets.token_hex(8)}.part")
        try:
            with open(part, "xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())  # or the name may reach the disk without the content
            if target.exists():
                shutil.copymode(target, part)
            os.replace(part, target)
            _sync_folder(target.parent)
        except BaseException:
            part.unlink(missing_ok=True)
            raise


def _sync_folder(folder: Path) -> None:
    """Flush a new name to the disk, if the system allows folders to be opened."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def check_writable(path: FilePath, suffixes: Sequence[str] = ()) -> None:
    """Refuse a path that cannot be written, before long work starts.

    Parameters
    ----------
    path : str or path
        The file to write.
    suffixes : sequence of str
        Allowed suffixes, in lower case; empty for any.

    Raises
    ------
    MeshFormatError
        The suffix is not allowed, the parent folder does not exist or is not writable, or the path is
        a folder.
    """
    with named_errors("write", Path(arguments.path(path, "path"))):
        obstacle = _obstacle(Path(path).resolve(), suffixes)
        if obstacle:
            raise ValueError(obstacle)


def _obstacle(target: Path, suffixes: Sequence[str]) -> str | None:
    if suffixes and target.suffix.lower() not in suffixes:
        return f"the suffix {target.suffix!r} is not one of {', '.join(suffixes)}"
    if not target.parent.is_dir():
        return f"there is no folder {target.parent}"
    if target.is_dir():
        return "it is a folder"
    if target.exists() and not target.is_file():
        return "it is not a regular file"
    if not os.access(target.parent, os.W_OK | os.X_OK):
        return f"the folder {target.parent} is not writable"
    return None
