"""Registration of the measurement: what it is made of, by import strings."""

from labrig.foundation.plugins import Measurement

MY_PROTOCOL = Measurement(
    package="my_protocol",
    protocol=".protocol:MyProtocol",
    result=".result:MyProtocolResult",
    report=None,
)
