"""The picture of `lcp-lube explore` in docs/explore.md, by playwright and a Chromium without a window."""

import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path


def main(target: str) -> None:
    try:
        from PIL import Image
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        sys.exit(f"explorer_picture: {error}; pip install playwright")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        sys.exit("explorer_picture: no chromium")
    command = [sys.executable, "-m", "lcp_lube", "explore", "journal", "--no-browser"]
    page_of = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert page_of.stdout is not None
    address = page_of.stdout.readline().split()[-1]
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1100, "height": 760})
        page.goto(address)
        page.wait_for_selector("#state[data-last=true]")
        page.locator(".control[data-key=eccentricity] input[type=range]").fill("700")
        page.wait_for_selector("#state[data-level='0']")
        page.wait_for_selector("#state[data-last=true]")
        page.screenshot(path=f"{folder}/page.png")
        browser.close()
        with Image.open(f"{folder}/page.png") as image:
            image.convert("RGB").quantize(128).save(Path(target), optimize=True)
    page_of.send_signal(signal.SIGINT)
    page_of.wait(20)


if __name__ == "__main__":
    main(sys.argv[1])
