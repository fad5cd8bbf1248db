from .camera import (
    CHANNELS as CHANNELS,
    CURVES_FILE as CURVES_FILE,
    CameraResponse as CameraResponse,
    ShippedCamera as ShippedCamera,
    read_camera as read_camera,
    read_checked_curves as read_checked_curves,
    read_monochrome_camera as read_monochrome_camera,
    shipped_camera as shipped_camera,
    shipped_cameras as shipped_cameras,
)
from .camera_model import (
    CameraModel as CameraModel,
    Factor as Factor,
    Flat as Flat,
    Glare as Glare,
    f_number_text as f_number_text,
    rho_squared as rho_squared,
)
from .chart import (
    CHART_PATCHES as CHART_PATCHES,
    read_colour_chart as read_colour_chart,
)
from .colorimetry import (
    CIE_1931 as CIE_1931,
    CIE_2015 as CIE_2015,
    XYZ_TO_SRGB as XYZ_TO_SRGB,
    Observer as Observer,
    delta_e as delta_e,
    illuminant as illuminant,
    lab as lab,
    observer as observer,
    srgb_bytes as srgb_bytes,
    white_xyz as white_xyz,
)
from .curve_file import (
    Curve as Curve,
    CurveFile as CurveFile,
    read_curve_file as read_curve_file,
    read_spectrum as read_spectrum,
    read_transmittance as read_transmittance,
)
from .hyperspectral import (
    HyperspectralCube as HyperspectralCube,
    read_hyperspectral_cube as read_hyperspectral_cube,
)
from .instrument_spectra import foreign_spectra as foreign_spectra
from .lights import (
    is_narrow as is_narrow,
    read_light as read_light,
)
from .lvf import (
    NOMINAL_FWHM_NM as NOMINAL_FWHM_NM,
    SLICES as SLICES,
    Bands as Bands,
    Lvf as Lvf,
    Strip as Strip,
    WavelengthMap as WavelengthMap,
    nominal_lvf as nominal_lvf,
    peak_shape as peak_shape,
    signal_through as signal_through,
)
from .oklab import from_oklab as from_oklab, oklab as oklab
from .photometry import (
    absolute_irradiance as absolute_irradiance,
    mesopic_adaptation as mesopic_adaptation,
    mesopic_ratio as mesopic_ratio,
    photopic_efficacy as photopic_efficacy,
    scotopic_efficacy as scotopic_efficacy,
)
from .piecewise import (
    band_integrals as band_integrals,
    band_means as band_means,
    edges_from_centres as edges_from_centres,
    hat_functions as hat_functions,
    quadrature as quadrature,
)
from .spectral_columns import Quantity as Quantity
from .spectrometer import (
    MeasuredSpectrum as MeasuredSpectrum,
    SpectrometerReading as SpectrometerReading,
    lamp_calibration as lamp_calibration,
    read_spectrometer_reading as read_spectrometer_reading,
)
from .spectrum import (
    Spectrum as Spectrum,
    Transmittance as Transmittance,
)
