"""Mistakes of a first day with files, keys, units, names and runs."""

from tests.acceptance.mistake import DECAY, SIM_RIG, TWO_COLUMNS, Mistake, protocol_mistake

MATERIAL = """\
name: mine
kind: phosphor
bands_nm: [400.0, 550.0, 700.0]
irradiance_norm: {kind: vector_length, value: 1.0}
states:
  - {k_r_per_s: 0.03, k_e_per_s: [0.02, 0.01], reradiation: [1.0, 2.0]}
"""
PAGE = "<!DOCTYPE html>\n<html><head><title>decay</title></head><body>0.03</body></html>\n"
ARDUINO = """\
name: mine
devices:
  lamp:
    {driver: serial_relay, address: sim://room/arduino, on: {send: "on 0"}, off: {send: "off 0"}}
  camera: {driver: ptp_camera, address: sim://room/camera, shutter_lag: 60 ms}
simulation: {sample: blue-paint}
"""
DOOR = "  door: {driver: maestro, address: sim://room/servo, channel: 0, %s, travel: 1 s}\n"
SERVO_RIG = SIM_RIG.replace("optics:", f"{DOOR}optics:")


def rig_plan(name: str, text: str, needs: str, exit_code: int = 2) -> Mistake:
    """Return the mistake of planning a decay on this rig."""
    return Mistake(name, "plan decay --rig rig.yaml", needs, exit_code, {"rig.yaml": text})


WRONG_KINDS = (
    Mistake("a page for a table", "fit decay report.html", "page|report", 2, {"report.html": PAGE}),
    Mistake("a run for a table", "fit decay runs/mine", "series.csv|run folder", has_run=True),
    Mistake("a frame for a table", "fit decay frame.dng", "frame|RAW|table", has_run=True),
    Mistake("a run for a scene", "render runs/mine", "scene", has_run=True),
    Mistake("a material for a scene", "render m.yaml", "scene", 2, {"m.yaml": MATERIAL}),
    Mistake(
        "a rig for a protocol", "plan rig.yaml --rig sim", "rig.*--rig", 2, {"rig.yaml": SIM_RIG}
    ),
    Mistake(
        "a protocol for a rig", "run decay --rig mine.yaml", "protocol", 2, {"mine.yaml": DECAY}
    ),
    Mistake("a material for a protocol", "plan m.yaml --rig sim", "material", 2,
            {"m.yaml": MATERIAL}),
    Mistake("a protocol for a material", "material show p.yaml", "protocol", 2, {"p.yaml": DECAY}),
    Mistake("a protocol for a run", "process p.yaml", "protocol|run folder", 2, {"p.yaml": DECAY}),
    Mistake("a result for a run", "process runs/mine/result", "runs/mine", has_run=True),
    Mistake("a table for a frame", "frame table.csv", "RAW", 2, {"table.csv": TWO_COLUMNS}),
    Mistake("a decay for a matrix", "fit mixture table.csv", "matrix|wavelength", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("a phosphor for a mixture", "fit mixture blue-paint", "phosphor"),
    Mistake("a decay for LEDs", "leds study table.csv", "matrix|wavelength", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("a decay for curves", "optics show table.csv", "wavelength_nm", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("a protocol for wishes", "design --constraints p.yaml --out m.yaml", "protocol", 2,
            {"p.yaml": DECAY}),
    Mistake("a material without its matrix", "material show f.yaml", "f.csv|matrix", 2,
            {"f.yaml": "name: f\nkind: fluorescent\nmatrix: f.csv\n"}),
    Mistake("text for a matrix", "material show paper.BFC", "BFC", 2,
            {"paper.BFC": "Dear diary\n"}),
    Mistake("a folder for a material", "material show .", "folder"),
    Mistake("a binary file for a protocol", "plan mine.yaml --rig sim", "text|UTF-8|YAML", 2,
            {"mine.yaml": "\x00\x01PK\x03\x04"}),
)  # fmt: skip

YAML = (
    protocol_mistake("a colon forgotten", DECAY.replace("charge: 5", "charge 5"), "line 3"),
    protocol_mistake("a space after a colon forgotten", DECAY.replace("charge: 5", "charge:5"),
                     "line 3"),
    protocol_mistake("a quote left open", DECAY + 'notes: "mine\n', "line 5|quot"),
    protocol_mistake("a bracket left open", DECAY + "patches: {a: [0.1, 0.1, 0.2, 0.2}\n",
                     "line 5"),
    protocol_mistake("a key twice", DECAY + "charge: 10 min\n", "charge.*(twice|again)"),
    protocol_mistake("indented too far", DECAY + "  every: 5 s\n", "line [45]|indent"),
    protocol_mistake("an empty file", "", "protocol new"),
    protocol_mistake("only comments", "# mine\n", "protocol new"),
    protocol_mistake("no protocol named", DECAY.replace("protocol: decay\n", ""), "protocol"),
    protocol_mistake("a protocol that is not there", DECAY.replace("decay", "decays"), "decay"),
    protocol_mistake("two documents", DECAY + "---\n" + DECAY, "document|---"),
    protocol_mistake("a list for a protocol", "- decay\n- sample\n", "protocol: NAME|mapping|key"),
    protocol_mistake("a key of another protocol", DECAY + "lights: [450 nm]\n", "lights"),
    protocol_mistake("a decimal comma", DECAY + "first: 0,5 s\n", r"0\.5|decimal"),
    protocol_mistake("a word for a number", DECAY + "states: two\n", "1, 2, 3|auto"),
    protocol_mistake("a word for a truth value", DECAY + "daylight: maybe\n", "true|false"),
    protocol_mistake("three numbers of a region", DECAY + "patches: {a: [0.1, 0.1, 0.2]}\n",
                     "width, height|4"),
    protocol_mistake("a region without a size", DECAY + "patches: {a: [0.1, 0.1, 0, 0.2]}\n",
                     "width|size|above 0|greater"),
    protocol_mistake("a region with mixed units", DECAY + "patches: {a: [100, 0.1, 50, 0.2]}\n",
                     "pixels.*fractions|fractions.*pixels"),
    protocol_mistake("two patches in one place",
                     DECAY + "patches: {a: [0.1, 0.1, 0.2, 0.2], b: [0.1, 0.1, 0.2, 0.2]}\n",
                     "a.*b|overlap", 0),
)  # fmt: skip

UNITS = (
    protocol_mistake("a charge without a unit", DECAY.replace("5 min", "300"), "300 min"),
    protocol_mistake("a unit misspelt", DECAY.replace("5 min", "5 mins"), "min"),
    protocol_mistake("a wrong unit", DECAY.replace("5 min", "5 K"), "s, min|duration|time"),
    protocol_mistake("an exposure as a fraction", DECAY + "exposure: 1/30\n", "s"),
    protocol_mistake("f before the aperture", DECAY + "camera: {f_number: f/4}\n", "4"),
    protocol_mistake("an ISO in words", DECAY + "camera: {iso: high}\n", "100|number"),
    rig_plan("a pulse without a unit", SERVO_RIG % "open: 1000, closed: 2000", "000 us"),
    rig_plan("a pulse of a second", SERVO_RIG % "open: 1 s, closed: 2 s", "us"),
    rig_plan("an LED without nm",
             ARDUINO.replace("  camera:", "  leds: {driver: serial_relay, address: sim://room/"
                             "arduino, channels: {blue: {on: {send: a}, off: {send: b}, centre: "
                             "blue}}}\n  camera:"), "450|nm|number"),
    rig_plan("a delay in words", SIM_RIG.replace("60 ms", "short"), "60 ms|ms"),
    rig_plan("a temperature in Fahrenheit", SIM_RIG.replace("sample: blue-paint",
             "sample: blue-paint, temperature: 70 F"), "°C|degrees|number|temperature"),
    Mistake("a wavelength without nm", "material show yellow-textile --light 450", "450nm|450 nm"),
    Mistake("a table's time unit misspelt", "fit decay table.csv --time-unit fortnight", "min", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("a time without a unit", "fit decay table.csv --at ten", "5 h", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("flicker in words", "fit decay table.csv --flicker some", "%", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("a luminance without a unit", "fit luminance table.csv", "mcd/m", 0,
            {"table.csv": TWO_COLUMNS}),
    Mistake("a size of a picture in words", "render cornell-box --size large", "640x480"),
    Mistake("times of pictures in words", "render cornell-box --times soon", "0,1,80|number"),
    Mistake("an unknown white", "render cornell-box --white warm", "D65"),
)  # fmt: skip

NAMES = (
    Mistake("a camera without curves", "optics show canon_eos_5d_mark_9", "canon_eos_5d_mark"),
    Mistake("curves that are not there", "plan decay --rig rig.yaml", "canon_eos_5d_mark_ii", 2,
            {"rig.yaml": SIM_RIG.replace("mark_ii", "mark_2")}),
    Mistake("a material that is not there", "material show blu-paint", "blue-paint"),
    Mistake("a scene that is not there", "render cornel-box", "cornell-box"),
    Mistake("a material of no scene", "render cornell-box --material wal=blue-paint",
            "phosphorescent"),
    Mistake("a term that is not there", "explain irradience", "irradiance"),
    Mistake("a symbol misspelt", "explain k_q", "did you mean 'k_r' or 'k_e'"),
    Mistake("a term that nobody knows", "explain qqq", "in all"),
    Mistake("a kind of file that is not there", "schema bench", "rig"),
    Mistake("a protocol for a new file misspelt", "protocol new decya", "decay"),
    Mistake("a law misspelt", "fit decay table.csv --law bequerel", "becquerel", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("a column that is not there", "fit decay table.csv --column signal", "intensity", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("too many states", "fit decay table.csv --states 5", "at most 3", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("a light that is not there", "material show yellow-textile --light D56", "D65"),
)  # fmt: skip

DEVICES = (
    rig_plan("no camera", "".join(line for line in SIM_RIG.splitlines(True)
                                  if "camera: {driver" not in line), "camera"),
    rig_plan("no devices", "name: mine\n", "devices"),
    rig_plan("a device of no role", SIM_RIG.replace("  lamp:", "  lampe:"), "lamp"),
    rig_plan("an address forgotten", SIM_RIG.replace("address: sim://room/relays, ", ""),
             "address"),
    rig_plan("two lamps on one relay", SIM_RIG.replace("  camera:", "  leds: {driver: numato, "
             "address: sim://room/relays, channels: {450 nm: {relay: 0, centre: 450, fwhm: 20}}}\n"
             "  camera:"), "same channel"),
    Mistake("LEDs that the rig lacks", "plan led_fluorescence --rig sim", "leds"),
    Mistake("a spectrometer that the rig lacks", "plan direct_bispectral --rig sim",
            "spectrometer|leds"),
    Mistake("lamps that the rig lacks", "plan validate_illuminants --rig sim", "illuminants"),
    Mistake("a luminance without a meter's reading", "plan luminance --rig sim", "luminance"),
    Mistake("a rig check of no rig", "rig check mine.yaml", "mine.yaml"),
)  # fmt: skip

RUNS = (
    Mistake("a patch that the run lacks", "process runs/mine --roi smple=0,0,10,10", "sample",
            has_run=True),
    Mistake("a region outside the frame", "process runs/mine --roi sample=0,0,9000,10", "frame",
            has_run=True),
    Mistake("a frame that the run lacks", "process runs/mine --exclude 999", "999", has_run=True),
    Mistake("an optics key misspelt", "process runs/mine --optics camra=x", "camera", has_run=True),
    Mistake("an option of another protocol", "process runs/mine --order 1", "--order|order",
            has_run=True),
    Mistake("a camera that is not there", "process runs/mine --camera canon_5d", "canon_eos_5d",
            has_run=True),
    Mistake("a run misspelt", "runs show mien", "mine", has_run=True),
    Mistake("a run resumed that is complete", "resume runs/mine", "complete", 0,
            has_run=True),
    Mistake("a result that is not there", "runs restore runs/mine result-7", "result-7",
            has_run=True),
    Mistake("a run compared with itself", "runs compare runs/mine runs/mine", "twice",
            has_run=True),
    Mistake("one run for a trap's depth", "runs trap-depth runs/mine", "two temperatures", 4,
            has_run=True),
    Mistake("a decay without a spectrum rendered", "reproduce runs/mine --rendered",
            "phosphor|emis", has_run=True),
    Mistake("a seal without a key", "seal runs/mine", "key new", has_run=True),
    Mistake("a sealed run without a seal", "verify runs/mine --signers none.pub", "none.pub",
            has_run=True),
    Mistake("a note without words", "note runs/mine", "text", has_run=True),
    Mistake("a run folder for runs", "runs list --runs runs/mine", "run folder", 2, has_run=True),
    Mistake("a status that is not there", "runs list --status done", "processed", has_run=True),
    Mistake("a date in words", "runs list --since yesterday", "2026-", has_run=True),
    Mistake("charging times forgotten", "fit charge table.csv", "--on", 2,
            {"table.csv": TWO_COLUMNS}),
    Mistake("charging after the end", "fit charge table.csv --on 0 --off 900", "900|off", 2,
            {"table.csv": TWO_COLUMNS}),
)  # fmt: skip

MISTAKES = (*WRONG_KINDS, *YAML, *UNITS, *NAMES, *DEVICES, *RUNS)
