"""What a page of a mixture says of its run."""

from labrig.record import RunDescription

ABOUT = RunDescription(
    title="paper", protocol="mixture", run="paper.csv", started="", ended="", rig="",
    simulated=False, labrig_version="0",
)  # fmt: skip
