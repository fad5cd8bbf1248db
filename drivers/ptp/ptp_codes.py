"""Codes of the PTP standard (PIMA 15740:2000, clauses 10 and 11), as far as spoken or explained."""

from enum import IntEnum

OK = 0x2001
INVALID_OBJECT_HANDLE = 0x2009
DEVICE_BUSY = 0x2019
SESSION_ALREADY_OPEN = 0x201E

_RESPONSES = {
    0x2000: "Undefined",
    OK: "OK",
    0x2002: "GeneralError",
    0x2003: "SessionNotOpen",
    0x2004: "InvalidTransactionID",
    0x2005: "OperationNotSupported",
    0x2006: "ParameterNotSupported",
    0x2007: "IncompleteTransfer",
    0x2008: "InvalidStorageID",
    INVALID_OBJECT_HANDLE: "InvalidObjectHandle",
    0x200A: "DevicePropNotSupported",
    0x200C: "StoreFull",
    0x200F: "AccessDenied",
    0x2013: "StoreNotAvailable",
    DEVICE_BUSY: "DeviceBusy",
    0x201B: "InvalidDevicePropFormat",
    0x201C: "InvalidDevicePropValue",
    0x201D: "InvalidParameter",
    SESSION_ALREADY_OPEN: "SessionAlreadyOpen",
    0x201F: "TransactionCancelled",
    0x2020: "SpecificationOfDestinationUnsupported",
    0xA102: "Canon: shutter did not release",
}

_ADVICE = {
    0x2003: "the camera was switched off and on: start again",
    0x2005: "this camera model or its mode does not know the operation",
    DEVICE_BUSY: "wait until its card lamp is off, leave its menus, and try again",
    0x200C: "there is no room for the frame",
    0x200F: "close whatever else is talking to the camera",
}


class Standard(IntEnum):
    """Standard operations."""

    GetDeviceInfo = 0x1001
    OpenSession = 0x1002
    CloseSession = 0x1003
    GetPartialObject = 0x101B


def response_text(code: int) -> str:
    """A response code as a person can look it up: `0x2019 DeviceBusy`."""
    return f"0x{code:04X} {_RESPONSES.get(code, 'not a code of the standard')}"


def advice(code: int) -> str:
    """What to do when the camera answers `code`."""
    return _ADVICE.get(code, "switch the camera off and on, its dial at M, and start again")


def operation_text(operation: IntEnum) -> str:
    """An operation as a person can look it up: `GetDeviceInfo 0x1001`."""
    return f"{operation.name} 0x{operation:04X}"
