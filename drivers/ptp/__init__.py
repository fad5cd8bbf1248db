"""Canon EOS cameras over PTP, on USB or in the network (PTP/IP)."""

from .camera import PtpCamera

__all__ = ["PtpCamera"]
