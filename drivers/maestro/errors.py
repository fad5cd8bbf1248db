"""The Maestro's error bits in plain words. Source: Pololu's Maestro User's Guide, 4.e."""

CONTROL_CENTER = "the Maestro Control Center"

#: What each bit means and what to do, from bit 0 on.
ERRORS = (
    ("a byte came damaged", "check its wiring and baud rate, or use its USB port"),
    ("bytes came faster than it took them", "end whatever else writes to this port"),
    ("its receive buffer overflowed", "end whatever else writes to this port"),
    ("a check sum was missing or wrong", f"switch 'Enable CRC' off in {CONTROL_CENTER}"),
    (
        "it did not understand a command",
        f"check 'device_number', end whatever else writes to this port, and set the serial mode to "
        f"USB Dual Port in {CONTROL_CENTER}",
    ),
    (
        "its serial time-out, the watchdog, has run out: it had heard nothing for too long",
        f"if no plug was pulled, raise the time-out in {CONTROL_CENTER} to 3 min",
    ),
    ("its script overflowed the stack", f"correct the script in {CONTROL_CENTER}"),
    ("its script called too deeply", f"correct the script in {CONTROL_CENTER}"),
    ("its script ran past its end", f"end the script with QUIT in {CONTROL_CENTER}"),
)


def told(bits: int) -> str:
    """All errors in the 16 bits that the command A1 reads, with what to do; empty for none."""
    known = [error for bit, error in enumerate(ERRORS) if bits >> bit & 1]
    unknown = [bit for bit in range(len(ERRORS), 16) if bits >> bit & 1]
    remedies = dict.fromkeys(remedy for _, remedy in known)
    what = [what for what, _ in known] + [f"error bit {bit}, unknown to labrig" for bit in unknown]
    return ", and ".join(what) + (f" ({'; '.join(remedies)})" if remedies else "")
