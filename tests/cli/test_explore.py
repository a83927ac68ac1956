"""`lcp-lube explore`: token, values refused in place, two pages at once, exports, Ctrl-C; and in a browser, if there is one."""

import base64
import http.client
import io
import json
import os
import shutil
import signal
import socket
import subprocess
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import ENVIRONMENT, python

from lcp_lube import load_scene
from lcp_lube.cli.explore.controls import controls, slider
from lcp_lube.cli.explore.server import Handler, Job
from lcp_lube.registry import scene_names
from lcp_lube.scenes.scene import parse_changes
from lcp_lube.scenes.written import toml_of


@dataclass
class Page:
    """A served page: its address and its process."""

    address: str
    process: subprocess.Popen[str]

    def get(self, path: str, body: dict[str, Any] | bytes | None = None, **headers: str) -> tuple[int, bytes]:
        data = json.dumps(body).encode() if isinstance(body, dict) else body
        kind = {} if data is None else {"Content-Type": "application/json"}
        request = urllib.request.Request(self.address + path, data, {**kind, **headers})
        try:
            with urllib.request.urlopen(request, timeout=120) as reply:
                return reply.status, reply.read()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read()

    def ask(self, level: int = 0, **changes: str) -> dict[str, Any]:
        status, body = self.get("solve", {"changes": changes, "level": level})
        assert status == 200, body
        return json.loads(body.splitlines()[-1])


def served(*words: str) -> Page:
    command = [*python(), "-m", "lcp_lube", "explore", *words, "--no-browser"]
    process = subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return Page(process.stdout.readline().split()[-1], process)


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    found = served("problem1")
    yield found
    found.process.kill()
    found.process.communicate()


def number(answer: dict[str, Any], name: str) -> float:
    return next(one["value"] for one in answer["numbers"] if one["name"] == name)


def test_only_the_address_with_its_token_answers(page: Page) -> None:
    host = page.address.rsplit("/", 2)[0]
    for address in (f"{host}/", f"{host}/{'x' * 32}/", f"{host}/{'x' * 32}/scene"):
        assert Page(address, page.process).get("")[0] == 403
    assert page.get("", Host="evil.example")[0] == 403  # another name that leads to this machine
    assert page.get("")[0] == 200 and page.get("page.js")[0] == 200
    assert page.get("../page.html")[0] in (403, 404) and page.get("nothing")[0] == 404


def test_it_listens_on_this_machine_alone(page: Page) -> None:
    assert page.address.startswith("http://127.0.0.1:")
    port = int(page.address.split(":")[2].split("/")[0])
    lines = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]] if os.name == "posix" else []
    listening = [line[1] for line in lines if line[1].endswith(f":{port:04X}") and line[3] == "0A"]
    assert all(address.startswith("0100007F") for address in listening)


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"h_min": "-1um"}, "greater than 0"),
        ({"h_min": "1 Pa"}, "a length"),
        ({"h_min": "30um"}, "at least h_min"),
        ({"hmin": "1um"}, "h_min"),
        ({"form": "wavy"}, "form"),
    ],
)
def test_a_bad_value_is_refused_in_one_line(page: Page, changes: dict[str, str], said: str) -> None:
    status, body = page.get("solve", {"changes": changes, "level": 0})
    assert status == 400 and said in json.loads(body)["refused"] and "\n" not in json.loads(body)["refused"]
    assert page.ask()["solved"]  # and the next one is answered


@pytest.mark.parametrize(
    "body", [b"", b"[1]", b"{", b'{"changes": 3}', b'{"changes": {"U": 3}}', b'{"level": 1.5}', b'{"level": -1}']
)
def test_what_no_page_sends_is_refused(page: Page, body: bytes) -> None:
    assert page.get("solve", body)[0] in (400, 413)
    assert page.get("solve", b"{}", **{"Content-Type": "text/plain"})[0] == 415  # as a form of another site would
    assert page.get("solve", b"0" * 200_000)[0] == 413


def test_numbers_follow_and_get_finer(page: Page) -> None:
    slow, fast = page.ask(), page.ask(U="10 m/s")
    assert number(fast, "load") == pytest.approx(2 * number(slow, "load"), rel=1e-2)  # p grows with mu U; a first answer
    fine = slow
    for level in range(1, 10):
        if fine["last"]:
            break
        fine = page.ask(level)
    assert fine["last"] and (fine["reached"] or fine["seconds"] > 0.5)  # on a machine that others use too
    assert fine["reached"] == (fine["estimate"] <= 1e-3)
    p = np.frombuffer(base64.b64decode(fine["fields"]["p"]["values"]), dtype="<f4")
    assert p.max() == pytest.approx(number(fine, "p_max"), rel=1e-6) and p.size == len(fine["axes"]["x"]["values"])
    assert fine["why"] and fine["quantity"] == "load"


def test_two_pages_at_once_do_not_mix(page: Page) -> None:
    speeds = [1.0 + k % 2 for k in range(12)]
    with ThreadPoolExecutor(4) as pool:
        loads = list(pool.map(lambda speed: number(page.ask(U=str(speed)), "load"), speeds))
    assert loads == [pytest.approx(loads[0] * speed, rel=1e-2) for speed in speeds]


def test_a_film_in_time_is_shown_on_its_way_and_given_up_when_the_hand_moves() -> None:
    """The first answer is a film before the end; the whole march comes in lines; a page that leaves holds nobody up."""
    found = served("moving_texture")
    try:
        first = found.ask()
        t, end = first["time"]
        assert first["solved"] and not first["last"] and 0 < t < end and first["fields"]["p"]
        status, body = found.get("solve", {"changes": {"motion.steps": "40"}, "level": 1})
        lines = [json.loads(line) for line in body.splitlines()]
        times = [line["time"][0] for line in lines[:-1]]
        assert status == 200 and times == sorted(times) and "time" not in lines[-1] and "40 time steps" in lines[-1]["message"]
        host, port = found.address.split("/")[2].split(":")
        path = "/" + found.address.split("/")[3]
        left = http.client.HTTPConnection(host, int(port))
        changes = {"motion.steps": "1000000"}  # which would take hours
        left.request(
            "POST", f"{path}/solve", json.dumps({"changes": changes, "level": 1}), {"Content-Type": "application/json"}
        )
        assert found.ask()["solved"]  # a hand comes before what is refined
        left.close()
        assert found.ask(1, **{"motion.steps": "40"})["solved"]
    finally:
        found.process.kill()
        found.process.communicate()


def test_a_stream_ends_with_its_answer_however_long_it_takes() -> None:
    """The connection's end is the stream's; while it was left open, a page waited a minute for it."""
    ours, theirs = socket.socketpair()
    handler = Handler.__new__(Handler)
    handler.connection, handler.wfile, handler.close_connection = theirs, io.BytesIO(), False
    handler.request_version, handler.requestline, handler.command = "HTTP/1.1", "POST /solve HTTP/1.1", "POST"
    handler.server_of_page = SimpleNamespace(ask=lambda job: asked.append(job))  # type: ignore[assignment]
    asked: list[Job] = []
    answering = threading.Thread(target=handler._ask, args=("solve", {}))
    answering.start()
    while not asked:
        time.sleep(0.01)
    asked[0].replies.put(b"{}")
    time.sleep(0.35)  # longer than it waits at a time
    asked[0].replies.put((b"{}", "application/json"))
    answering.join(20)
    assert handler.close_connection and handler.wfile.getvalue().endswith(b"{}\n{}")
    ours.close()
    theirs.close()


def test_exports(page: Page, tmp_path: Path) -> None:
    status, toml = page.get("toml", {"changes": {"h_min": "10um"}})
    assert status == 200
    (tmp_path / "mine.toml").write_bytes(toml)
    assert load_scene(tmp_path / "mine.toml").data_si() == load_scene("problem1", h_min=1e-5).data_si()
    pytest.importorskip("matplotlib")
    status, picture = page.get("picture", {"changes": {"h_min": "10um"}, "level": 1})
    assert status == 200 and picture.startswith(b"\x89PNG")


def test_ctrl_c_ends_it() -> None:
    found = served("problem1")
    found.process.send_signal(signal.SIGINT)
    _, err = found.process.communicate(timeout=20)
    assert found.process.returncode == 0 and err.strip() == "lcp-lube: the page has ended", err


@pytest.mark.parametrize("words, said", [(["problem9"], "problem9"), (["problem1", "--port", "70000"], "--port")])
def test_bad_input(cli: Callable[..., Any], words: list[str], said: str) -> None:
    done = cli("explore", *words, "--no-browser")
    assert done.status == 2 and said in done.err and len(done.lines) == 1


@pytest.mark.parametrize("name", scene_names())
def test_sliders_of_every_scene_stay_in_what_the_model_allows(name: str) -> None:
    """Each end of each slider is a value that the key may have by itself; the scene as written reads as the same scene."""
    scene = load_scene(name)
    found = controls(scene)
    assert len({one.key for one in found}) == len(found)
    for one in found:
        if one.kind != "number":
            continue
        assert one.low <= one.value <= one.high and (not one.log or one.low > 0), one
        for end in (one.low, one.high):
            value = str(int(end)) if one.whole else repr(float(end))
            try:
                load_scene(scene, parse_changes([f"{one.key}={value}"]))
            except ValueError as error:
                # It contradicts another key, as the line says: no limit of its own.
                assert "allowed is" not in str(error), (one, error)


@pytest.mark.parametrize("name", scene_names())
def test_a_scene_as_written_is_the_same(name: str, tmp_path: Path) -> None:
    scene = load_scene(name)
    (tmp_path / "again.toml").write_text(toml_of(scene), encoding="utf-8")
    assert load_scene(tmp_path / "again.toml").data_si() == scene.data_si()


def test_ranges() -> None:
    assert slider(15e-6, "m", False, {"exclusiveMinimum": 0}) == {"low": 1.5e-6, "high": 10 * 15e-6, "log": True}
    assert slider(0.5, "", False, {"minimum": 0, "exclusiveMaximum": 1}) == {"low": 0, "high": 0.98, "log": False}
    assert slider(0.001, "", False, {"exclusiveMinimum": 0, "exclusiveMaximum": 1})["log"]
    assert slider(0.0, "Pa", False, {})["low"] < 0 < slider(0.0, "Pa", False, {})["high"]
    assert slider(5, "", True, {"minimum": 1}) == {"low": 1, "high": 20, "log": False}


def test_in_a_browser(page: Page) -> None:
    """Load, move, see the number change, a bad value refused in place, two pages, no request to elsewhere."""
    api = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no chromium")
    urls: list[str] = []
    with api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        first, second = browser.new_page(), browser.new_page()
        for one in (first, second):
            one.on("request", lambda request: urls.append(request.url))
            one.goto(page.address)
            one.wait_for_selector("#state[data-last=true]")
        load = first.locator("tr[data-name=load] td:last-child")
        before = load.text_content()
        first.locator(".control[data-key=U] input[type=range]").fill("1000")
        api.expect(load).not_to_have_text(before)
        assert second.locator("tr[data-name=load] td:last-child").text_content() == before
        field = first.locator(".control[data-key=h_min] input[type=text]")
        field.fill("-3um")
        field.press("Enter")
        api.expect(first.locator(".control[data-key=h_min] .fault")).to_contain_text("greater than 0")
        assert field.get_attribute("aria-invalid") == "true"
        field.fill("12 um")
        field.press("Enter")
        api.expect(first.locator(".control[data-key=h_min] .fault")).to_be_empty()
        with first.expect_download() as download:
            first.click("#toml")
        assert "h_min" in Path(download.value.path()).read_text()
        browser.close()
    origin = page.address.split("/")[2]
    assert {url.split("/")[2] for url in urls if url.startswith("http")} == {origin}
