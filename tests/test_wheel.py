"""What is shipped: a wheel with the package alone, that installs and runs outside of a checkout."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "MANIFEST.in")


def run(*command, cwd, **env):
    done = subprocess.run(
        [sys.executable, *map(str, command)],
        cwd=cwd,
        env={**os.environ, **env},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Folder with the source archive and the wheel that is built from it, without the network."""
    if find_spec("build") is None or int(version("setuptools").partition(".")[0]) < 77:
        pytest.skip("needs build and setuptools 77: pip install -e '.[dev]'")
    source = tmp_path_factory.mktemp("source")
    for name in SOURCES:
        shutil.copy(ROOT / name, source)
    ignored = shutil.ignore_patterns("__pycache__", "*.nb?")
    shutil.copytree(ROOT / "remeshvec", source / "remeshvec", ignore=ignored)
    shutil.copytree(ROOT / "tests", source / "tests", ignore=ignored)
    run("-m", "build", "--no-isolation", "--outdir", source / "dist", cwd=source)
    return source / "dist"


def test_wheel_holds_the_package_alone(built):
    (wheel,) = built.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    package = {name for name in names if not name.split("/")[0].endswith(".dist-info")}
    modules = {str(path.relative_to(ROOT)) for path in (ROOT / "remeshvec").rglob("*.py")}
    assert modules | {"remeshvec/py.typed"} <= package
    assert all(name.startswith("remeshvec/") for name in package)
    assert any(name.endswith("LICENSE") for name in names)


def test_source_archive_builds_a_wheel_and_holds_no_tests(built):
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        names = [name.partition("/")[2] for name in files.getnames()]
    assert {"pyproject.toml", "LICENSE", "CHANGELOG.md", "remeshvec/py.typed"} <= set(names)
    assert not [name for name in names if name.startswith(("tests", "docs", "benchmarks", "data"))]


def test_twine_is_content(built):
    pytest.importorskip("twine")
    said = run("-m", "twine", "check", "--strict", *built.iterdir(), cwd=built)
    assert said.count("PASSED") == 2


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """Folder with the wheel's package, found before that of the checkout."""
    folder = tmp_path_factory.mktemp("installed")
    (wheel,) = built.glob("*.whl")
    run("-m", "pip", "install", "-q", "--no-deps", "--target", folder, wheel, cwd=folder)
    return folder


def test_installed_package_says_its_version(installed):
    import remeshvec

    said = run("-m", "remeshvec", "--version", cwd=installed, PYTHONPATH=str(installed))
    assert said.strip() == f"remeshvec {remeshvec.__version__}"
    where = "import remeshvec; print(remeshvec.__file__)"
    assert str(installed) in run("-c", where, cwd=installed, PYTHONPATH=str(installed))


@pytest.mark.slow
def test_installed_package_remeshes(installed, tmp_path):
    mesh, out = ROOT / "data" / "creature.obj", tmp_path / "even.ply"
    run("-m", "remeshvec", mesh, "-o", out, cwd=tmp_path, PYTHONPATH=str(installed))
    assert out.stat().st_size > 100_000
