"""PTP over the network: PTP/IP (CIPA DC-005), on two TCP connections."""
