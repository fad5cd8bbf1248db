"""Simulated rooms that break one assumption each, and what is measured in them."""

import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from labrig.calibration import CAMERA_KIND
from labrig.foundation import resources
from tests.acceptance.decays_of_all_materials import shipped_rig

#: Sensor that is read in milliseconds and has four thousand pixels for each sample.
SENSOR = {"width": 192, "height": 128}
#: One state and two.
USUAL = ("blue-paint", "double-medium-bright")
#: A dim sample beside a bright one, and the regions in which they are measured.
DIM, BRIGHT = (0.04, 0.2, 0.36, 0.6), (0.44, 0.04, 0.52, 0.92)
BESIDE = {"dim": [0.1, 0.3, 0.24, 0.4], "bright": [0.52, 0.2, 0.36, 0.6]}
#: How far a long charge fills the two.
DIM_CHARGE, BRIGHT_CHARGE = 0.01, 0.5
CALIBRATED_CARD = {"card": [0.2, 0.1, 0.7, 0.8], "black": [0.02, 0.4, 0.12, 0.2]}


THERMOMETER = {"driver": "numato", "address": "sim://room/relays", "input": 0}


#: Materials that fade within seconds, of which frames are taken closer together.
FAST = ("bottle", "double-close-uneven", "green-paint", "yellow-paint")


@dataclass(frozen=True)
class Case:
    """A room with a broken assumption.

    Attributes
    ----------
    assumption
        What labrig takes for granted and the room does not keep.
    simulation
        Keys of `simulation:`, beside those of every room.
    kinetics
        Keys of `kinetics` of the sample; None: as in its file.
    materials
        Materials of the sample, one after the other from seed to seed.
    hidden
        Rate in 1/s and fraction of a state that the sample has beside those of its file.
    with_neighbour
        Whether a bright sample lies beside it, fifty times as bright.
    is_calibrated
        Whether the camera is calibrated in the same room before, its glare by a black trap.
    has_rates
        Whether the sample decays exponentially, so that its rates have a truth.
    has_scale
        Whether amplitudes have a truth: not that of a perfect camera or an even sample.
    has_thermometer
        Whether the rig reads the room's temperature.
    camera_warm_up
        Time from switching the camera on to the dark frames.
    """

    name: str
    assumption: str
    simulation: dict[str, Any] = field(default_factory=dict)
    kinetics: dict[str, Any] | None = None
    materials: tuple[str, ...] = USUAL
    hidden: tuple[float, float] | None = None
    with_neighbour: bool = False
    is_calibrated: bool = False
    has_rates: bool = True
    has_scale: bool = True
    has_thermometer: bool = False
    camera_warm_up: str = "20 min"

    @property
    def sensor(self) -> dict[str, Any]:
        """Return the keys of the sensor."""
        return {**SENSOR, **self.simulation.get("sensor", {})}

    @property
    def drift_k_per_hour(self) -> float:
        """Return by how much the room warms in an hour."""
        return float(self.simulation.get("temperature", {}).get("drift_per_hour", 0.0))

    def room_seed(self, seed: int) -> int:
        """Return the seed of the room, which is another one in every case."""
        return 1000 * (zlib.crc32(self.name.encode()) % 1_000_000) + seed

    def material(self, seed: int) -> str:
        """Return the name of the sample's material."""
        return self.materials[seed % len(self.materials)]

    def write(self, seed: int, folder: Path) -> None:
        """Write `rig.yaml`, `protocol.yaml` and a material of its own; a camera file is used."""
        material = self.material(seed)
        if self.hidden is not None:
            material = _with_hidden(material, *self.hidden, folder)
        patch: dict[str, Any] = {"material": material}
        if self.kinetics is not None:
            patch["kinetics"] = self.kinetics
        sample = [patch]
        protocol: dict[str, Any] = {"protocol": "decay", "sample": {"name": "sample"}}
        if self.material(seed) in FAST:
            protocol |= {"every": "2 s", "for": "60 s"}
        if self.with_neighbour:
            patch |= {"region": list(DIM), "initial_charge": DIM_CHARGE}
            sample.append(
                {"material": "white-paint", "region": list(BRIGHT), "initial_charge": BRIGHT_CHARGE}
            )
            protocol["patches"] = BESIDE
        rig: dict[str, Any] = shipped_rig(
            "sim",
            **(
                self.simulation
                | {"sensor": self.sensor, "sample": sample, "seed": self.room_seed(seed)}
            ),
        )
        if (camera_file := folder / CAMERA_KIND.file_name).is_file():
            rig["optics"]["camera_file"] = str(camera_file)
        rig["devices"]["camera"]["warm_up"] = self.camera_warm_up
        if self.has_thermometer:
            rig["devices"]["thermometer"] = THERMOMETER
        (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
        (folder / "protocol.yaml").write_text(yaml.safe_dump(protocol))

    def write_calibration(self, seed: int, folder: Path) -> None:
        """Write rig and protocol of the camera's calibration into a folder, with few cycles."""
        self.write(seed, folder)
        rig = yaml.safe_load((folder / "rig.yaml").read_text())
        rig["devices"]["changer"] = {"driver": "text_changer", "address": "sim://room/changer"}
        rig["simulation"]["black_trap"] = CALIBRATED_CARD["black"]
        protocol: dict[str, Any] = {
            "protocol": "camera_calibration", "sample": {"name": "camera"},
        }  # fmt: skip
        protocol |= {"isos": [100, 400], "f_numbers": [4], "cycles": 2, **CALIBRATED_CARD}
        (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
        (folder / "protocol.yaml").write_text(yaml.safe_dump(protocol))


def _with_hidden(name: str, rate_per_s: float, fraction: float, folder: Path) -> str:
    """Write a material with one state more, which gives that fraction of the light at lamp off."""
    content = yaml.safe_load((resources.folder("config/materials") / f"{name}.yaml").read_text())
    states = content["states"]
    # It is excited as much faster as it decays, so that it is filled as far as the first one is.
    light = sum(state["k_r_per_s"] * sum(state["reradiation"]) for state in states)
    model = states[0]
    scale = fraction / (1 - fraction) * light / (rate_per_s * sum(model["reradiation"]))
    faster = rate_per_s / model["k_r_per_s"]
    states.append(
        {
            "k_r_per_s": rate_per_s,
            "k_e_per_s": [faster * rate for rate in model["k_e_per_s"]],
            "reradiation": [scale * radiated for radiated in model["reradiation"]],
        }
    )
    path = folder / "hidden.yaml"
    path.write_text(yaml.safe_dump(content | {"name": f"{name} with a fast state"}))
    return str(path)


def _sensor(**keys: Any) -> dict[str, Any]:
    return {"sensor": keys}


def _law(name: str, assumption: str, **kinetics: Any) -> Case:
    materials = ("blue-paint", "orange-paint")
    return Case(name, assumption, kinetics=kinetics, materials=materials, has_rates=False)


ALWAYS_FIRST = "traps empty at one rate"

DECAYS = [
    Case("clean", "none: every assumption holds"),
    Case(
        "glare 2 %", "the lens scatters nothing", {"imaging": {"glare": 0.02}}, with_neighbour=True
    ),
    Case(
        "glare 2 %, calibrated",
        "as above, and the camera file knows",
        {"imaging": {"glare": 0.02}},
        with_neighbour=True,
        is_calibrated=True,
    ),
    Case(
        "inter-reflection 5 %",
        "surfaces do not light one another",
        {"inter_reflection": 0.05},
        with_neighbour=True,
    ),
    Case(
        "defocus 3 px",
        "a patch's light comes from the patch",
        {"imaging": {"defocus_px": 3}},
        with_neighbour=True,
    ),
    Case("texture 5 %", "surfaces are even", {"imaging": {"texture": 0.05}}, has_scale=False),
    Case(
        "black wander 1 DN",
        "the black level stays",
        _sensor(black_wander_dn=1, black_wander_over="2 min"),
    ),
    Case(
        "black wander 4 DN",
        "the black level stays",
        _sensor(black_wander_dn=4, black_wander_over="2 min"),
    ),
    Case("flicker over 5 s", "flicker has no memory", _sensor(flicker_over="5 s")),
    Case("flicker over 30 s", "flicker has no memory", _sensor(flicker_over="30 s")),
    Case("flicker over 2 min", "flicker has no memory", _sensor(flicker_over="2 min")),
    Case("flicker 3 %", "flicker is below 1 %", _sensor(flicker=0.03)),
    Case("non-linear 0.5 %", "the sensor is linear", _sensor(nonlinearity=0.005)),
    Case("non-linear 1 %", "the sensor is linear", _sensor(nonlinearity=0.01)),
    Case("non-linear 3 %", "the sensor is linear", _sensor(nonlinearity=0.03)),
    Case("crosstalk 3 %", "pixels are independent", _sensor(crosstalk=0.03), has_scale=False),
    Case("row noise 0.5", "pixels are independent", _sensor(row_noise=0.5)),
    _law("retrapping 0.1", ALWAYS_FIRST, model="otor", retrapping=0.1),
    _law("retrapping 0.5", ALWAYS_FIRST, model="otor", retrapping=0.5),
    _law("general order 1.5", ALWAYS_FIRST, model="general_order", order=1.5),
    _law("general order 2", ALWAYS_FIRST, model="general_order", order=2),
    _law("depths Gaussian 0.05 eV", ALWAYS_FIRST, model="trap_depths", width_ev=0.05),
    _law("depths Gaussian 0.02 eV", ALWAYS_FIRST, model="trap_depths", width_ev=0.02),
    _law(
        "depths exponential 0.05 eV",
        ALWAYS_FIRST,
        model="trap_depths",
        shape="exponential",
        width_ev=0.05,
    ),
    _law("glow excites glow, 20 %", "a sample does not take up its own glow", self_excitation=0.2),
    Case("power law", ALWAYS_FIRST, materials=("power-law",), has_rates=False),
    Case(
        "temperature drift 3 K/h",
        "the temperature stays",
        {"temperature": {"drift_per_hour": 3}},
    ),
    Case(
        "temperature drift 10 K/h",
        "the temperature stays",
        {"temperature": {"drift_per_hour": 10}},
    ),
    Case(
        "drift 3 K/h, thermometer",
        "as above, with a thermometer",
        {"temperature": {"drift_per_hour": 3}},
        has_thermometer=True,
    ),
    Case("hidden state 8 %, 2 s", "frames resolve every state", hidden=(0.5, 0.08)),
    Case("hidden state 15 %, 3 s", "frames resolve every state", hidden=(1 / 3, 0.15)),
    Case(
        "lamp glows on 0.01 %",
        "the lamp goes off",
        {"lamp": {"afterglow": 1e-4, "afterglow_fades": "60 s"}},
    ),
    Case(
        "lamp glows on 0.001 %",
        "the lamp goes off",
        {"lamp": {"afterglow": 1e-5, "afterglow_fades": "60 s"}},
    ),
    Case("light leak all the time", "the room is dark", {"ambient": 1e-5}),
    Case(
        "light leak from 1 h on",
        "the room is as dark as in the dark frames",
        {"faults": [{"ambient_light": {"at": "1 h", "level": 1e-5}}]},
    ),
    Case(
        "light leak during the decay",
        "the room is as dark as in the dark frames",
        {"faults": [{"ambient_light": {"at": "126.5 min", "level": 1e-5}}]},
    ),
    Case(
        "glow from before",
        "the sample is dark in the dark frames",
        {"initial": {"lamp": "off", "concentration": 0.5}},
        materials=("blue-paint", "purple-paint"),
        camera_warm_up="150 s",
    ),
]

#: For the clean runs: all shipped materials that decay exponentially, but one that lives for longer
#: than three minutes, of which labrig says so.
MATERIALS = tuple(
    name
    for name in resources.names("config/materials")
    if name not in ("power-law", "double-wide-slow")
)
CLEAN = Case("clean, all materials", "none: every assumption holds", materials=MATERIALS)
