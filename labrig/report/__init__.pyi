from .charge import (
    charge_report as charge_report,
)
from .chart import Chart as Chart
from .colours import (
    camera_to_xyz as camera_to_xyz,
    css_colour as css_colour,
    into_gamut as into_gamut,
)
from .columns_figure import columns_pictures as columns_pictures
from .curve_sketch import (
    describe_curves as describe_curves,
    describe_shipped_curves as describe_shipped_curves,
    draw_curves as draw_curves,
)
from .decay_figures import (
    exposure_middles_s as exposure_middles_s,
)
from .described import sections_of as sections_of
from .design import (
    describe_design as describe_design,
    describe_energy as describe_energy,
    describe_factor as describe_factor,
    describe_nearest as describe_nearest,
    describe_scene_design as describe_scene_design,
    describe_spread as describe_spread,
    draw_design as draw_design,
    draw_scene_design as draw_scene_design,
)
from .figure_files import (
    require_picture as require_picture,
    save_picture as save_picture,
    write_figures_pdf as write_figures_pdf,
)
from .figure_style import (
    DASHED as DASHED,
    EDGE_PT as EDGE_PT,
    FONT_PT as FONT_PT,
    INK as INK,
    MUTED as MUTED,
    SMALL_PT as SMALL_PT,
    WIDTH_PT as WIDTH_PT,
    figure_style as figure_style,
    legend_above as legend_above,
    line_entry as line_entry,
    new_figure as new_figure,
    place as place,
)
from .led_study import (
    ComparedLeds as ComparedLeds,
    describe_leds as describe_leds,
    led_study_report as led_study_report,
)
from .material_tables import (
    comparison_table as comparison_table,
    describe_phosphor as describe_phosphor,
    surface_lines as surface_lines,
)
from .mixture import (
    FittedMatrix as FittedMatrix,
    describe_mixture as describe_mixture,
    difference_lines as difference_lines,
)
from .mixture_page import mixture_report as mixture_report
from .notebook_page import (
    NotebookPage as NotebookPage,
    notebook_html as notebook_html,
)
from .page import (
    Report as Report,
    section_page as section_page,
    with_later as with_later,
    write_report as write_report,
)
from .phosphor_picture import draw_phosphor as draw_phosphor
from .photographs import (
    sample_picture as sample_picture,
)
from .renderers import (
    render as render,
)
from .reradiation import (
    describe_reradiation as describe_reradiation,
    draw_reradiation as draw_reradiation,
    reradiation_text as reradiation_text,
)
from .run_sections import (
    calibration_sections as calibration_sections,
    lamp_sections as lamp_sections,
    temperature_sections as temperature_sections,
)
from .sections import (
    Picture as Picture,
    Rendered as Rendered,
    Section as Section,
    Source as Source,
    Table as Table,
)
from .shared_decay import (
    shared_decay_report as shared_decay_report,
)
from .sheets import (
    draw_contact_sheet as draw_contact_sheet,
    draw_frames as draw_frames,
)
from .sweep import (
    SweptPoint as SweptPoint,
    sweep_chart as sweep_chart,
)
from .trap_depth import (
    trap_depth_chart as trap_depth_chart,
    trap_depth_report as trap_depth_report,
)
