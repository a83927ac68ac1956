"""The page's server: 127.0.0.1 alone, a token in the address, nothing fetched from anywhere else.

Of the standard library: Panel, marimo and trame would each bring a web framework (tornado and bokeh, starlette, aiohttp) for
one page, and run Python in threads of their own, where PETSc must be called from one. Here handlers only queue what a page
asks, and the thread that started PETSc answers: a hand that moves before grids that are refined, these meanwhile.
"""

import hmac
import itertools
import json
import queue
import secrets
import select
import signal
import socket
import threading
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any, Self

from ...errors import InputError
from .answers import JSON, Answers

HOST = "127.0.0.1"
LARGEST = 100_000  # bytes of a request
PAGE = {"": ("page.html", "text/html"), "page.js": ("page.js", "text/javascript"), "page.css": ("page.css", "text/css")}
# The browser itself refuses whatever would leave this machine.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

HEADERS = {
    "Content-Security-Policy": POLICY,
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class Gone(Exception):
    """Nobody waits for the answer any more."""


@dataclass
class Job:
    """What a page asks. replies : lines on the way, as bytes, then the answer and its kind, or what was raised."""

    what: str
    request: dict[str, Any]
    replies: queue.SimpleQueue[bytes | tuple[bytes, str] | Exception] = field(default_factory=queue.SimpleQueue)
    gone: bool = False

    @property
    def waits(self) -> bool:
        """Whether it may take seconds: a finer grid."""
        return self.what == "picture" or (self.what == "solve" and self.request.get("level", 0) != 0)


class Server:
    """Handlers in threads, answers in the thread that calls `serve`; address: of the page, with its token."""

    def __init__(self, answers: Answers, port: int = 0):
        self.answers = answers
        self.token = secrets.token_urlsafe(24)
        self.asked: queue.PriorityQueue[tuple[bool, int, Job]] = queue.PriorityQueue()
        self._count = itertools.count()
        handler = type("PageHandler", (Handler,), {"server_of_page": self})
        try:
            self._http = ThreadingHTTPServer((HOST, port), handler)
        except OSError as error:
            raise InputError(f"--port {port}: {error.strerror}; 0 takes a free one") from None
        self._http.daemon_threads = True
        self.host = f"{HOST}:{self._http.server_address[1]}"
        self.address = f"http://{self.host}/{self.token}/"

    def __enter__(self) -> Self:
        if hasattr(signal, "SIGPIPE"):
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # a page that leaves in the middle of a line ends no server
        threading.Thread(target=self._http.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *raised: object) -> None:
        self._http.shutdown()
        self._http.server_close()

    def ask(self, job: Job) -> None:
        """Have it answered."""
        self.asked.put((job.waits, next(self._count), job))

    def serve(self) -> None:
        """Answer until KeyboardInterrupt."""
        while True:
            try:
                _, _, job = self.asked.get(timeout=0.5)  # wakes up: a signal is looked at between two waits
            except queue.Empty:
                continue
            self._answer(job)

    def _answer_quick(self) -> None:
        """What hands wait for; this thread alone takes jobs away."""
        while self.asked.qsize() and not self.asked.queue[0][0]:
            self._answer(self.asked.get()[-1])

    def _answer(self, job: Job) -> None:
        def alive(*news: Any) -> None:
            if job.gone:
                raise Gone
            if job.waits:
                self._answer_quick()

        try:
            alive()
            job.replies.put(self.answers.reply(job.what, job.request, alive, job.replies.put))
        except Exception as error:  # one page's fault is no other's
            job.replies.put(error)


class Handler(BaseHTTPRequestHandler):
    """One connection of a browser."""

    server_of_page: Server
    protocol_version = "HTTP/1.1"
    timeout = 60.0  # of a connection on which nothing comes

    def do_GET(self) -> None:
        name = self._inside()
        if name is None:
            return
        if name in PAGE:
            file, kind = PAGE[name]
            self._send(200, (files(__package__) / file).read_bytes(), f"{kind}; charset=utf-8")
        elif name == "scene":
            self._ask(name, {})
        else:
            self._refuse(404, "no such page")

    def do_POST(self) -> None:
        name = self._inside()
        if name is None:
            return
        if self.headers.get_content_type() != JSON:
            self._refuse(415, "JSON is needed")  # which no form of another site can send
            return
        try:
            length = int(self.headers.get("Content-Length", ""))
        except ValueError:
            length = -1
        if not 0 <= length <= LARGEST:
            self._refuse(413, f"a request of at most {LARGEST} bytes, with its length, is needed")
            return
        try:
            request = json.loads(self.rfile.read(length))
        except (ValueError, RecursionError):
            request = None
        if not isinstance(request, dict):
            self._refuse(400, "a JSON object is needed")
            return
        self._ask(name, request)

    def _inside(self) -> str | None:
        """The path behind the token; None, and refused, if token or host is not ours."""
        page = self.server_of_page
        token, _, name = self.path.partition("?")[0].lstrip("/").partition("/")
        # The name of the host too: another site's name that leads to 127.0.0.1 is not ours.
        if not hmac.compare_digest(token.encode(), page.token.encode()) or self.headers.get("Host") != page.host:
            self._refuse(403, "the address that lcp-lube has printed is needed, with its token")
            return None
        return name

    def _ask(self, what: str, request: dict[str, Any]) -> None:
        job, page, streams = Job(what, request), self.server_of_page, False
        page.ask(job)
        while True:
            try:
                reply = job.replies.get(timeout=0.1)
            except queue.Empty:
                if self._left():
                    job.gone = self.close_connection = True
                    return
                continue
            if isinstance(reply, bytes):  # a film on its way in time: a line each, and the connection's end is the answer's
                self._send(200, reply, JSON, streams, ends=False)
                streams, job.gone = True, self._left()
                if job.gone:
                    return
            elif isinstance(reply, Exception):
                words = str(reply) if isinstance(reply, InputError) else f"{type(reply).__name__}: {reply}"
                self._refuse(400 if isinstance(reply, InputError) else 500, words, streams)
                return
            else:
                self._send(200, *reply, streams)
                return

    def _left(self) -> bool:
        """Whether the page has ended the connection: its hand has moved on, or it was closed."""
        try:
            ready, _, _ = select.select([self.connection], [], [], 0.0)
            return bool(ready) and self.connection.recv(1, socket.MSG_PEEK) == b""
        except (OSError, ValueError):
            return True

    def _refuse(self, status: int, words: str, streams: bool = False) -> None:
        self.close_connection = True  # whatever was sent along is not read
        self._send(status, json.dumps({"refused": words}).encode(), JSON, streams)

    def _send(self, status: int, body: bytes, kind: str, streams: bool = False, ends: bool = True) -> None:
        """An answer, or one of several lines of it. streams : the first one was sent; ends : this is the last one."""
        self.close_connection |= not ends
        length = {"Content-Length": str(len(body))} if ends else {}
        closes = {"Connection": "close"} if self.close_connection else {}
        try:
            if not streams:
                self.send_response(status)
                for name, value in {"Content-Type": kind, **HEADERS, **length, **closes}.items():
                    self.send_header(name, value)
                self.end_headers()
            self.wfile.write(body if ends else body + b"\n")
        except ConnectionError:
            self.close_connection = True  # the page was closed

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: addresses have the token in them."""
