"""Numba's disk cache, of which no fault ends a call.

Where a file is damaged, the kernel is compiled anew; where none can be written, nothing is kept. One line
says so. Numba itself raises whatever the fault leads to, and runs damaged machine code.
"""

from __future__ import annotations

import hashlib
import pickle
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.serialize import dumps

from .notice import print_once

__all__ = ["FORMAT", "keep_on_disk"]

FORMAT = "checked 1"  # of the files; a part of the names of kernels


def keep_on_disk(compiled: Any) -> None:
    """Let a dispatcher of Numba load from disk what it would compile, and save what it compiles."""
    try:
        compiled._cache = _DiskCache(compiled.py_func)
    except (RuntimeError, OSError):
        print_once(
            "there is no folder that compiled kernels can be kept in, so every run compiles again; "
            "NUMBA_CACHE_DIR names one"
        )


class _CheckedFile(IndexDataCacheFile):
    """Adds to every entry a digest, and its key: two processes may give two entries one file name."""

    def save(self, key: Any, data: Any) -> None:
        content = dumps((key, data))
        super().save(key, (hashlib.sha256(content).digest(), content))

    def load(self, key: Any) -> Any:
        entry = super().load(key)
        if entry is None:
            return None
        digest, content = entry
        if hashlib.sha256(content).digest() != digest:
            raise ValueError("its digest is wrong")
        known, data = pickle.loads(content)
        return data if known == key else None


class _DiskCache(FunctionCache):
    """The cache of one kernel."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file.__class__ = _CheckedFile

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except MemoryError:
            raise
        except Exception as error:  # unpickling raises all sorts on a damaged file
            with suppress(OSError):  # without the index, data files are written anew
                Path(self._cache_file._index_path).unlink()
            print_once(
                f"a file of compiled kernels in {self.cache_path} is damaged "
                f"({type(error).__name__}: {error}); they are compiled anew"
            )
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except Exception as error:  # OSError; or the index was damaged meanwhile
            print_once(
                f"compiled kernels cannot be kept in {self.cache_path} ({error}), "
                "so the next run compiles again; NUMBA_CACHE_DIR names another folder"
            )
