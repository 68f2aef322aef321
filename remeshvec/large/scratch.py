"""The folder of a call: every step leaves arrays in files, and none of them is ever half written.

A file or a folder of arrays appears under its name when it is complete. So a step is done if its
name is there, and a call that was ended goes on where it stopped.
"""

from __future__ import annotations

import io
import json
import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshFormatError
from ..files.disk import named_errors, write_file

__all__ = ["Arrays", "load", "read_json", "remove", "save_arrays", "save_task", "write_json"]

Arrays = Mapping[str, NDArray[Any]]


def save_arrays(folder: Path, arrays: Arrays, notes: Any = None) -> None:
    """Write arrays as ``.npy`` files into a new folder, which appears when all are there.

    ``notes`` go into ``notes.json``, if there are any.

    Raises
    ------
    MeshFormatError
        The folder cannot be written: no room on the disk, no permission.
    """
    with named_errors("write", folder):
        part = folder.with_name(f".{folder.name}.{secrets.token_hex(8)}.part")
        try:
            part.mkdir(parents=True)
            for name, array in arrays.items():
                with open(part / f"{name}.npy", "wb") as file:
                    np.save(file, array)
                    file.flush()
                    os.fsync(file.fileno())
            if notes is not None:
                write_json(part / "notes.json", notes)
            os.replace(part, folder)
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise


def load(folder: Path, *names: str) -> dict[str, NDArray[Any]]:
    """Map arrays of a folder, by default all: parts of them are read when they are used."""
    found = names or tuple(sorted(path.stem for path in folder.glob("*.npy")))
    with named_errors("read", folder):
        return {name: _mapped(folder / f"{name}.npy") for name in found}


def _mapped(path: Path) -> NDArray[Any]:
    try:
        return np.load(path, mmap_mode="r")
    except ValueError:  # an empty array cannot be mapped
        return np.load(path)


def save_task(path: Path, arrays: Arrays) -> None:
    """Write the arrays that a task returns into one file."""
    content = io.BytesIO()
    np.savez(content, **arrays)  # type: ignore[arg-type]
    write_file(path, content.getbuffer())  # type: ignore[arg-type]


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file."""
    write_file(path, (json.dumps(value, indent=2, sort_keys=True) + "\n").encode())


def read_json(path: Path) -> Any:
    """Read a JSON file; None if there is none."""
    try:
        return json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        return None
    except ValueError as error:
        raise MeshFormatError(f"cannot read {path}: {error}") from error


def remove(*paths: Path) -> None:
    """Remove folders that are no longer needed."""
    for path in paths:
        shutil.rmtree(path, ignore_errors=True)
