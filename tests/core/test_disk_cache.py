"""No fault of the cache of compiled kernels ends a call, and none gives another result."""

from pathlib import Path

import numba
import pytest
from numba.core import caching

from remeshvec.core.compiler import kernel, notice

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="the compiler is switched off")


def three_halves(x):
    return x + x / 2


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(notice, "_printed", set())
    return tmp_path


def fresh():
    """A kernel as another process has it: nothing is compiled yet."""
    return kernel(three_halves)


def is_loaded():
    again = fresh()
    assert again(4) == 6
    return sum(again.compiled.stats.cache_hits.values()) == 1


def only_file(folder: Path, suffix):
    (path,) = folder.rglob(f"*.{suffix}")
    return path


def flip(content):
    at = 2 * len(content) // 3
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


def test_kernels_are_kept():
    assert not is_loaded()
    assert is_loaded()


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "damage",
    [lambda _: b"", lambda content: content[:-9], lambda _: b"garbage" * 99, flip],
    ids=["empty", "cut short", "garbage", "one bit"],
)
def test_a_damaged_file_is_replaced(folder, suffix, damage, capfd):
    fresh()(4)
    path = only_file(folder, suffix)
    path.write_bytes(damage(path.read_bytes()))
    assert not is_loaded()
    error = capfd.readouterr().err
    if damage is not flip or suffix == "nbc":  # a bit of the index may only make it look older
        assert error.count("\n") == 1 and "damaged" in error and str(folder) in error
    assert is_loaded()
    assert capfd.readouterr().err == ""


def test_data_of_other_types_are_not_taken(folder):
    fresh()(4)
    whole = only_file(folder, "nbc")
    content = whole.read_bytes()
    fresh()(4.0)
    (real,) = set(folder.rglob("*.nbc")) - {whole}
    real.write_bytes(content)
    assert fresh()(5.0) == 7.5


def test_a_file_that_cannot_be_read_or_removed(folder, capfd):
    fresh()(4)
    index = only_file(folder, "nbi")
    index.unlink()
    index.mkdir()
    assert fresh()(4) == 6 and fresh()(4) == 6
    assert capfd.readouterr().err.count("\n") == 2  # damaged, and not written


def test_a_full_disk(monkeypatch, capfd):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "_save_data", full)
    assert not is_loaded() and not is_loaded()
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and "No space left on device" in error


def test_no_folder_that_can_be_written(monkeypatch, capfd):
    def read_only(_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(caching._CacheLocator, "ensure_cache_path", read_only)
    assert not is_loaded() and not is_loaded()
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and "NUMBA_CACHE_DIR" in error
