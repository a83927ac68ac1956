"""The documentation site: `make docs` builds it from the pages of this folder, strictly, into build/site.

The source folder is the whole repository, of which the pages below are taken: links to tables and pictures of benchmarks/
stay as they are in a checkout. Navigation is made from the folder: a page that no section names stands under 'More'.
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "site")]
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))  # of the notebooks

import lcp_lube  # noqa: E402

project, author, version = "lcp_lube", "The lcp_lube developers", lcp_lube.__version__
project_copyright = "The lcp_lube developers, BSD-3-Clause"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinxarg.ext",
    "sphinx_copybutton",
    "navigation",
    "plain_docstrings",
    "mathml",
]
root_doc = "docs/index"
include_patterns = ["docs/**", "benchmarks/README.md", "benchmarks/results/CHARTS.md", "CHANGELOG.md", "CONTRIBUTING.md"]
exclude_patterns = ["docs/site/**", "**/.ipynb_checkpoints", "docs/conf.py"]
html_theme, html_title, html_baseurl = "furo", f"lcp_lube {version}", ""
html_static_path = ["site/static"]
html_css_files = ["site.css"]
html_extra_path = ["site/extra"]  # index.html, which leads to docs/index.html
html_copy_source, html_show_sphinx = False, False
smartquotes = False  # two dashes are an option's
pygments_style, pygments_dark_style = "default", "github-dark"

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 4
# Notebooks are run anew in every build that finds them changed, or the package's version; an error in one ends the build.
nb_execution_mode = "cache"
nb_execution_in_temp = True  # what they write stays out of the sources
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True
# stderr in a notebook would be a warning nobody has seen to.
nb_output_stderr = "show"
suppress_warnings = ["myst.header"]  # pages for GitHub may begin below the first level

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
napoleon_numpy_docstring, napoleon_google_docstring = True, False
napoleon_use_param = napoleon_use_rtype = False
linkcheck_timeout, linkcheck_retries = 15, 2
linkcheck_anchors = False
