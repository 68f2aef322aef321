"""The part of a result that is small enough to send and to keep: the mesh, its labels, its figures."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import arguments
from ..files.disk import FilePath, check_writable, named_errors, write_file

__all__ = ["LIGHT_SUFFIX", "LightResult"]

LIGHT_SUFFIX = ".npz"


@dataclass
class LightResult:
    """Mesh, labels and figures of a `RemeshResult`; unpacks as ``V, F = light``.

    Attributes
    ----------
    V : (n, 3)
        Vertices.
    F : (m, 3)
        Faces.
    face_labels : (m,) int, or None
        Label of every face, where the input had labels.
    report : dict
        What `Report.to_dict` returns: target length, counts, seconds, dirt, defects, and the quality
        before and after.
    """

    V: NDArray[Any]
    F: NDArray[Any]
    face_labels: NDArray[Any] | None
    report: dict[str, Any] = field(repr=False)

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return iter((self.V, self.F))

    def save(self, path: FilePath) -> None:
        """Write one file of arrays, whole or not at all.

        `numpy.load` reads it too: ``V``, ``F``, ``face_labels`` where there are labels, and ``report``,
        the bytes of a JSON text.

        Parameters
        ----------
        path : str or path
            Ends in ``.npz``.

        Raises
        ------
        MeshFormatError
            The file cannot be written.
        OptionError
            ``path`` is not a path.
        """
        check_writable(path, (LIGHT_SUFFIX,))
        text = np.frombuffer(json.dumps(self.report).encode(), np.uint8)
        arrays: dict[str, Any] = {"V": self.V, "F": self.F, "report": text}
        if self.face_labels is not None:
            arrays["face_labels"] = self.face_labels
        content = io.BytesIO()
        np.savez(content, **arrays)
        write_file(path, content.getvalue())

    @classmethod
    def load(cls, path: FilePath) -> LightResult:
        """Read a file that `save` has written.

        Raises
        ------
        MeshFormatError
            There is no such file, or it is another one.
        OptionError
            ``path`` is not a path.
        """
        with (
            named_errors("read", Path(arguments.path(path, "path"))),
            np.load(path, allow_pickle=False) as held,
        ):
            missing = {"V", "F", "report"} - set(held)
            if missing:
                raise ValueError(f"it is no result of remeshvec: it has no {min(missing)}")
            report = json.loads(held["report"].tobytes())
            return cls(held["V"], held["F"], held.get("face_labels"), report)
