"""Requests that no browser sends: refused, without a traceback, and the server goes on."""

import socket
import urllib.error
import urllib.request

import pytest

from labrig.local_server import MAX_CONNECTIONS, LocalServer, RequestHandler


@pytest.fixture
def server() -> LocalServer:
    return LocalServer(0, RequestHandler)


def said(server: LocalServer, request: str) -> bytes:
    """The answer to a request, to the end of the connection."""
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=5) as connection:
        connection.sendall(request.encode("latin-1"))
        connection.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: connection.recv(4096), b""))


MALFORMED = [
    "GET http://[/ HTTP/1.1\r\n{host}\r\n",
    "GET //[x/ HTTP/1.1\r\n{host}\r\n",
    "POST /{token}/x HTTP/1.1\r\n{host}Content-Length: " + "9" * 5000 + "\r\n\r\n",
    "POST /{token}/x HTTP/1.1\r\n{host}Content-Length: -1\r\n\r\n",
    "POST /{token}/x HTTP/1.1\r\n{host}Content-Length: \xb2\r\n\r\n",
    "GET /{token}/x?" + "%" * 2000 + " HTTP/1.1\r\n{host}\r\n",
    "GET /{token}/x HTTP/9.9.9\r\n{host}\r\n",
    "\x00\x01\x02\r\n\r\n",
    "GET /\xff\xfe HTTP/1.1\r\n{host}\r\n",
]


@pytest.mark.parametrize("request_text", MALFORMED)
def test_a_malformed_request_is_refused(
    server: LocalServer, capfd: pytest.CaptureFixture[str], request_text: str
) -> None:
    host = f"Host: 127.0.0.1:{server.server_port}\r\n"
    with server.running():
        answer = said(server, request_text.replace("{host}", host).replace("{token}", server.token))
        again = said(server, f"GET /{server.token}/x HTTP/1.1\r\n{host}\r\n")
    assert b" 200 " not in answer.partition(b"\r\n")[0]
    assert b" 500 " not in answer.partition(b"\r\n")[0]
    assert again.startswith(b"HTTP/1.1 404")
    assert capfd.readouterr().err == ""


def test_connections_beyond_what_a_page_needs_are_closed(server: LocalServer) -> None:
    with server.running():
        address = ("127.0.0.1", server.server_port)
        idle = [socket.create_connection(address, timeout=5) for _ in range(MAX_CONNECTIONS)]
        with socket.create_connection(address, timeout=5) as one_more:
            assert one_more.recv(1) == b""
        for connection in idle:
            connection.close()
        with pytest.raises(urllib.error.HTTPError, match="403"):
            _answered(server)


def _answered(server: LocalServer) -> None:
    """Ask until a connection is free: those that were closed end in their own time."""
    for _ in range(100):
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{server.server_port}/", timeout=5)
        except (ConnectionError, urllib.error.URLError) as error:
            if isinstance(error, urllib.error.HTTPError):
                raise
