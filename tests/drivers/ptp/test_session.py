"""Transactions of one PTP session, over a link that answers as a test says."""

from collections import deque

import pytest

from labrig.drivers.ptp import session as ptp
from labrig.drivers.ptp.codes import OK, Standard
from labrig.drivers.ptp.containers import Container, Kind
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError


class Answering:
    """A link on which each request is answered with OK, after what else is there to be read."""

    def __init__(self) -> None:
        self.sent: list[Container] = []
        self.cancelled: list[int] = []
        self.left: deque[Container] = deque()

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        self.sent.append(request)
        self.left.append(Container(Kind.RESPONSE, OK, request.transaction_id))

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        if not self.left:
            raise DeviceError("no answer")
        return self.left.popleft()

    def event(self, timeout_s: float) -> Container | None:
        return None

    def cancel(self, transaction_id: int) -> None:
        self.cancelled.append(transaction_id)

    def reset(self) -> None:
        self.left.clear()

    def close(self) -> None:
        pass


@pytest.fixture
def link() -> Answering:
    return Answering()


@pytest.fixture
def session(link: Answering) -> ptp.Session:
    opened = ptp.Session(link, VirtualClock())
    opened.open()
    return opened


def test_answers_of_earlier_transactions_are_passed_over(
    session: ptp.Session, link: Answering
) -> None:
    link.left += [
        Container(Kind.DATA, Standard.GetDeviceInfo, 77, b"old"),
        Container(Kind.RESPONSE, 0x2002, 77),
        Container(Kind.EVENT, 0x4002, 1),
        Container(Kind.DATA, Standard.GetDeviceInfo, 1, b"new"),
    ]
    assert session.transact(Standard.GetDeviceInfo).data == b"new"


def test_a_transaction_that_was_broken_off_is_cancelled_before_the_next(
    session: ptp.Session, link: Answering
) -> None:
    link.left.append(Container(Kind.DATA, Standard.GetStorageIDs, 1, b""))
    with pytest.raises(DeviceError, match="expected data or a response"):
        session.transact(Standard.GetDeviceInfo)
    assert link.cancelled == []
    link.reset()
    session.transact(Standard.GetDeviceInfo)
    assert link.cancelled == [1]


def test_transactions_are_counted_from_one_and_again_after_the_last(
    session: ptp.Session, link: Answering, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ptp, "LAST_TRANSACTION_ID", 3)
    for _ in range(5):
        session.transact(Standard.GetDeviceInfo)
    assert [request.transaction_id for request in link.sent] == [0, 1, 2, 3, 1, 2]
