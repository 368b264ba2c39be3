"""The page in a headless Chromium, alone and served; skipped, with the reason, where there is none."""

import asyncio
import shutil
import threading

import numpy as np
import pytest

from tests.surrogate import made
from tissuejax.play import blob, page
from tissuejax.play.server import Server
from tissuejax.play.session import SurrogateSession
from tissuejax.surrogate.live.ask import Asker

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine; `make browser-test` installs it"),
]
READY = "typeof model !== 'undefined' && model !== null && pictures > 1 && window.reply"


@pytest.fixture(scope="module")
def browser():
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed; `make browser-test`")
    with api.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def model():
    return blob.of_surrogate(made.small(), ["measured"])


def opened(browser, url):
    """A page, and what went wrong in it."""
    faults = []
    tab = browser.new_page(viewport={"width": 900, "height": 600})
    tab.on("pageerror", lambda fault: faults.append(str(fault)))
    tab.goto(url)
    tab.wait_for_function(READY, timeout=90_000)
    return tab, faults


def pressed(tab, depth):
    tab.evaluate(f"press(probe[0], probe[1], {depth})")
    tab.wait_for_function(f"Math.abs(window.reply.depth - {depth}) < 2e-5", timeout=60_000)


def test_alone_it_presses_relaxes_and_agrees_with_python(browser, model, tmp_path):
    tab, faults = opened(browser, page.export(model, tmp_path / "page.html").as_uri())
    tab.evaluate("for (const k of ['cut', 'probe', 'probe', 'arrow', 'cut']) toggle(k)")
    for _ in range(30):
        tab.mouse.move(300, 250)
        tab.mouse.wheel(0, 100)
    assert tab.evaluate("depth()") > 0
    got = tab.evaluate(
        "(() => { const t = new Tissue(model), p = model.start.slice(); p[2] = crown(p[0], p[1]) + 1e-3;"
        " t.tick(p, 0.01);"
        " const out = []; for (let i = 1; i <= 40; i++) { p[0] += 4e-5; p[2] -= 6e-5;"
        " out.push(t.tick(p, 0.02).force); }"
        " return out; })()"
    )
    surrogate = made.small().surrogate
    asker, p = Asker(surrogate), [*model["start"][:2], model["high_z"] + 1e-3]
    asker.tick(p, 0.01)
    wanted = []
    for _ in range(40):
        p = [p[0] + 4e-5, p[1], p[2] - 6e-5]
        wanted.append(asker.tick(p, 0.02))
    assert wanted[-1][2] > 0.01
    for ours, theirs in zip(wanted, got, strict=True):
        assert theirs == pytest.approx(list(ours), abs=2e-6)
    shot = tab.screenshot()
    assert len(set(shot)) > 100
    assert not faults


def test_residuals_of_markers_colour_the_surface_between_them(browser, tmp_path):
    found = made.small()
    middle = np.append(np.asarray(found.surrogate.low + found.surrogate.high) / 2, 0.018)
    rest = middle + 1e-3 * np.array([[-2, 0, 0], [0, 0, 0], [2, 0, 0], [0, 2.5, 0]])
    measured = np.tile(rest, (2, 1, 1))
    measured[:, 3] = np.nan  # hidden from the cameras all the time
    predicted = measured + 1e-4 * np.arange(4)[None, :, None] * np.array([0, 0, 1])
    replay = {
        "name": "r1", "duration": 1.0, "frames": 2, "text": "", "points": 4,
        "time": blob.coded([0, 1]), "path": blob.coded(np.tile(middle + [0, 0, 2e-3], (2, 1))),
        "measured": blob.coded(np.zeros((2, 3))), "predicted": blob.coded(np.zeros((2, 3))),
        "markers": blob.coded(measured), "simulated": blob.coded(predicted),
    }  # fmt: skip
    url = page.export(blob.of_surrogate(found, ["measured"], replay), tmp_path / "page.html").as_uri()
    tab, faults = opened(browser, url)
    tab.select_option("#map", "3")
    assert tab.evaluate("replay.most") == pytest.approx(2e-4, rel=1e-4)
    plan = [float(x) for x in [*rest[0, :2], *rest[2, :2], *((rest[0] + rest[1]) / 2)[:2], 1.0, 1.0]]
    got = tab.evaluate(
        f"(() => {{ const v = new Float32Array(4); residualAt({plan}, v);"
        " return Array.from(v, x => x * replay.most); })()"
    )
    assert got[0] == pytest.approx(0, abs=1e-5)
    assert got[1] == pytest.approx(2e-4, abs=1e-5)
    assert 3e-5 < got[2] < 1e-4
    assert got[3] < 0  # no marker near
    tab.wait_for_function("document.getElementById('range').textContent.includes('0.20 mm')", timeout=60_000)
    assert not faults


def test_served_two_tabs_reload_and_the_server_gone(browser, model):
    ready, box = threading.Event(), {}

    def run():
        async def main():
            box["server"], box["loop"] = (
                Server(SurrogateSession(model, Asker(made.small().surrogate)), port=0),
                asyncio.get_running_loop(),
            )
            await box["server"].run(lambda url: (box.update(url=url), ready.set()))

        asyncio.run(main())

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    ready.wait(30)
    one, faults = opened(browser, box["url"])
    two, more = opened(browser, box["url"])
    pressed(one, 1.5e-3)
    two.wait_for_function("window.reply.depth > 1.4e-3", timeout=60_000)
    assert two.evaluate("window.reply.force[2]") > 0.01
    two.reload()
    two.wait_for_function(READY, timeout=60_000)
    two.wait_for_function("window.reply.depth > 1.4e-3", timeout=60_000)
    box["loop"].call_soon_threadsafe(box["server"].stop.set)
    thread.join(30)
    one.wait_for_function("document.getElementById('banner').style.display === 'block'", timeout=60_000)
    assert "server is gone" in one.inner_text("#banner")
    assert not faults + more
