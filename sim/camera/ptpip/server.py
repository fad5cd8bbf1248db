"""The simulated camera on a network of one PC: PTP/IP on 127.0.0.1, one host at a time.

A host makes two connections. It introduces itself on the first, which then carries its
transactions; on the second, which names the first, the camera reports events.
"""

import select
import socket
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from labrig.foundation.clock import CHECK_INTERVAL_S, Clock, VirtualClock
from labrig.foundation.errors import UsageError

from ..responder import Responder
from . import packets as ptpip
from .packets import FailReason, MalformedPacketError, Packet, PacketReader, PacketType
from .transactions import Transactions

_MAX_AT_ONCE = 65536


class Connection:
    """A connection that a host made to the server.

    Parameters
    ----------
    accepted
        Accepted socket, which this object owns.
    """

    def __init__(self, accepted: socket.socket) -> None:
        accepted.setblocking(False)
        # a response is one small packet that somebody waits for
        accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = accepted
        self._reader = PacketReader()
        self._outgoing: deque[memoryview] = deque()
        self._head_is_cut = False

    def fileno(self) -> int:
        """Return the socket's file descriptor, for `select`."""
        return self._socket.fileno()

    @property
    def is_sending(self) -> bool:
        """True while packets wait to be sent."""
        return bool(self._outgoing)

    def receive(self) -> bool:
        """Take in the bytes that have come; return False if the other side is gone."""
        try:
            received = self._socket.recv(_MAX_AT_ONCE)
        except BlockingIOError:
            return True
        except OSError:
            return False
        self._reader.feed(received)
        return bool(received)

    def next_packet(self) -> Packet | None:
        """Return the next complete packet.

        Raises
        ------
        MalformedPacketError
            The bytes are no packet.
        """
        return self._reader.next_packet()

    def put(self, packets: list[bytes]) -> None:
        """Queue these packets after those that still wait."""
        self._outgoing.extend(memoryview(packet) for packet in packets)

    def put_instead(self, packets: list[bytes]) -> None:
        """Queue these packets in place of waiting ones; one that is half sent is completed."""
        half_sent = [self._outgoing[0]] if self._head_is_cut else []
        self._outgoing = deque(half_sent)
        self.put(packets)

    def send(self) -> bool:
        """Send as much as the other side takes now; return False if it is gone."""
        try:
            while self._outgoing:
                head = self._outgoing[0]
                sent_bytes = self._socket.send(head)
                self._head_is_cut = sent_bytes < len(head)
                if self._head_is_cut:
                    self._outgoing[0] = head[sent_bytes:]
                else:
                    self._outgoing.popleft()
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class Pace:
    """Coupling of a simulated room's time to that of the PC.

    The room's clock stands still inside a transaction and is advanced before the next.

    Parameters
    ----------
    clock
        The PC's clock.
    room_clock
        The room's clock, which nothing else advances.
    """

    def __init__(self, clock: Clock, room_clock: VirtualClock) -> None:
        self._clock = clock
        self._room_clock = room_clock
        self._zero_s = clock.now() - room_clock.now()

    def catch_up(self) -> float:
        """Advance the room's clock to the PC's; return the room's time."""
        behind_s = self._clock.now() - self._zero_s - self._room_clock.now()
        self._room_clock.spend(max(0.0, behind_s))
        return self._room_clock.now()


#: Address of the server, which no other PC can reach.
LOOPBACK = "127.0.0.1"
#: Largest number of unidentified connections; the oldest is closed for a new one.
_MAX_UNIDENTIFIED = 8
_GUID = b"labrig simulated"
_GUID_BYTES = 16
#: Longer than the 39 letters of the standard, because libgphoto2 sends the PC's name as it is.
_MAX_NAME_BYTES = 512


@dataclass
class _Host:
    """Host that uses the camera."""

    number: int
    command: Connection
    transactions: Transactions
    event: Connection | None = None


class PtpIpServer:
    """Server of one camera, to be closed at the end.

    Parameters
    ----------
    responder
        Responder of the camera.
    catch_up
        Function that advances the camera's time and returns it.
    port
        TCP port on 127.0.0.1; 0 for any that is free.

    Raises
    ------
    UsageError
        The port is taken.
    """

    def __init__(self, responder: Responder, catch_up: Callable[[], float], port: int = 0) -> None:
        self._responder = responder
        self._catch_up = catch_up
        try:
            self._listener = socket.create_server((LOOPBACK, port))
        except (OSError, OverflowError) as error:
            raise UsageError(
                f"cannot listen on port {port} of {LOOPBACK} ({error}); choose another, or 0 for "
                "any that is free"
            ) from None
        self._listener.setblocking(False)
        self._strangers: list[Connection] = []
        self._host: _Host | None = None
        self._hosts_so_far = 0

    @property
    def port(self) -> int:
        """TCP port on which the server listens."""
        port: int = self._listener.getsockname()[1]
        return port

    @property
    def address(self) -> str:
        """Address of this camera in a rig file."""
        return f"ptpip://{LOOPBACK}:{self.port}"

    def serve(self, clock: Clock) -> NoReturn:
        """Serve until `clock` is interrupted.

        Raises
        ------
        Interrupted
            A stop was requested.
        """
        while True:
            self.serve_once(CHECK_INTERVAL_S)
            clock.sleep(0.0)

    def serve_once(self, patience_s: float) -> None:
        """Serve the waiting packets; wait for some at most for that time."""
        self._report_events(self._catch_up())
        connections = self._connections()
        sending = [connection for connection in connections if connection.is_sending]
        # a host that does not read its answer is not asked for its next command
        listening: list[socket.socket | Connection] = [self._listener]
        listening += [connection for connection in connections if not connection.is_sending]
        due_in_s = max(0.0, self._responder.event_due_s() - self._catch_up())
        patience_s = min(patience_s, due_in_s)
        readable, writable, _ = select.select(listening, sending, [], patience_s)
        self._catch_up()
        # all that hung up are noticed before anybody new is let in
        for connection in connections:
            if connection in readable and not connection.receive():
                self._hang_up(connection)
        for connection in connections:
            if connection in readable or connection in writable:
                self._advance(connection)
        if self._listener in readable:
            self._accept()

    def close(self) -> None:
        """Close all connections and stop listening."""
        for connection in self._connections():
            self._hang_up(connection)
        self._listener.close()

    def _connections(self) -> list[Connection]:
        used = [] if self._host is None else [self._host.command, self._host.event]
        return [*self._strangers, *(connection for connection in used if connection)]

    def _accept(self) -> None:
        try:
            accepted, _ = self._listener.accept()
        except OSError:
            return  # it has hung up already
        self._strangers.append(Connection(accepted))
        if len(self._strangers) > _MAX_UNIDENTIFIED:
            self._hang_up(self._strangers[0])

    def _report_events(self, now_s: float) -> None:
        host = self._host
        if host and host.event and self._responder.event_due_s() <= now_s:
            event = self._responder.take_event()
            host.event.put([ptpip.event(event.code, event.params)])
            self._send(host.event)

    def _advance(self, connection: Connection) -> None:
        """Send queued packets, then process received ones, as long as both go on."""
        try:
            while self._send(connection) and (packet := connection.next_packet()):
                self._take(connection, packet)
        except MalformedPacketError:
            self._hang_up(connection)

    def _send(self, connection: Connection) -> bool:
        """Return whether all is sent and the other side is still there."""
        if connection not in self._connections():
            return False
        if not connection.send():
            self._hang_up(connection)
            return False
        if connection.is_sending:
            return False
        if self._host and connection is self._host.command:
            self._host.transactions.answered()
        return True

    def _take(self, connection: Connection, packet: Packet) -> None:
        host = self._host
        if connection in self._strangers:
            self._introduce(connection, packet)
        elif packet.kind == PacketType.PING:
            connection.put([ptpip.packet(PacketType.PONG)])
        elif host and packet.kind == PacketType.CANCEL:
            if answer := host.transactions.cancel(packet):
                host.command.put_instead(answer)
                self._send(host.command)
        elif packet.kind == PacketType.PONG:
            pass
        elif host and host.event and connection is host.command:
            connection.put(host.transactions.take(packet))
        else:
            raise MalformedPacketError

    def _introduce(self, connection: Connection, packet: Packet) -> None:
        if packet.kind == PacketType.INIT_COMMAND_REQUEST:
            _check_introduction(packet)
            answer = self._welcome(connection)
        elif packet.kind == PacketType.INIT_EVENT_REQUEST:
            answer = self._add_event_connection(connection, *packet.fields("I"))
        else:
            raise MalformedPacketError
        connection.put([answer])
        if connection in self._strangers:
            connection.send()
            self._hang_up(connection)

    def _welcome(self, connection: Connection) -> bytes:
        if self._host is not None:
            return ptpip.init_fail(FailReason.BUSY)
        self._hosts_so_far += 1
        self._host = _Host(self._hosts_so_far, connection, Transactions(self._responder))
        self._strangers.remove(connection)
        return ptpip.init_command_ack(self._hosts_so_far, _GUID, self._responder.model)

    def _add_event_connection(self, connection: Connection, number: int) -> bytes:
        host = self._host
        if host is None or host.event is not None or number != host.number:
            return ptpip.init_fail(FailReason.REJECTED)
        host.event = connection
        self._strangers.remove(connection)
        return ptpip.packet(PacketType.INIT_EVENT_ACK)

    def _hang_up(self, connection: Connection) -> None:
        """Close a connection; a host that loses one loses both of them and its session."""
        connection.close()
        if connection in self._strangers:
            self._strangers.remove(connection)
        elif self._host and connection in (self._host.command, self._host.event):
            used, self._host = (self._host.command, self._host.event), None
            for used_connection in used:
                if used_connection is not None:
                    used_connection.close()
            self._responder.disconnect()


def _check_introduction(packet: Packet) -> None:
    """Check GUID, name with its closing zero, version; any version is accepted."""
    name_bytes = len(packet.payload) - _GUID_BYTES - 4
    if not 2 <= name_bytes <= _MAX_NAME_BYTES or name_bytes % 2:
        raise MalformedPacketError
