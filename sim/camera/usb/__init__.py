"""The simulated camera on a simulated USB cable, as pyusb sees it."""
