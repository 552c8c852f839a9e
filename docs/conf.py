"""Sphinx builds the site: `make docs`. Nothing is fetched while it is built or read."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import workbench

HERE = Path(__file__).parent
BUILT = HERE / "_build"
sys.path.insert(0, str(HERE / "_tools"))

project = "workbench"
author = "The workbench developers"
copyright = author
version = release = workbench.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinxcontrib.bibtex",
    "myst_nb",
    "docstrings",
    "outputs",
    "gallery",
    "api_pages",
    "coming_from",
]
exclude_patterns = ["_build", "_tools", "reference/examples"]
root_doc = "index"

# --- Markdown and its code ----------------------------------------------------------------------

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
myst_links_external_new_tab = False
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb", ".rst": "restructuredtext"}

nb_execution_mode = "cache"
nb_execution_cache_path = str(BUILT / "cells")
nb_execution_in_temp = True  # what a page writes stays out of the sources
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_excludepatterns = ["course/*"]  # their outputs are kept in the repository
nb_merge_streams = True
# Pages find what an earlier build computed; the kernel keeps to the threads that tests use.
os.environ["WORKBENCH_RESULTS"] = str(BUILT / "results")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# --- docstrings ---------------------------------------------------------------------------------

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True, "show-inheritance": False}
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
default_role = "py:obj"
suppress_warnings = ["ref.python"]  # a bare name of an attribute may be that of several classes
python_use_unqualified_type_names = True

bibtex_bibfiles = ["../workbench/cli/guidance/references.bib"]
bibtex_reference_style = "author_year"
bibtex_default_style = "plain"

# --- pages --------------------------------------------------------------------------------------

MATHJAX = Path(importlib.util.find_spec("sphinx-mathjax-offline").origin).parent
html_static_path = ["_static", str(MATHJAX / "static" / "mathjax" / "tex-svg-full.js")]
mathjax_path = "tex-svg-full.js"

html_theme = "pydata_sphinx_theme"
html_title = f"workbench {release}"
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {"text": "workbench"},
    "navbar_align": "left",
    "navbar_persistent": ["search-button"],
    "header_links_before_dropdown": 8,
    "show_nav_level": 2,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
copybutton_exclude = ".linenos, .gp, .go"
