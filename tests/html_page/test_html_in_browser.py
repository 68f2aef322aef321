"""The HTML page in a real browser, headless Chromium: it draws, without errors and without network."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest
from helpers import browser
from html_page.test_html_report import NASTY, TRIANGLE, shape, twenty_thousand

from remeshvec import html_report, remesh, write_html
from remeshvec.html_page import views as _page_views
from remeshvec.html_page.page import _page_frame

pytest.importorskip("plotly")
Image = pytest.importorskip("PIL.Image")

REASON = browser.why_not()
pytestmark = pytest.mark.skipif(REASON is not None, reason=REASON or "")

CAMERA = (
    "(c => ['eye', 'center', 'up'].flatMap(what => ['x', 'y', 'z'].map(axis => c[what][axis])))"
    "(document.getElementById('view-{}')._fullLayout.scene._scene.getCamera())"
)


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    one = browser.Browser(tmp_path_factory.mktemp("profile"))
    one.size(1200, 1400)
    yield one
    one.close()


@pytest.fixture(scope="module")
def result():
    return remesh(*shape(), 0.3)


@pytest.fixture
def page(chromium, result, tmp_path):
    """A page that is open, drawn, and without complaints."""
    write_html(tmp_path / "a.html", result, title=NASTY)
    chromium.open((tmp_path / "a.html").as_uri())
    yield chromium
    assert chromium.complaints() == []
    assert chromium.requests() == [(tmp_path / "a.html").as_uri()]


def pixels(chromium):
    return np.asarray(Image.open(io.BytesIO(chromium.screenshot())).convert("RGB")).astype(int)


def part(chromium, selector):
    """The pixels of one element."""
    x, y, width, height = chromium.run(
        f"(r => [r.x, r.y, r.width, r.height])"
        f"(document.querySelector({selector!r}).getBoundingClientRect())"
    )
    return pixels(chromium)[round(y) : round(y + height), round(x) : round(x + width)]


def is_drawn(image):
    """Whether a pixel differs from the corner of the picture."""
    return np.abs(image - image[0, 0]).max(axis=2) > 12


def settle(chromium):
    chromium.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def cameras(chromium):
    """Eye, centre and up of both views, nine numbers each."""
    return [np.array(chromium.run(CAMERA.format(name))) for name in ("before", "after")]


def are_close(one, other):
    return np.allclose(one, other, rtol=0, atol=2e-6)


def wait_for_equal_cameras(chromium, but_not):
    """Wait until both views have the same camera, a new one, and return it."""
    end = time.monotonic() + 20
    while time.monotonic() < end:
        before, after = cameras(chromium)
        if are_close(before, after) and not are_close(after, but_not):
            return after
        settle(chromium)
    raise AssertionError(f"not the same: {before}, {after}")


def has_turned(chromium, first):
    """Whether a view turns within two seconds."""
    end = time.monotonic() + 2
    while time.monotonic() < end:
        if not all(are_close(camera, first) for camera in cameras(chromium)):
            return True
        settle(chromium)
    return False


def test_both_views_draw_and_nothing_is_cut(page):
    for name in ("before", "after"):
        image = part(page, f"#view-{name}")
        drawn = is_drawn(image)
        assert drawn.mean() > 0.1
        assert not drawn[[0, -1]].any() and not drawn[:, [0, -1]].any()
        assert len(np.unique(image[drawn].reshape(-1, 3), axis=0)) > 50
    assert page.run("document.querySelectorAll('.view canvas').length") >= 2


def test_histograms_draw(page):
    for chart in range(4):
        shown = page.run(f"document.querySelectorAll('#chart-{chart} .bars .point path').length")
        assert shown >= 10
        colours = np.unique(part(page, f"#chart-{chart}").reshape(-1, 3), axis=0)
        orange = (colours[:, 0] > colours[:, 2] + 40).any()
        blue = (colours[:, 2] > colours[:, 0] + 40).any()
        assert orange and blue


def test_names_are_only_words(page):
    assert page.run("document.title") == NASTY
    assert page.run("document.querySelector('h1').textContent") == NASTY
    assert page.run("document.scripts.length") == 3


@pytest.mark.parametrize("name", ["before", "after"])
def test_turning_one_view_turns_the_other(page, name):
    first, other = cameras(page)
    assert are_close(first, other)
    page.run(
        "window.turns = 0; for (const view of document.querySelectorAll('.view'))"
        " view.on('plotly_relayout', () => { window.turns++; })"
    )
    x, y = page.run(
        "(r => [r.x + r.width / 2, r.y + r.height / 2])"
        f"(document.getElementById('view-{name}').getBoundingClientRect())"
    )

    def mouse(kind, dx=0, **options):
        page.call("Input.dispatchMouseEvent", type=kind, x=x + dx, y=y, **options)

    def drag():
        mouse("mouseMoved")
        mouse("mousePressed", button="left", buttons=1, clickCount=1)
        for dx in (20, 60, 120):
            mouse("mouseMoved", dx, button="left", buttons=1)
            settle(page)

    drag()
    for _ in range(3):  # a page that is still busy misses the press
        if has_turned(page, first):
            break
        mouse("mouseReleased", 120, button="left", clickCount=1)
        drag()
    turned = wait_for_equal_cameras(page, first)  # while the button is held
    mouse("mouseReleased", 120, button="left", clickCount=1)
    mouse("mouseWheel", 120, deltaX=0, deltaY=-200)
    near = wait_for_equal_cameras(page, turned)
    eye = "{'scene.camera.eye': {x: 2, y: 1, z: 0.5}}"
    page.run(f"Plotly.relayout('view-{name}', {eye}).then(() => true)")
    set_by_script = wait_for_equal_cameras(page, near)
    assert are_close(set_by_script[:3], (2, 1, 0.5))
    page.run("document.getElementById('reset').click()")
    assert are_close(wait_for_equal_cameras(page, set_by_script), first)
    time.sleep(0.3)
    turns = page.run("window.turns")
    time.sleep(0.3)
    assert page.run("window.turns") == turns  # no echo


def test_colours_and_edges_can_be_chosen(page):
    def view():
        settle(page)
        return part(page, "#view-after")

    shape_of = view()
    for name, words in (("angle", "60°"), ("area", "4 and more")):
        page.run(f"document.querySelector('input[value={name}]').click()")
        page.wait(f"document.getElementById('ticks').textContent.includes({words!r})")
    page.wait("document.getElementById('view-after').data[0].colorscale[0][1] === '#7a4a0c'")
    assert (np.abs(view() - shape_of).max(axis=2) > 20).mean() > 0.05
    with_edges = view()
    page.run("document.getElementById('edges').click()")
    page.wait("document.getElementById('view-after').data[1].visible === false")
    without = view()
    assert without[is_drawn(without)].mean() > with_edges[is_drawn(with_edges)].mean() + 3


def test_dark_and_narrow(chromium, result, tmp_path):
    write_html(tmp_path / "a.html", result)
    dark = [{"name": "prefers-color-scheme", "value": "dark"}]
    chromium.size(420, 1800)
    chromium.call("Emulation.setEmulatedMedia", features=dark)
    try:
        chromium.open((tmp_path / "a.html").as_uri())
        assert pixels(chromium)[2, 2].max() < 60
        assert is_drawn(part(chromium, "#view-after")).mean() > 0.1
        assert chromium.run("document.documentElement.scrollWidth") <= 420
        light = [{"name": "prefers-color-scheme", "value": "light"}]
        chromium.call("Emulation.setEmulatedMedia", features=light)
        settle(chromium)
        assert pixels(chromium)[2, 2].min() > 200
        assert chromium.complaints() == []
    finally:
        chromium.call("Emulation.setEmulatedMedia", features=[])
        chromium.size(1200, 1400)


@pytest.mark.parametrize("scale", [1e-20, 1e20])
def test_one_face_is_drawn(chromium, tmp_path, scale):
    V = scale * np.array(TRIANGLE[0])
    write_html(tmp_path / "a.html", remesh(V, TRIANGLE[1], 2 * scale))
    chromium.open((tmp_path / "a.html").as_uri())
    for name in ("before", "after"):
        assert is_drawn(part(chromium, f"#view-{name}")).mean() > 0.1
    assert chromium.complaints() == []


def test_views_without_edges_are_drawn(chromium, result, tmp_path, monkeypatch):
    monkeypatch.setattr(_page_views, "MOST_EDGED", 60)
    write_html(tmp_path / "a.html", result)
    chromium.open((tmp_path / "a.html").as_uri())
    assert is_drawn(part(chromium, "#view-before")).mean() > 0.1
    assert chromium.run("document.getElementById('edges')") is None
    assert chromium.complaints() == []


def test_the_frame_of_a_notebook_is_drawn(chromium, result, tmp_path):
    """Its policy and its sandbox let the page draw."""
    frame = _page_frame(html_report(result))
    content = f"<!DOCTYPE html><html data-state='framed'><body>{frame}</body></html>"
    (tmp_path / "a.html").write_text(content, "utf-8")
    chromium.open((tmp_path / "a.html").as_uri())
    end = time.monotonic() + 30
    while time.monotonic() < end:
        image = part(chromium, "iframe")[200:800]
        halves = image[:, : image.shape[1] // 2], image[:, image.shape[1] // 2 :]
        blue = [(half[..., 2] - half[..., 0] > 30).mean() for half in halves]
        if min(blue) > 0.02:
            break
        time.sleep(0.2)
    assert min(blue) > 0.02 and chromium.complaints() == []


@pytest.mark.slow
def test_a_page_of_20000_faces_loads_in_less_than_5_seconds(chromium, tmp_path):
    """The best of three, with everything drawn by the processor, as there is no graphics card."""
    write_html(tmp_path / "a.html", twenty_thousand())
    seconds = [chromium.open((tmp_path / "a.html").as_uri()) for _ in range(3)]
    assert min(seconds) < 5 and chromium.complaints() == []
