"""Device drivers: one file or package a device family, each speaking the real wire protocol."""

if __name__ != "labrig.drivers":
    raise ImportError("this package is labrig.drivers; import it by that name")

from .serial_line import SerialLine

__all__ = ["SerialLine"]
