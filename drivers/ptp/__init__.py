"""Cameras over PTP, on USB or in the network (PTP/IP): Canon EOS, and cameras on standard PTP."""

from .camera import PtpCamera

__all__ = ["PtpCamera"]
