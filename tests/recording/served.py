"""A server of bytes that a test decides on, standing for a tracker's software."""

import contextlib
import socket
import threading


@contextlib.contextmanager
def server(serve):
    """Yields ``tcp:HOST:PORT``; ``serve(connection)`` is called for each connection in a thread of its own."""
    listening = socket.create_server(("127.0.2.1", 0))

    def accept():
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listening.accept()
                threading.Thread(target=one, args=(connection,), daemon=True).start()

    def one(connection):
        with contextlib.suppress(OSError), connection:
            serve(connection)

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield f"tcp:127.0.2.1:{listening.getsockname()[1]}"
    finally:
        listening.shutdown(socket.SHUT_RDWR)
        listening.close()


def speaking(*pieces, then=None):
    """Serves these bytes, then stays silent until the other side goes."""

    def serve(connection):
        for piece in pieces:
            connection.sendall(piece)
        if then is not None:
            then(connection)
        while connection.recv(100):
            pass

    return serve
