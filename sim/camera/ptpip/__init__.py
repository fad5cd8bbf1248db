"""The simulated camera on the loopback network: PTP/IP."""
