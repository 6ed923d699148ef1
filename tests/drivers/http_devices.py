"""A real HTTP server in a thread, whose answer a test may change at any time."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class Answer:
    """What the device answers. `announced` is a Content-Length that may be a lie."""

    content: bytes = b""
    media_type: str = "image/png"
    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)
    announced: int | None = None
    hangs: threading.Event | None = None


class HttpDevice:
    """`answer` is given to each request, unless `answers` has one for its path; `url` is where."""

    def __init__(self, answer: Answer, port: int = 0) -> None:
        self.answer = answer
        self.answers: dict[str, Answer] = {}
        self.asked = 0
        device = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                device.asked += 1
                answer = device.answers.get(self.path, device.answer)
                if answer.hangs is not None:
                    answer.hangs.wait(20)
                self.send_response(answer.status)
                self.send_header("Content-Type", answer.media_type)
                announced = len(answer.content) if answer.announced is None else answer.announced
                self.send_header("Content-Length", str(announced))
                for name, value in answer.headers.items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(answer.content)

            def log_message(self, *_: object) -> None:
                pass

        class Server(ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, *_: object) -> None:
                """The client went away in the middle: that is what some tests do."""

        self._server = Server(("127.0.0.1", port), Handler)
        self.port = self._server.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/now"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        if self.answer.hangs is not None:
            self.answer.hangs.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


@contextmanager
def http_device(answer: Answer, port: int = 0) -> Iterator[HttpDevice]:
    """The device, for as long as the block lasts."""
    device = HttpDevice(answer, port)
    try:
        yield device
    finally:
        device.close()
