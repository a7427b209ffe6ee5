"""Settings of the documentation; `make docs` builds it."""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import folders
import notebook
from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

from monochord import __version__

project = "Monochord"
author = "The Monochord developers"
copyright = author  # noqa: A001
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_build"]
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
default_role = "code"

napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_attr_annotations = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True}
add_module_names = False
suppress_warnings = [
    "autodoc",  # the loaders of presets are methods bound to a module's name, whose signature it leaves out
    "ref.python",  # a shape such as (touches, 3) names what several classes have
]
MADE_BY_SCIKIT_LEARN = {"set_fit_request", "set_score_request", "set_predict_request"}
"""Members of its estimators' subclasses, whose docstrings link to its own documentation."""

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_title = f"Monochord {release}"
html_show_sphinx = False
html_math_renderer = "mathml"

folders.write(Path(__file__).parent / "reference")
notebook.write(Path(__file__).parent / "tutorial" / "own-model.md")


def mathml(translator: Any, node: nodes.math | nodes.math_block) -> None:
    """Write an equation as MathML, which browsers draw without a script."""
    is_block = isinstance(node, nodes.math_block)
    equation = tex2mathml(node.astext().strip(), as_block=is_block)
    translator.body.append(f'<div class="math">{equation}</div>\n' if is_block else equation)
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Write equations as MathML, and leave out what other libraries add to our classes."""
    app.add_html_math_renderer("mathml", (mathml, None), (mathml, None))
    app.connect(
        "autodoc-skip-member",
        lambda _app, _what, name, _obj, skip, _options: skip or name in MADE_BY_SCIKIT_LEARN,
    )
