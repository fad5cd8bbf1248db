"""Parts of sentences that several commands print."""

#: Option that takes the edits of a run's files.
EDITED = "--edited"
#: Name of a sample that a protocol does not name.
_UNNAMED = "sample"


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, such as `1 unit` or `19 units`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def measurement(protocol: str, sample: str) -> str:
    """Return what is measured, such as `decay of blue-paint`; without a sample that says nothing.

    Parameters
    ----------
    protocol
        Name of the protocol.
    sample
        Name of the sample.
    """
    return protocol if sample in (_UNNAMED, protocol) else f"{protocol} of {sample}"
