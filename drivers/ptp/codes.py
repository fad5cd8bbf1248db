"""Codes of the PTP standard (PIMA 15740:2000, clauses 10 to 13), as far as used or explained."""

from enum import IntEnum

OK = 0x2001
OPERATION_NOT_SUPPORTED = 0x2005
INVALID_OBJECT_HANDLE = 0x2009
PROPERTY_NOT_SUPPORTED = 0x200A
ACCESS_DENIED = 0x200F
DEVICE_BUSY = 0x2019
SESSION_ALREADY_OPEN = 0x201E

_RESPONSES = {
    0x2000: "Undefined",
    OK: "OK",
    0x2002: "GeneralError",
    0x2003: "SessionNotOpen",
    0x2004: "InvalidTransactionID",
    OPERATION_NOT_SUPPORTED: "OperationNotSupported",
    0x2006: "ParameterNotSupported",
    0x2007: "IncompleteTransfer",
    0x2008: "InvalidStorageID",
    INVALID_OBJECT_HANDLE: "InvalidObjectHandle",
    PROPERTY_NOT_SUPPORTED: "DevicePropNotSupported",
    0x200B: "InvalidObjectFormatCode",
    0x200C: "StoreFull",
    0x200D: "ObjectWriteProtected",
    0x200E: "StoreReadOnly",
    ACCESS_DENIED: "AccessDenied",
    0x2010: "NoThumbnailPresent",
    0x2011: "SelfTestFailed",
    0x2012: "PartialDeletion",
    0x2013: "StoreNotAvailable",
    0x2014: "SpecificationByFormatUnsupported",
    0x2015: "NoValidObjectInfo",
    0x2016: "InvalidCodeFormat",
    0x2017: "UnknownVendorCode",
    0x2018: "CaptureAlreadyTerminated",
    DEVICE_BUSY: "DeviceBusy",
    0x201A: "InvalidParentObject",
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
    OPERATION_NOT_SUPPORTED: "set its USB mode to PC remote, or use another camera",
    DEVICE_BUSY: "wait until its card lamp is off, leave its menus, and try again",
    0x200C: "there is no room for the frame: make room on its card",
    0x200D: "take its card's write protection off",
    0x200E: "take its card's write protection off",
    ACCESS_DENIED: "close whatever else is talking to the camera",
    0x2013: "put a card into the camera",
}


class Standard(IntEnum):
    """Codes of standard operations."""

    GetDeviceInfo = 0x1001
    OpenSession = 0x1002
    CloseSession = 0x1003
    GetStorageIDs = 0x1004
    GetObjectInfo = 0x1008
    GetObject = 0x1009
    DeleteObject = 0x100B
    InitiateCapture = 0x100E
    GetDevicePropDesc = 0x1014
    GetDevicePropValue = 0x1015
    SetDevicePropValue = 0x1016
    GetPartialObject = 0x101B


class StandardProperty(IntEnum):
    """Codes of standard properties, with the words that messages use."""

    f_number = 0x5007
    focus_mode = 0x500A
    flash_mode = 0x500C
    exposure_time = 0x500D
    exposure_program = 0x500E
    exposure_index = 0x500F
    capture_delay = 0x5012
    still_capture_mode = 0x5013
    burst_number = 0x5018

    def __str__(self) -> str:
        return f"{self.name.replace('_', ' ')} (0x{self.value:04X})"


class StandardEvent(IntEnum):
    """Codes of standard events."""

    ObjectAdded = 0x4002
    StoreFull = 0x400A
    CaptureComplete = 0x400D


def response_text(code: int) -> str:
    """Return a response code as a person can look it up: `0x2019 DeviceBusy`."""
    return f"0x{code:04X} {_RESPONSES.get(code, 'not a code of the standard')}"


def advice(code: int) -> str:
    """Return the remedy when the camera answers `code`."""
    return _ADVICE.get(code, "switch the camera off and on, its dial at M, and start again")


def operation_text(operation: IntEnum) -> str:
    """Return an operation as a person can look it up: `GetDeviceInfo 0x1001`."""
    return f"{operation.name} 0x{operation:04X}"
