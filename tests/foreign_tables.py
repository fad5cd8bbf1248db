"""One decay as instruments, spreadsheets and scripts write it, and how it was read."""

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from labrig.foundation.errors import LabrigError
from labrig.results import TableLayout, read_described_series

#: Times in ns, and counts, that every table below holds.
T_NS = [0.4 * k for k in range(30)]
COUNTS = [round(2000 * math.exp(-0.06 * k)) + k % 3 for k in range(30)]
CHANNELS = "".join(f"{k}\t{count}\r\n" for k, count in enumerate(COUNTS))
ALONE = "".join(f"{count}\t\n" for count in COUNTS)
BESIDE = "".join(f"{count}\t{count // 2}\n" for count in COUNTS)


def rows(form: str = "{t:.2f},{n}\n", scale: float = 1.0) -> str:
    """Rows of times and counts, with times of `scale` in 1 ns."""
    return "".join(form.format(t=t * scale, n=n) for t, n in zip(T_NS, COUNTS, strict=True))


@dataclass(frozen=True)
class Export:
    """A text, and what the user has to say; what is refused has a word of the refusal."""

    name: str
    text: str
    layout: TableLayout = field(default_factory=TableLayout)
    refused: str = ""


WIDTH = TableLayout(time_per_channel="0.4 ns")
BLOCK = "*BLOCK {} ( Time[ns]  No_of_photons )\n" + rows("{t:.6f} , {n:4d}\n") + "*END\n"
PICO = (
    "#PicoHarp 300  Histogram Data\r\n#channels per curve\r\n{0}\r\n#display curve no.\r\n{1}\r\n"
    "#memory block no.\r\n{1}\r\n#ns/channel\r\n{2}\r\n#counts\r\n"
)
FLS = (
    "Labels,a{0}\nType,TCSPC Decay{0}\nStart,0.00{0}\nStop,12.00{0}\nStep,0.40{0}\n"
    "Xaxis,Time(ns){0}\nYaxis,Counts{0}\n\n"
)
LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDate\t2026/11/28\nTime\t10:00:00.0\n"
    "***End_of_Header***\t\n\t\nChannels\t1\t\nSamples\t30\t\nX_Dimension\tTime\t\n"
    "X0\t0.0E+0\t\nDelta_X\t4E-10\t\n***End_of_Header***\t\t\nX_Value\tVoltage\tComment\n"
)
JCAMP = "##TITLE=a\n##XUNITS={}\n##YUNITS=COUNTS\n##FIRSTX=0\n##DELTAX=0.4\n##XYDATA=(X++(Y..Y))\n"
PACKED = "".join(
    f"{T_NS[k]:.1f} {' '.join(map(str, COUNTS[k : k + 6]))}\n" for k in range(0, len(COUNTS), 6)
)

EXPORTS = [
    Export("Becker & Hickl SPCM", "  Title : a\n  Time : 13:26:44\n  \n" + BLOCK.format(1)),
    Export("SPCM, two blocks", BLOCK.format(1) + BLOCK.format(2), refused="--block"),
    Export("SPCM, second block", BLOCK.format(1) + BLOCK.format(2), TableLayout(block=2)),
    Export("Edinburgh FLS", FLS.format("") + rows()),
    Export("FLS, two curves", FLS.format(",") + rows("{t:.2f},{n},1\n"), refused="--column"),
    Export("HORIBA DAS6", "Chan\tData\r\nTime calibration = 4.0E-10 sec/ch\r\n\r\n" + CHANNELS),
    Export("DAS6, µs", "Chan\tData\nTime calibration = 4.0E-4 \u03bcs/ch\n" + CHANNELS),
    Export("PicoHarp, one curve", PICO.format(30, 0, "0.4000\t") + ALONE),
    Export("PicoHarp, decimal comma", PICO.format(30, 0, "0,4000") + ALONE),
    Export(
        "PicoHarp, two curves",
        PICO.format("30\t30", "0\t1", "0.4\t0.4") + BESIDE,
        TableLayout(column="1"),
    ),
    Export(
        "PicoHarp, which curve",
        PICO.format("30\t30", "0\t1", "0.4\t0.4") + BESIDE,
        refused="--column",
    ),
    Export("channels, ns per channel", "0.4 ns per channel\nChannel,Counts\n"
           + CHANNELS.replace("\t", ",")),
    Export("channels, resolution", "Resolution: 400 ps\nBin;Counts\n"
           + CHANNELS.replace("\t", ";")),
    Export("channels, no width", "Channel\tCounts\n" + CHANNELS, refused="--time-per-channel"),
    Export("channels, width said", "Channel\tCounts\n" + CHANNELS, WIDTH),
    Export("counts alone", "Counts\n" + ALONE, refused="--time-per-channel"),
    Export("counts alone, width said", "Counts\n" + ALONE, WIDTH),
    Export("number of rows above", f"{len(COUNTS)}\n" + ALONE, WIDTH),
    Export("two widths", "0.4 ns/ch\n0.5 ns/ch\nChan\tI\n" + CHANNELS, refused="0.5 ns/ch"),
    Export("PicoQuant FluoFit", "Time [ns]\tDecay [Cnts]\tIRF [Cnts]\n"
           + rows("{t:.2f}\t{n}\t0\n"), TableLayout(column="Decay [Cnts]")),
    Export("Origin", "Time\tIntensity\nns\tcounts\n\tsample A\n" + rows("{t:.2f}\t{n}\n")),
    Export("HORIBA FluorEssence", "T\tS1c\nns\tCPS\n" + rows("{t:.2f}\t{n}\n")),
    Export("LabVIEW", LVM + rows("{t:.3e}\t{n}\n", 1e-9)),
    Export("oscilloscope", "Horizontal Units,s\nHorizontal Scale,4e-08\n\nTIME,CH1\n"
           + rows("{t:.3e},{n}\n", 1e-9)),
    Export("JCAMP-DX", JCAMP.format("NANOSECONDS") + PACKED + "##END=\n"),
    Export("JCAMP-DX, compressed", JCAMP.format("NANOSECONDS") + "0A12J3k\n", refused="AFFN"),
    Export("drawn", "| t / ns | I |\n|---|---|\n" + rows("| {t:.2f} | {n} |\n")),
    Export("unit after a comma", '"Time, ns";"I"\n' + rows("{t:.2f};{n}\n").replace(".", ",")),
    Export("unit as the name", "ns\tI\n" + rows("{t:.2f}\t{n}\n")),
    Export("names in quotation marks", '"Time (ns)" "I"\n' + rows("{t:.2f} {n}\n")),
    Export("names otherwise separated", "Time[ns] Counts\n" + rows()),
    Export("unit of the axis", "Time unit: ns\nt;I\n" + rows("{t:.2f};{n}\n")),
    Export("units in brackets below", "time,I\n(ns),(V)\n" + rows()),
    Export("trailing separators", "t/ns;I;;\n" + rows("{t:.2f};{n};;\n")),
    Export("parameters below", "t (ns),I\n" + rows()
           + "\nParameter List :\nInstrument , Cary\nStart (nm) , 900.0\nStop (nm) , 200.0\n"),
    Export("its end", "t (ns),I\n" + rows() + "EOD\n"),
    Export("range in the header", "Time range: 12 ns\nt,I\n" + rows(), refused="--time-unit ns"),
    Export("resolution in the header", "Resolution: 400 ps\nt,I\n" + rows(), refused="ns"),
    Export("contradiction", "X-axis: time [us]\nt (ns),I\n" + rows(), refused="--time-unit"),
    Export("unit in words", "# all times in nanoseconds\nt,I\n" + rows()),
    Export("unit of a column in words", "# column 1: time (ns)\n# column 2: I\n" + rows()),
    Export("unit below the rows", "t,I\n" + rows() + "\nTime unit: ns\n"),
    Export("unit after a dash", "Time - ns,I\n" + rows()),
    Export("width in the name", "Channel (0.4 ns/ch)\tI\n" + CHANNELS),
    Export("unknown unit", "Time (fortnights),I\n" + rows(), refused="fortnights"),
    Export("a note between rows", "t (ns),I\n" + rows() + "lamp off\n" + rows(), refused="--block"),
    Export("values first, no names", rows("{n},{t:.2f}\n"), refused="names"),
    Export("power of ten as unit", "Time (10^-9 s),I\n" + rows()),
    Export("power of ten, signs", "t / ×10⁻⁹ s;I\n" + rows("{t:.2f};{n}\n")),
    Export("lifetime", "Lifetime (ns)\tI\n" + rows("{t:.2f}\t{n}\n")),
    Export("oscilloscope, XINCR", "XINCR;4.0E-10\nXUNIT;s\nNR_PT;30\n" + ALONE),
    Export("sample rate", "Sampling rate (MHz): 2500\nSample\tI\n" + CHANNELS),
    Export("units above the names", "ns,V\nTime,I\n" + rows()),
    Export("names in a comment of MATLAB", "% Time (ns)  I\n" + rows("{t:.2f} {n}\n")),
    Export("Russian", "Время (нс);I\n" + rows("{t:.2f};{n}\n").replace(".", ",")),
    Export("ms since 1970", "Time,I\n"
           + "".join(f"{1764288000000 + 30 * k},{n}\n" for k, n in enumerate(COUNTS)),
           refused="--time-unit ms"),
    Export("hours, minutes, seconds in digits", "Time,I\n"
           + "".join(f"{10000 + 100 * (k // 2) + 30 * (k % 2)},{n}\n"
                     for k, n in enumerate(COUNTS)),
           refused="hh:mm:ss"),
    Export("an exposure in the header", "Integration Time (msec): 8\nt,I\n"
           + rows("{t:.3e},{n}\n", 1e-9)),
]  # fmt: skip


def verdict(path: Path, export: Export) -> tuple[str, str]:
    """`right`, `refused` or `wrong`, and what labrig says."""
    try:
        series, columns = read_described_series(path, export.layout)
    except LabrigError as error:
        return "refused", str(error).removeprefix(f"{path}: ")
    (one,) = series
    right = (
        one.values[:, 0].tolist() == COUNTS
        and np.allclose(one.t_s, np.multiply(T_NS, 1e-9), rtol=1e-9, atol=1e-20)
        and not np.isfinite(one.sigma[:, 0]).any()
    )
    return ("right" if right and len(one.channels) == 1 else "wrong"), columns


Choose = Callable[[Sequence[str]], str]
_ABOVE = (
    "", "Sample: A\n", "Operator{0}X\n\nGain{0}5\n", "# made\n# by me\n", "[Header]\nver=1.2\n",
    "Date{0}28.11.2026\nTime{0}10:00:00\nName{0}5{0}7\n\n", "Laser pulse 5 ns\n>>>>>Begin<<<<<\n",
)  # fmt: skip
_BELOW = (
    "", "*END\n", "EOD\n", "\n", "# end\n", "\nFit:\nk{0}0.02\n", ">>>>>End<<<<<\n",
    "{0}{0}\n\x1a", "\nChi squared = 1.02\n[Gain (dB)] {0} 4\n",
)  # fmt: skip
_NAMES = (
    "Time (ns)", "t / ns", "Zeit [ns]", "time_ns", "Time, ns", "Time", "time in ns", "\u00b5s",
    "us",
)  # fmt: skip
_ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252")


def mutated(choose: Choose) -> bytes:
    """The decay in a way of writing it that is drawn."""
    separator = choose(["\t", ";", ",", " ", " , ", "; "])
    comma = choose([".", ","])
    name = choose(_NAMES)
    unit = "ns" if name == "Time" else ""
    scale = 1e-3 if name in ("\u00b5s", "us") else 1.0
    if name == "\u00b5s":
        name = choose(["t (\u00b5s)", "Time [\u00b5s]", "t/\u00b5s"])
    elif name == "us":
        name = choose(["t (us)", "time_us", "us"])
    is_first, tail = choose(["yes", "yes", "no"]), choose(["", "", separator.strip(" ")])
    names = [f'"{name}"' if separator.strip() and separator.strip() in name else name, "I"]
    if not separator.strip():
        names[0] = names[0].replace(", ", "_").replace(" in ", "/")
    lines = [names] + ([[unit, "V"]] if unit else [])
    for t, n in zip(T_NS, COUNTS, strict=True):
        lines.append([f"{t * scale:.6g}".replace(".", comma), f"{n}"])
    ordered = lines if is_first == "yes" else [line[::-1] for line in lines]
    mark = separator.strip() or " "
    text = choose(_ABOVE).format(mark)
    text += "".join(separator.join(line) + tail + "\n" for line in ordered)
    text += choose(_BELOW).format(mark)
    text = text.replace("\n", choose(["\n", "\r\n", "\r"]))
    return text.encode(choose(_ENCODINGS))


def drawn(seed: int) -> bytes:
    """A table of that seed."""
    return mutated(random.Random(seed).choice)
