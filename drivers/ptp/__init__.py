"""Canon EOS cameras over PTP on USB."""

from .camera import PtpCamera

__all__ = ["PtpCamera"]
