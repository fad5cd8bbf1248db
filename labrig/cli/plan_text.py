"""Text of a plan: a summary, then its units, those alike folded into one line."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from shutil import get_terminal_size
from typing import TYPE_CHECKING

from labrig.acquire import CAMERA, Plan, Step, shutter_text
from labrig.cli.screen import laid_out
from labrig.cli.wording import counted, measurement
from labrig.consent import calls, has_consent, starting
from labrig.foundation.quantity import duration_text
from labrig.record import PERSON, size_text

if TYPE_CHECKING:
    from labrig.bench import Recording


#: Waits that are shorter in all are left out, in seconds.
SHORT_S = 60.0
#: Column at which units begin, and width of a page where there is no terminal.
INDENT, WIDTH = 26, 120
#: Number of steps by hand that are written out for units that are folded.
WRITTEN_OUT = 3


@dataclass(frozen=True)
class _PlannedUnit:
    """One unit of a plan with its steps."""

    name: str
    begins_s: float
    ends_s: float
    steps: Sequence[Step]

    @property
    def part(self) -> str:
        """Part of a chain to which the unit belongs; empty if there is no chain."""
        return self.name.rpartition("/")[0]

    @property
    def kind_of_part(self) -> str:
        """Name of the part without that of its sample."""
        return self.part.rpartition("/")[2]

    @property
    def own_name(self) -> str:
        """Name of the unit within its part."""
        return self.name.rpartition("/")[2]

    @property
    def kind(self) -> tuple[str, str, tuple[tuple[str, int], ...]]:
        """Key that is the same for units of which one is a repeat of the other."""
        roles = [_role(step) for step in self.steps if step.device == CAMERA.key]
        counts = tuple((role, roles.count(role)) for role in dict.fromkeys(roles))
        return self.part, self.own_name.partition("-")[0], counts


def summary(recording: "Recording", free_bytes: int) -> list[str]:
    """Return lab time, steps by hand, frames and disk space of a plan, in lines."""
    plan, rig, size = recording.plan, recording.rig, recording.plan.size()
    by_hand = len(plan.manual_steps)
    hand_text = counted(by_hand, "step") if by_hand else "nothing"
    if by_hand and "changer" in rig.devices:
        hand_text += "; with --yes the rig's changer does them"
    measured = measurement(recording.protocol.protocol, recording.protocol.sample.name)
    pixels = plan.capabilities.frame_pixels
    frame_text = "" if pixels is None else f" of {pixels[0]} × {pixels[1]} pixels"
    return [
        f"{measured}, on {rig.name}",
        f"  lab time  at most {duration_text(plan.duration_s)}, {counted(len(plan.units), 'unit')}",
        f"  by hand   {hand_text}",
        f"  frames    at most {plan.frames}{frame_text}",
        *(f"            {line}" for line in recording.protocol.frame_spacing(plan.capabilities)),
        f"  disk      about {size_text(size.total_bytes)}, {size_text(free_bytes)} are free",
        f"            frames {size_text(size.frames_bytes)} "
        f"({size_text(plan.capabilities.frame_bytes)} each), "
        f"results {size_text(size.results_bytes)}",
        *(_deed("network", sentence, "") for sentence in calls(rig.addresses())),
        *_at_end(rig.on_finish),
    ]


def _at_end(on_finish: str | Sequence[str] | None) -> list[str]:
    if on_finish is None or isinstance(on_finish, str):
        return []
    return [_deed("at end", starting(on_finish), "--on-finish or ")]


def _deed(when: str, sentence: str, other_way: str) -> str:
    """Return a line about what is done by consent alone."""
    consent = "" if has_consent(sentence) else f", only with {other_way}'labrig rig use FILE'"
    return f"  {when:8}  {sentence}{consent}"


def folded_units(plan: Plan) -> Iterator[str]:
    """Yield the units of a plan in lines, those alike that follow each other in one.

    Lines are as long as the terminal is wide, 120 characters if there is none.
    """
    width = get_terminal_size((WIDTH, 24)).columns
    for line in _unit_lines(plan):
        yield from laid_out(line, width, min(INDENT + 2, width // 2))


def _unit_lines(plan: Plan) -> Iterator[str]:
    yield f"  {'begins':>9}  {'lasts':>11}  unit"
    part = ""
    for _, alike in groupby(_rounds(_units(plan)), key=lambda unit: unit.kind):
        units = list(alike)
        if units[0].part != part:
            part = units[0].part
            yield part
        lasts_s = units[-1].ends_s - units[0].begins_s
        details = [", ".join(_contents(units)), _by_hand(units), *_warnings(units)]
        first, *others = [detail for detail in details if detail] or [""]
        yield (
            f"  {_clock_text(units[0].begins_s):>9}  {duration_text(lasts_s):>11}  "
            f"{_names(units)}{': ' if first else ''}{first}"
        )
        yield from (f"{'':{INDENT}}{line}" for line in others)


def _units(plan: Plan) -> Iterator[_PlannedUnit]:
    steps = {
        unit: list(unit_steps) for unit, unit_steps in groupby(plan.steps, lambda step: step.unit)
    }
    begins_s = 0.0
    for name, ends_s in zip(plan.units, plan.unit_ends_s, strict=True):
        yield _PlannedUnit(name, begins_s, ends_s, steps.get(name, ()))
        begins_s = ends_s


def _rounds(units: Iterator[_PlannedUnit]) -> Iterator[_PlannedUnit]:
    """Yield units with those as one that samples have in turn: one unit of each sample."""
    for _, in_turn in groupby(units, key=lambda unit: (unit.kind_of_part, unit.own_name)):
        first, *others = in_turn
        if not others:
            yield first
            continue
        samples = [unit.part.rpartition("/")[0] for unit in (first, *others)]
        part = f"{first.kind_of_part} of {', '.join(samples)} in turn"
        steps = [step for unit in (first, *others) for step in unit.steps]
        yield _PlannedUnit(f"{part}/{first.own_name}", first.begins_s, others[-1].ends_s, steps)


def _names(units: Sequence[_PlannedUnit]) -> str:
    if len(units) == 1:
        return units[0].own_name
    return f"{len(units)} × {units[0].own_name} … {units[-1].own_name}"


def _contents(units: Sequence[_PlannedUnit]) -> Iterator[str]:
    """Yield the long waits of units, then their frames by role."""
    waits_s: dict[str, float] = {}
    exposures_s: dict[str, list[float]] = {}
    for step in (step for unit in units for step in unit.steps):
        if step.lasts_s is not None:
            why = step.action.removesuffix(f", {duration_text(step.lasts_s)}")
            waits_s[why] = waits_s.get(why, 0.0) + step.lasts_s
        elif step.exposure_s is not None:
            exposures_s.setdefault(_role(step), []).append(step.exposure_s)
    yield from (f"{why} {duration_text(s)}" for why, s in waits_s.items() if s >= SHORT_S)
    for role, times_s in exposures_s.items():
        plural = "s" if len(times_s) > 1 else ""
        yield f"{len(times_s)} {role}{plural} of {_exposures_text(times_s)}"


def _exposures_text(times_s: Sequence[float]) -> str:
    shortest, longest = shutter_text(min(times_s)), shutter_text(max(times_s))
    return shortest if shortest == longest else f"{shortest} to {longest}"


def _by_hand(units: Sequence[_PlannedUnit]) -> str:
    steps = [step.action for unit in units for step in unit.steps if step.device == PERSON]
    if len(steps) > WRITTEN_OUT + 1:
        steps = [*steps[:WRITTEN_OUT], f"{len(steps) - WRITTEN_OUT} more, the last: {steps[-1]}"]
    return f"by hand: {'; '.join(steps)}" if steps else ""


def _warnings(units: Sequence[_PlannedUnit]) -> Iterator[str]:
    texts = [
        step.action
        for unit in units
        for step in unit.steps
        if step.device == "-" and step.lasts_s is None
    ]
    yield from dict.fromkeys(texts)


def _role(step: Step) -> str:
    """Return the role of a photograph's frame, such as `decay frame`."""
    return step.action.partition(", ")[0]


def _clock_text(seconds: float) -> str:
    minutes, second = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{second:02}"
