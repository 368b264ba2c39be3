"""Pictures a second of the page, alone and served, in a headless Chromium that draws in software.

python fits/play-lobe/pictures.py [FILE]   after the study (its surrogate is taken, or FILE's); writes pictures.json
"""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from playwright.sync_api import sync_playwright

from tissuejax.storage import write_json

HERE = Path(__file__).parent
FILE = (
    Path(sys.argv[1]).resolve()
    if len(sys.argv) > 1
    else HERE.resolve().parents[1] / "out" / "play-lobe" / "slab.play.h5"
)
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--ignore-gpu-blocklist"]  # fmt: skip
READY = "typeof model !== 'undefined' && model !== null && pictures > 1 && window.reply"
SECONDS, PATIENCE = 15.0, 240_000  # s, ms


def spent() -> float:
    """CPU seconds of the browser so far: of every Chromium on this machine; run no other beside."""
    total = 0.0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, fields = stat.read_text().rsplit(")", 1)
        except OSError:
            continue
        if "chrom" in name:
            total += sum(map(int, fields.split()[11:13])) / os.sysconf("SC_CLK_TCK")
    return total


def drawn(tab) -> dict:
    """Pictures over elapsed time while the probe is pressed and dragged; and CPU time of the page's own thread, which
    computes and gives orders but draws nothing: a GPU would take the rest over."""
    tab.wait_for_function(READY, timeout=PATIENCE)
    thread = tab.context.new_cdp_session(tab)
    thread.send("Performance.enable", {"timeDomain": "threadTicks"})
    own = lambda: {m["name"]: m["value"] for m in thread.send("Performance.getMetrics")["metrics"]}["TaskDuration"]  # noqa: E731
    before = own()
    cpu, load, begun, first = spent(), os.getloadavg(), time.monotonic(), tab.evaluate("pictures")
    while time.monotonic() - begun < SECONDS:
        share = (time.monotonic() - begun) / SECONDS
        tab.evaluate(f"press({6e-3 * (2 * share - 1)}, 0.0, {4e-3 * min(1, 4 * share)})")
        tab.wait_for_timeout(50)
    took, cpu, count = time.monotonic() - begun, spent() - cpu, tab.evaluate("pictures") - first
    canvas = tab.evaluate("[document.querySelector('canvas').width, document.querySelector('canvas').height]")
    return {"pictures_per_s": count / took, "seconds": took, "load": list(load), "cpu_s_per_picture": cpu / count,
            "pictures_per_cpu_s": count / cpu, "canvas": canvas,
            "page_s_per_picture": (own() - before) / count}  # fmt: skip


def main() -> dict:
    """Both pages, and a picture of one."""
    found, page = {}, FILE.with_name("page.html")
    command = [sys.executable, "-m", "tissuejax", "play", str(FILE)]
    subprocess.run([*command, "--export", str(page)], check=True, capture_output=True)
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS, timeout=PATIENCE)
        tab = browser.new_page(viewport={"width": 900, "height": 600})
        tab.goto(page.as_uri(), timeout=PATIENCE)
        found["alone"] = drawn(tab)
        tab.screenshot(path=str(HERE / "figures" / "page.png"))
        tab.close()
        server = subprocess.Popen([*command, "--port", "8791", "--seconds", "90"], stdout=subprocess.PIPE, text=True)
        try:
            server.stdout.readline()
            tab = browser.new_page(viewport={"width": 900, "height": 600})
            tab.goto("http://127.0.0.1:8791/", timeout=PATIENCE)
            found["served"] = drawn(tab)
        finally:
            server.terminate()
            server.wait()
        browser.close()
    write_json(HERE / "pictures.json", found)
    return found


if __name__ == "__main__":
    print(json.dumps(main(), indent=1))
