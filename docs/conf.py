"""Settings with which Sphinx builds the manual: `sphinx-build -W docs OUT`, as `.ci/run` does."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "labrig"
author = "the labrig authors"
copyright = "the labrig authors; BSD-3-Clause"
version = release = version_of("labrig")

extensions = [
    "mathml",
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "stale_figures",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build"]
nitpicky = False

myst_enable_extensions = ["amsmath", "attrs_block", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
smartquotes = False

autodoc_typehints = "none"
autodoc_default_options = {"exclude-members": "model_config"}
default_role = "code"
autosummary_generate = True
numpydoc_show_class_members = False

html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["labrig.css"]
html_logo = html_favicon = "static/logo.svg"
# Pages without further pages below them have no navigation of a section.
html_sidebars: dict[str, list[str]] = {
    page: [] for page in ("tutorial", "glossary", "contributing")
}
html_theme = "pydata_sphinx_theme"
html_title = "labrig"
html_show_sourcelink = False
html_theme_options = {
    "navigation_with_keys": False,
    "logo": {"text": "labrig", "alt_text": "labrig"},
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": True,
    "pygments_light_style": "default",
}
