"""A picture of the page that ``--html`` writes, from the root of a checkout, with Chromium.

``python -m docs.gallery.screenshot``
"""

from __future__ import annotations

import io
import subprocess
import tempfile
from pathlib import Path

from PIL import Image

from remeshvec import read_mesh, remesh, write_html

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "pictures" / "report.png"
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--window-size=1350,1160",
    "--virtual-time-budget=15000",
]


def main() -> None:
    """Write the page of a remeshed creature, and photograph its upper part."""
    V, F, _ = read_mesh(ROOT / "data" / "creature.obj")
    with tempfile.TemporaryDirectory() as folder:
        page, shot = Path(folder) / "report.html", Path(folder) / "page.png"
        write_html(page, remesh(V, F, 0.04), title="creature.obj", up="z")
        call = ["chromium", *FLAGS, f"--user-data-dir={folder}/user", f"--screenshot={shot}"]
        subprocess.run([*call, page.as_uri()], check=True, capture_output=True, timeout=120)
        image = Image.open(shot).convert("RGB").quantize(128)
    content = io.BytesIO()
    image.save(content, "PNG", optimize=True)
    PICTURE.write_bytes(content.getvalue())
    print(f"wrote {PICTURE.relative_to(ROOT)} ({len(content.getvalue()) / 1000:.0f} KB)")


if __name__ == "__main__":
    main()
