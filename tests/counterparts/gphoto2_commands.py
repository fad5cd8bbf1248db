"""Commands for the host that runs gphoto2."""

import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("gphoto2_host.py")

MAX_S = 60.0

TO_HOST, TO_CARD = "set:capturetarget=Internal RAM", "set:capturetarget=Memory card"

READY = ("set:iso=400", "set:aperture=4", "set:shutterspeed=1/4")

#: A camera that knows the standard only tells seconds and the word of its property.
STANDARD_READY = ("set:iso=400", "set:f-number=f/4", "set:shutterspeed=0.2500s")


def command(port: int, *steps: str) -> list[str]:
    return [sys.executable, str(SCRIPT), str(port), *steps]
