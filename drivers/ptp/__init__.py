"""Cameras over PTP on USB: Canon EOS, and cameras on standard PTP."""

from .camera import PtpCamera

__all__ = ["PtpCamera"]
