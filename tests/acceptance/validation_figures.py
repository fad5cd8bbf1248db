"""Figures that say how good labrig is: rows of the table of validation."""

from dataclasses import dataclass

from tests.acceptance import figure_extracts as figure
from tests.acceptance.printed import Extract, match


@dataclass(frozen=True)
class Figure:
    """A row of the table.

    Attributes
    ----------
    what
        Truth, conditions, sample size.
    extract
        Function that finds the figure in the campaign's output.
    """

    what: str
    campaign: str
    extract: Extract


FIGURES = (
    Figure(
        "Simulated dark room, from lamp to fit: samples of one and of two states, sensor of "
        "96 × 64 pixels, flicker of 0.7 %, 100 seeds. Fraction of the rates k_r within 1 σ and 2 σ "
        "of the truth (68 % and 95 % if σ is right; chance alone makes ± 5 % and ± 2 %), and mean "
        "error",
        "coverage_pipeline",
        figure.coverage("baseline"),
    ),
    Figure(
        "The same runs: fits that choose a wrong number of states",
        "coverage_pipeline",
        figure.wrong_states,
    ),
    Figure(
        "The same runs: scatter of the rates over the Cramér-Rao bound of the true noise",
        "coverage_pipeline",
        figure.efficiency,
    ),
    Figure(
        "The same with lamp drift of 3 %/h, crosstalk of 3 % and row noise of 0.3 read noise in "
        "addition, two decays, 100 seeds",
        "coverage_pipeline",
        figure.coverage("all of it"),
    ),
    Figure(
        "The same, reduced with another laboratory's camera curves, 60 seeds (chance alone makes "
        "± 6 % and ± 3 %)",
        "coverage_pipeline_other_scenarios",
        figure.coverage("another laboratory's curves"),
    ),
    Figure(
        "The same with lamp drift of 3 %/h, two decays, 60 seeds",
        "coverage_pipeline_other_scenarios",
        figure.coverage("lamp drifts"),
    ),
    Figure(
        "The same with flicker of 2 %, 60 seeds",
        "coverage_pipeline_other_scenarios",
        figure.coverage("flicker 2 %"),
    ),
    Figure(
        "The same without flicker, 60 seeds",
        "coverage_pipeline_other_scenarios",
        figure.coverage("steady light"),
    ),
    Figure(
        "A sample whose glow falls by a power law, 60 seeds: fits that say so",
        "coverage_pipeline_other_scenarios",
        lambda printed: match(r"flagged as such (\d+ of \d+)", printed),
    ),
    Figure(
        "Decay fit by itself, one to three states, flicker and dark level known or not, flicker "
        "that the fit does not allow for among them, 100 seeds in each case: fraction of the rates",
        "coverage_decay_fit",
        figure.decay_fit,
    ),
    Figure(
        "Decays of one and two states whose light flickers by a sine of 0.7 % with a period of "
        "5.1, 4.9 or 2.55 s, frames every 5 s, 100 seeds each: fraction with a rate wrong by more "
        "than 3 σ",
        "beating_flicker",
        figure.beating,
    ),
    Figure(
        "Decay fit by itself, power laws of three shapes, 100 seeds each: fraction of the fits "
        "that say so",
        "coverage_decay_fit",
        figure.power_laws,
    ),
    Figure(
        "Law of decay that the default protocol's fit takes, of two exponentials with rates 2.5, 5 "
        "and 20 apart, of general order 1.5, 2 and 3, and of one trap with retrapping of 0.1 and "
        "0.5 (general order counts as right), signal-to-noise ratio about 250, 100 seeds each; and "
        "of Table 1 and of the shipped double exponentials, which are of first order",
        "law_confusion",
        figure.laws,
    ),
    *(
        Figure(
            f"Intervals by profile likelihood of {what}, 400 seeds each: fraction of the "
            "measurements in which the intervals of 68 and 95 % hold the truth, least and greatest "
            "of all parameters (chance alone makes ± 2.3 % and ± 1.1 %)",
            f"interval_coverage_{kind}",
            figure.intervals,
        )
        for kind, what in {
            "decay": "rates, orders and laws' parameters of decays at low signal, also where the "
            "noise is Student's t, or flicker is not told, or the truth is at a bound",
            "charge": "orders and rates of charge and decay, also near the bound of the order",
            "excitation": "rates and orders of excitations of order 1.5 and 1",
            "excitation_faint": "rates and orders of an excitation by a tenth of the light",
        }.items()
    ),
    Figure(
        "Decays of Becquerel's law, p 1.08 to 1.6, τ 30 s to 100 s, first reading 20 s to 300 s "
        "after lamp off, σ 1 %, background free, 96 tables: fits of that law that end more than 9 "
        "above the lowest χ² of another search",
        "law_minima",
        figure.becquerel_minima,
    ),
    Figure(
        "Decays of all laws, p 0.4 to 6, noise 0.03 % to 10 %, one channel or three, backgrounds "
        "held and free, 300 seeds: fits of laws that end more than 0.001 above the lowest χ² of "
        "another search; and that fit worse, by more than 0.001, than a law that they contain",
        "law_minima",
        figure.law_minima,
    ),
    Figure(
        "Least-squares fit on the nonlinear reference sets of NIST, all 22 sets from both starts: "
        "digits in agreement with the certified parameters, of 11 certified",
        "reference_data",
        figure.certified,
    ),
    Figure(
        "Mercury lines of a real germicidal lamp: rms of four wavelengths about a straight line",
        "reference_data",
        lambda printed: match(r"^visible +\d+ +([\d.]+)$", printed) + " nm",
    ),
    Figure(
        "Scatter of fitted rates over the σ that `labrig plan --predict` states, materials of two "
        "states, 8 protocols, 32 runs each (chance alone makes ± 0.13)",
        "predicted_sigmas",
        figure.predicted,
    ),
    Figure(
        "Same runs: probability that both states are resolved, where prediction and runs differ "
        "most",
        "predicted_sigmas",
        figure.told,
    ),
    Figure(
        "Scatter over predicted σ for a material of one state, 6 protocols, 32 runs each",
        "predicted_sigmas_one_state",
        figure.predicted,
    ),
    Figure(
        "Excitation rates k_e ≥ 0.002 /s of Table 1's eight paints, charged by a numerical "
        "integration and a filament that cools, one seed",
        "excitation_rates",
        figure.excitation,
    ),
    Figure(
        "The same for a material of two states, 40 seeds: rms of error over σ (1 if σ is right)",
        "excitation_rates",
        figure.excitation_sigma,
    ),
    Figure(
        "A whole phosphor, all calibrations made in the run itself, Table 1's eight paints, "
        "one seed each",
        "whole_phosphor",
        figure.phosphor,
    ),
    Figure(
        "Same runs: rms of error over σ (1 if σ is right)",
        "whole_phosphor",
        figure.phosphor_sigma,
    ),
    Figure(
        "A phosphor measured with a calibration of the bench made once for all eight paints",
        "reused_calibration",
        figure.phosphor,
    ),
    Figure(
        "Same runs: rms of error over σ (1 if σ is right)",
        "reused_calibration",
        figure.phosphor_sigma,
    ),
    Figure(
        "Same runs: ΔE2000 of photographs of the glow from its measured spectrum and decay",
        "reused_calibration",
        figure.glow_colours,
    ),
    Figure(
        "Albedo from 430 nm to 680 nm of samples with edges, bands and fluorescence, with camera, "
        "filter and card drawn from the σ of their files, four runs each",
        "reflectance_pulls",
        figure.albedo,
    ),
    Figure(
        "Eight phosphors of a sample changer measured in turn in one run, with one calibration",
        "samples_in_turn",
        figure.phosphor,
    ),
    Figure(
        "Same run: rms of error over σ (1 if σ is right)",
        "samples_in_turn",
        figure.phosphor_sigma,
    ),
    Figure(
        "Same bench, frames of a 21-megapixel camera: what each further sample takes",
        "reused_calibration",
        figure.each_sample,
    ),
    Figure(
        "Linear variable filter calibrated in the simulated room with real colour filters, three "
        "cameras: central wavelengths and widths of the pass bands from 420 nm to 680 nm",
        "lvf_in_the_room",
        figure.variable_filter,
    ),
    Figure(
        "Same runs: rms of error over σ at all positions (1 if σ is right)",
        "lvf_in_the_room",
        figure.variable_filter_sigma,
    ),
    Figure(
        "Same runs: relative irradiance behind the filter, summed over all bands, from 420 nm to "
        "680 nm: largest error",
        "lvf_in_the_room",
        figure.irradiance,
    ),
    Figure(
        "Fade and rise of 100 halogen lamps, no two alike, by two passes of the protocol `fade`: "
        "rms of error over σ at five times after the switch in three bands (1 if σ is right)",
        "fade_pulls",
        figure.lamps,
    ),
    Figure(
        "ColorChecker under a halogen lamp through a variable filter, another laboratory's curves "
        "of the camera, their uncertainty and a picture of a grey card taken into account as "
        "`emission_spectrum` does by default: ΔE2000 of the 24 patches",
        "spectrum_through_lvf",
        figure.colours("another's, grey card"),
    ),
    Figure(
        "The same without the picture of the grey card (`white: false`)",
        "spectrum_through_lvf",
        figure.colours("another's, no card"),
    ),
    Figure(
        "The same with the other laboratory's curves taken for exact",
        "spectrum_through_lvf",
        figure.colours("another's, taken for exact"),
    ),
    Figure(
        "The same with the camera's true curves",
        "spectrum_through_lvf",
        figure.colours("same curves"),
    ),
    Figure(
        "Emission of 40 fluorophores through a variable filter, camera's true curves: fraction of "
        "the bands above 2 % of the peak within their credible bands of 68 % and 95 %",
        "spectrum_through_lvf",
        figure.spectrum_bands("fluorophores", "same curves"),
    ),
    Figure(
        "The same with another laboratory's curves and the picture of a grey card",
        "spectrum_through_lvf",
        figure.spectrum_bands("fluorophores", "another's, grey card"),
    ),
    Figure(
        "The same without the picture of the grey card",
        "spectrum_through_lvf",
        figure.spectrum_bands("fluorophores", "another's, no card"),
    ),
    Figure(
        "The same for 40 mercury lamps, whose lines are narrower than the filter's pass band, "
        "camera's true curves",
        "spectrum_through_lvf",
        figure.spectrum_bands("mercury lines", "same curves"),
    ),
    Figure(
        "Broad spectra through the variable filter, one or two bands of 30 to 120 nm: errors of "
        "the means over 10 nm above 2 % of the peak and of the mean over 50 nm about the peak, and "
        "how many are said to have lines",
        "spectrum_lines",
        figure.lines("broad"),
    ),
    Figure("The same of a line 5 nm wide", "spectrum_lines", figure.lines("line 5")),
    Figure("The same of a line 15 nm wide", "spectrum_lines", figure.lines("line 15")),
    Figure(
        "The same of a line 5 nm wide on a broad band",
        "spectrum_lines",
        figure.lines("line 5 on a band"),
    ),
    Figure(
        "The same of two lines 5 nm wide, 20 nm apart", "spectrum_lines", figure.lines("two 5 20")
    ),
    Figure("The same of eight lines like those of Tb³⁺", "spectrum_lines", figure.lines("Tb")),
    Figure("The same of ten lines like those of Eu³⁺", "spectrum_lines", figure.lines("Eu")),
    Figure("The same of a mercury lamp", "spectrum_lines", figure.lines("mercury")),
    Figure(
        "Emission spectra of five paints in the simulated room, camera curves as far off as "
        "laboratories disagree, with a picture of a grey card, three seeds each: largest error, "
        "and fraction of the bands above 2 % of the peak",
        "emission_spectra",
        figure.emission,
    ),
    Figure(
        "Every shipped material in the simulated room, sensor of 384 × 256 pixels, by itself and "
        "Table 1's eleven in one charge, one seed",
        "decays_of_all_materials",
        figure.decays,
    ),
    Figure(
        "Real narrow-band lights from 400 nm to 700 nm, seen by a real sensor of 18 channels, "
        "every third held out in turn, four intensities: error of the wavelength",
        "lightlogger",
        figure.narrow_lights,
    ),
    Figure("The same, every second held out", "lightlogger", figure.narrow_lights_halved),
    Figure(
        "Every third held out: rms of error over σ (1 if σ is right)",
        "lightlogger",
        lambda printed: match(r"rms of error over σ ([\d.]+)$", printed),
    ),
    Figure(
        "Charge and decay of a real SrAl2O4:Eu,Dy, two states: rms of misfit over glow in the "
        "charge until 60 s, in the charge until 300 s, in the decay until 60 s, later",
        "sao_charge_and_decay",
        figure.real_charge,
    ),
    Figure(
        "The same by `labrig fit charge`, two states of general order: χ² per reading in the "
        "charge, in the decay",
        "sao_charge_and_decay",
        figure.real_charge_of_general_order,
    ),
    Figure(
        "Luminances of an afterglow at 10 and 60 min and its time until 0.3 mcd/m², measured with "
        "camera, grey card and a luxmeter of 3 %, over five laws of traps, 50 runs: rms of error "
        "over σ, at the median relative σ",
        "luminance_pulls",
        figure.luminance_pulls,
    ),
    Figure(
        "Time until 0.3 mcd/m² forecast with 95 % by records that end at 0.1, 0.3, 0.5 and 0.9 of "
        "it, six families of decays, two of which no fitted law contains, 100 decays each: ranges "
        "that hold the true time",
        "luminance_times",
        figure.luminance_times,
    ),
    Figure(
        "The same of four further families, 40 decays each",
        "luminance_times_further",
        figure.luminance_times,
    ),
    Figure(
        "The same of real decays (a strontium aluminate, two quartzes, semiconductors; the rates "
        "of two of the last grow with time, as those of no sum of exponentials do)",
        "luminance_times_real",
        figure.luminance_times,
    ),
    Figure(
        "Excitation rates k_e ≥ 0.002 /s of six paints with the light as it is stated, and with "
        "places, wavelengths or the lamp further off than anybody says, 60 runs each",
        "excitation_light",
        figure.light_errors,
    ),
    Figure(
        "Excitation rates k_e ≥ 0.002 /s of layers that are fitted as surfaces: 60 of optical "
        "density 1, 60 drawn from 0 to 2 with five courses of absorption, and 20 thin ones whose "
        "reflectance was measured: within 2 σ of the fit, and within the range of thickness",
        "layer_range",
        figure.layer_range,
    ),
    Figure(
        "Charging by the white lamp and decay predicted from an excitation of traps of first and "
        "general order, with retrapping, and with depths that scatter, the order chosen by the "
        "data: within 2 % or 3 σ (good; doubted: and warned), worse and warned (told), not warned "
        "(WRONG)",
        "trap_models",
        figure.trap_models("auto"),
    ),
    Figure(
        "The same with the first order held",
        "trap_models",
        figure.trap_models("1"),
    ),
    Figure(
        "Faults of 15 kinds at random moments of a run, signals and kill -9 in addition; "
        "interrupted runs are resumed. 450 trials",
        "faults_at_any_moment",
        figure.wrong,
    ),
    Figure(
        "kill -9 at random moments of six of the shipped protocols and of the making of their "
        "results; resumed until complete, compared with an undisturbed run",
        "kills_in_every_protocol",
        figure.kills,
    ),
    Figure(
        "An I/O error or a loss of power at every third write, fsync, close, rename … of a run and "
        "of the making of its result, a disk that is full after a random number of bytes, or for "
        "reading alone from then on; the run is resumed",
        "disk_failures",
        figure.disk,
    ),
    Figure(
        "Damaged YAML, CSV and journal files, 10 000 of them: refused with one line, or read",
        "mutated_files",
        figure.refused,
    ),
    Figure(
        "Matrices in BFC and ARK files, camera curves and linear OpenEXR pictures by grammars of "
        "which some rules are broken, 100 000 of each: refused with one line, or read",
        "file_grammars",
        figure.went_wrong,
    ),
    Figure(
        "A camera or a board that vanishes in every fortieth of the units of all protocols, and "
        "comes back: lamp off, one line, and the run is resumed to its end",
        "devices_vanish",
        figure.went_wrong,
    ),
    Figure(
        "A decay of 24 hours with a frame every 30 s: growth of memory, open files and threads "
        "from the second hour on (a picture that stays of each frame would be 1.5 MB an hour)",
        "long_run",
        figure.growth,
    ),
    Figure(
        "Edited journals: every field of every kind of line, and lines removed, doubled, moved; as "
        "they are, chained anew, and without the seal. Edits that were refused or named",
        "edited_journals",
        figure.edited_beside_a_seal,
    ),
    Figure(
        "The same by a forger who removes seal and result, too: what RAW files and documents tell",
        "edited_journals",
        figure.edited_without_a_seal,
    ),
    Figure(
        "Rigs, protocols, tables, matrices, meshes, pictures, frames, scenes and run folders made "
        "to do harm, 83 of them, each with every thirtieth command that takes a path: something "
        "written outside, a program started, somebody called, 1 GiB or 10 s taken, more lines",
        "hostile_files",
        figure.went_wrong,
    ),
    Figure(
        "Damaged PTP containers over USB, 10 000 each way: no hang, no traceback",
        "ptp_fuzz",
        figure.containers,
    ),
    Figure(
        "Answers of boards that come to harm on their serial line, nine drivers, 10 000 cases "
        "each: an action that hangs, no clear error, a light that is on and is called off",
        "serial_fuzz",
        figure.went_wrong,
    ),
    Figure(
        "labrig with a served camera in real time, stopped for a minute in turns in the charge and "
        "in the decay: the guard ends it where the lamp burns, and it goes on where none does",
        "real_time",
        figure.went_wrong,
    ),
    Figure(
        "Two labrigs on one relay board, by its path, a link, a relative path, two slashes, "
        "another TMPDIR; half of the 40 trials with the first at work, half at once",
        "two_labrigs",
        figure.wrong,
    ),
    Figure(
        "The PC sleeps for 1 s to 8 h at a random moment of a run (real process, the kernel's "
        "clock shimmed), 20 trials: reported, the unit done again",
        "suspended",
        figure.wrong,
    ),
    Figure(
        "Runs of seven protocols and of a chain, cut off at 200 random moments as by `kill -9` and "
        "resumed: the end that is announced at once against the true one, with choices as planned",
        "announced_end",
        figure.announced_end,
    ),
    Figure(
        "Lamp off after a signal or a closed terminal, 10 trials each",
        "lamp_off_however_it_ends",
        figure.off_after(r"(?!SIGSTOP|SIGSEGV)SIG[^ ]+|closed terminal|Ctrl-Z"),
    ),
    Figure(
        "Lamp off after kill -9, SIGSEGV, or where memory runs out, 10 trials each",
        "lamp_off_however_it_ends",
        figure.off_after(r"kill -9|SIGSEGV|out of memory"),
    ),
    Figure(
        "Lamp off after SIGSTOP, 10 trials", "lamp_off_however_it_ends", figure.off_after("SIGSTOP")
    ),
    Figure(
        "The same where the board answers 60 ms late or has come back under another name",
        "lamp_off_however_it_ends",
        figure.off_after(r"board (?:60 ms late|renamed), .*?"),
    ),
    Figure(
        "The same where the board is silent for 20 s",
        "lamp_off_however_it_ends",
        figure.off_after(r"board silent for 20 s, SIGTERM"),
    ),
    Figure(
        "Delay from the command to the full press of the shutter release, simulated Canon, "
        "20 frames each: labrig's own driver and libgphoto2",
        "gphoto2_latency",
        figure.latency,
    ),
    Figure(
        "Curves of each of the 52 shipped cameras by a ColorChecker and the other cameras: root "
        "mean square error from 400 to 700 nm, relative to each channel's peak",
        "camera_curves",
        figure.camera_curves("52 shipped, chart"),
    ),
    Figure(
        "The same of 32 cameras that two other laboratories measured (rms 1 if σ is right)",
        "camera_curves",
        figure.camera_curves("32 of others, chart"),
    ),
    Figure(
        "The shipped materials of one or two states, found by the solver of `labrig design` from "
        "their own glow with noise of 1 %, 5 seeds",
        "design_recovery",
        figure.recovered_designs,
    ),
    Figure(
        "Glow behind a turning blade, 1 to 1000 s, by steps of a frame: error against the rate "
        "equation in 100,000 steps",
        "history_sampling",
        figure.moving_light,
    ),
    Figure(
        "Levels from 0 to 1 by 25 exact steps a second, four materials, steady and swinging light",
        "euler_steps",
        figure.steps,
    ),
    Figure(
        "ColorChecker in 20-nm bands, mean reflectances of 30 charts, against their published "
        "colours, which are under D50 and adapted to the screen: ΔE2000, mean and largest of 24 "
        "patches",
        "chart_colours",
        figure.chart,
    ),
    Figure(
        "Glow rendered from the files of simulated runs, 10 samples and rooms, beside photographs: "
        "ΔE2000 with the run's material, and with one state; glow over reflected light",
        "dark_room",
        figure.dark_rooms,
    ),
    Figure(
        "Figure 10 of Nalbach, Seidel and Ritschel, a prediction beside photographs: the material "
        "of one run rendered beside the photographs of another, on a bench without a door. Glow "
        "over reflected light at the first and the last photograph, and mean ΔE2000",
        "prediction_beside_photographs",
        figure.predicted_room,
    ),
    Figure(
        "Figure 1 of Nalbach, Seidel and Ritschel, who state 454 ms with and 448 ms without "
        "phosphorescence on a graphics card of 2013: a picture of 640 × 480 pixels on two cores, "
        "and of a cloth that moves, with fewer paths",
        "phosphor_overhead",
        figure.overheads,
    ),
    Figure(
        "A decay of 58 frames of 21 megapixels, one each 3 s, on two cores: time from the last one "
        "to the result with a process that reduces frames as they come, and without; how late a "
        "frame begins and how long it takes to be kept, at 99 %",
        "reduced_ahead",
        figure.results_after,
    ),
    Figure(
        "Camera calibration of made-up sensors of 120 × 160 pixels that lose −5 to 5 % at white, "
        "true gain 4 e/DN, 100 seeds each: gain, rms of its errors over σ, and gain by a straight "
        "line",
        "sensor_noise",
        figure.gains,
    ),
    Figure(
        "The same sensors, read noise 0.05 to 3 DN, black in the middle, at the edge and anywhere "
        "in a step of the numbers, 20 seeds each: rms of its errors over σ where a value is "
        "stated, and limits that are true",
        "sensor_noise",
        figure.read_noises,
    ),
    Figure(
        "Fluorescent samples rendered under 4 lamps, beside photographs: shipped and measured "
        "papers and textiles, with the matrices of the room and as measured under LEDs",
        "fluorescent_room",
        figure.fluorescent_rooms,
    ),
    Figure(
        "Light in closed rooms with fluorescent papers: time of paths of 1 to 8 wavelengths over "
        "that of a fold in 24 bands, for equal noise",
        "wavelength_noise",
        figure.single_wavelengths,
    ),
    Figure(
        "Decay of two states, 60 frames in three channels: start, fit, alternative models, "
        "diagnosis",
        "benchmarks",
        figure.times(
            "2 states, 60 frames x 3 channels: all of it",
            "lmfit leastsq, best of 15 starts",
            "lmfit leastsq, one good start",
        ),
    ),
    Figure(
        "A frame of 25 MB and its journal line, durable",
        "benchmarks",
        figure.times(
            "25 MB frame and its journal line, durable", "write and fsync of the same bytes"
        ),
    ),
    Figure(
        "Excitation, 31 sites: residuals and Jacobian",
        "benchmarks",
        figure.times(
            "excitation, 31 sites, 3 charges: residuals and Jacobian",
            "solve_ivp in the loop, finite differences",
        ),
    ),
)
