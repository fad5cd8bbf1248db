"""Areas of the validation: the campaigns of each page of `docs/validation`."""

from itertools import chain

from tests.acceptance.manual_examples import EXAMPLES

#: Campaigns by area, the name of the page; the pages stand in this order in the manual.
AREAS: dict[str, tuple[str, ...]] = {
    "decays": (
        *("coverage_pipeline", "coverage_pipeline_other_scenarios", "coverage_decay_fit"),
        *("beating_flicker", "tables_that_drift", "tables_of_wrong_sigma"),
        *("decay_states_that_hide", "law_confusion", "law_minima", "interval_coverage_decay"),
        *("decay_fit_example", "decays_of_all_materials", "veiling_glare"),
        *("predicted_sigmas", "predicted_sigmas_one_state", "rate_information"),
        *("reference_data", "least_squares_starts", "benchmarks"),
    ),
    "phosphors": (
        *("whole_phosphor", "reused_calibration", "samples_in_turn", "excitation_rates"),
        *("excitation_light", "selected_lights", "leds_by_camera", "layer_range"),
        *("trap_models", "unequal_filling", "interval_coverage_charge"),
        *("interval_coverage_excitation", "interval_coverage_excitation_faint"),
        "sao_charge_and_decay",
    ),
    "bench": (
        *("fade_pulls", "lvf_in_the_room", "sensor_noise", "gphoto2_latency"),
        *(f"manual_{page}" for page in EXAMPLES),
    ),
    "spectra": (
        *("spectrum_through_lvf", "spectrum_lines", "emission_spectra", "camera_filters"),
        *("camera_curves", "reflectance_pulls", "lightlogger"),
    ),
    "luminance": (
        *("luminance_pulls", "luminance_times", "luminance_times_further"),
        *("luminance_times_real", "luminance_budget"),
    ),
    "fluorescence": (
        *("led_entries", "led_matrices", "led_matrices_library_others"),
        *("led_matrices_library_own", "led_matrices_library_wrong", "led_bench_calibrated"),
        *("led_bench", "led_bench_lamps", "tile_noise"),
    ),
    "mixtures": (
        *("mixture_colours_integral", "mixture_colours_colour"),
        *("mixture_colours_integral_skewed", "mixture_colours_colour_skewed"),
    ),
    "rendering": (
        *("dark_room", "prediction_beside_photographs", "fluorescent_room"),
        *("wavelength_noise", "history_sampling", "euler_steps", "chart_colours"),
        *("phosphor_overhead", "design_recovery"),
    ),
    "failures": (
        *("faults_at_any_moment", "kills_in_every_protocol", "disk_failures", "devices_vanish"),
        *("lamp_off_however_it_ends", "suspended", "announced_end", "two_labrigs", "long_run"),
        "reduced_ahead",
        *("edited_journals", "hostile_files", "mutated_files", "file_grammars", "ptp_fuzz"),
        *("serial_fuzz", "real_time"),
    ),
}


def all_names() -> list[str]:
    """Return the names of the campaigns of all areas, repeated if two areas have one."""
    return list(chain.from_iterable(AREAS.values()))
