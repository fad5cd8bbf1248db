"""A blank."""

from labrig.calibration import (
    BlankFile,
)

BLANK = BlankFile(
    iso=400,
    f_number=4.0,
    channels=("R", "G"),
    t_s=(0.5, 1.5),
    rate_dn_per_s=((10.0, 20.0), (0.0, 2.0)),
    sigma_dn_per_s=((1.0, 1.0), (1.0, 1.0)),
    constant_dn_per_s=(0.5, 0.25),
    constant_dn_per_s_sigma=(0.25, 0.25),
    ambient_dn_per_s=(0.0, 0.0),
    ambient_dn_per_s_sigma=(0.1, 0.1),
    first_clean_s=2.0,
)
