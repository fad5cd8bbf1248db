"""Limits of detection and of evidence: each significance that decides, with its reason."""

#: Signal over its σ from which light counts as detected: by chance in one of 3.5 million readings.
DETECTION_SIGMA = 5.0
#: The same where the noise is known and a decay is asked for that a person knows to be there: of
#: its amplitudes or its first frame.
DECAY_DETECTION_SIGMA = 3.0
#: The same of the mean of neighbouring pixels of a spectrometer: one in 10⁵ pixels by chance.
PIXEL_DETECTION_SIGMA = 4.5
#: Brightness of a lit pixel in units of the noise of the dark surroundings; a frame has millions.
LIT_PIXEL_SIGMA = 6.0
#: Significance of an excitation rate below which an upper limit is reported, and of a state's
#: amplitude below which the state is not counted: 95 %.
RATE_LIMIT_SIGMA = 2.0
#: Signal over its σ from which a value determines a scale or a ratio by itself, within 5 %.
PRECISE_SIGMA = 20.0
#: Difference of BIC from which a model with more parameters, or another law, is preferred: odds of
#: e³ = 20 : 1.
STRONG_EVIDENCE_DELTA_BIC = 6.0
