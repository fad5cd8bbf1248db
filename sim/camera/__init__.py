"""A simulated camera on a simulated USB cable, or on the loopback network.

It is a Canon EOS 5D Mark II, or one that implements nothing but the PTP standard.

`SimulatedCamera(...).backend` is given to pyusb, which then exchanges packets with it;
`PtpIpServer` serves `SimulatedCamera(...).responder` to any program on this PC.

Names are listed in `__init__.pyi`, and loaded when first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
