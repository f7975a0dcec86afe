"""Configuration of Sphinx for the site; docs/site/build.py starts it."""

from pathlib import Path

from sarcl.base.version import __version__

HERE = Path(__file__).parent

project = "sarcl"
author = "the authors of sarcl"
copyright = "the authors of sarcl, Apache-2.0"
version = release = __version__
extensions = ["myst_parser"]
root_doc = "index"
exclude_patterns: list[str] = []
nitpicky = True  # of names between backticks; types of parameters are often those of other packages
nitpick_ignore_regex = [("py:class|py:data|py:exc", ".*")]

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4  # links to headings, as forges make them

add_module_names = False
toc_object_entries_show_parents = "hide"
highlight_language = "text"
smartquotes = False  # quotes of words of options are those of the code

html_theme = "furo"
html_title = f"sarcl {release}"
html_static_path = [str(HERE / "static")]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
