"""PTP over USB: the still image device class, through pyusb."""
