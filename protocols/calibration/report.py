"""Report of a bench's calibration: the bench, then every part."""

from labrig.protocols.calibration.result import CalibrationResult
from labrig.report.renderers import render_chain
from labrig.report.sections import Rendered, Section, Source, Table

TEXT = (
    "What is found here is kept beside the runs, in the folder calibrations. Later runs on this "
    "bench find it there, and the first of their pictures is compared with that of this run."
)


def render(result: CalibrationResult, source: Source) -> Rendered:
    """Render the bench, and every part of the chain."""
    return render_chain(result.parts, source, _bench(result))


def _bench(result: CalibrationResult) -> Section:
    reference = result.reference
    temperature = reference.temperature_c
    rows = (
        ("Made", f"{reference.made:%Y-%m-%d %H:%M} UTC"),
        ("Camera", reference.camera or "unknown"),
        ("Lens", reference.lens or "unknown"),
        ("Curves of the camera", reference.curves or "none"),
        ("Lamp", reference.lamp or "none"),
        ("Grey card", reference.grey_card or "none"),
        ("Temperature", "unknown" if temperature is None else f"{temperature:.1f} °C"),
        *((f"Not found: {name}", reason) for name, reason in result.failed.items()),
    )
    return Section("The bench", (TEXT,), tables=(Table(("What", "As it was"), rows),))
