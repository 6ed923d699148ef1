"""An S3 server for tests (moto), and the environment that sends s3fs to it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest


@contextmanager
def s3_server() -> Iterator[None]:
    """An empty server in this process, for all that reads the environment; skips the test where moto is not here."""
    pytest.importorskip("s3fs").S3FileSystem.clear_instance_cache()  # of another test's server
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    try:
        host, port = server.get_host_and_port()
        url = f"http://{host}:{port}"
        httpx.post(f"{url}/moto-api/reset").raise_for_status()
        with pytest.MonkeyPatch.context() as changed:
            for name, value in {
                "AWS_ENDPOINT_URL": url,
                "AWS_ACCESS_KEY_ID": "cell",
                "AWS_SECRET_ACCESS_KEY": "secret",
                "AWS_DEFAULT_REGION": "us-east-1",
            }.items():
                changed.setitem(os.environ, name, value)
            yield
    finally:
        server.stop()
