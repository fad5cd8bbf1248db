"""A protocol for labrig: what is done, what is analysed, and the result."""

from labrig.foundation.plugins import Measurement

MY_PROTOCOL = Measurement(
    package=__name__,
    protocol=".protocol:MyProtocol",
    result=".result:MyProtocolResult",
    report=None,
)
