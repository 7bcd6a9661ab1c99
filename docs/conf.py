"""The site: Sphinx reads the pages of docs/ as MyST Markdown, and docstrings of the public names; `make site`."""

import re
import sys
from importlib import import_module
from importlib.metadata import version as installed
from pathlib import Path

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.addnodes import pending_xref
from sphinx.util.inspect import TypeAliasForwardRef

sys.path.insert(0, str(Path(__file__).parent.parent))

project = "obscurance"
version = release = installed("obscurance")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # the anchors that Git forges give
default_role = "code"  # single backticks in docstrings

MODULES_OF_TYPES = (
    "obscurance.raytrace.types",
    "obscurance.raytrace.system.parameters",
    "obscurance.raytrace.camera",
    "obscurance.ao.options",
    "obscurance.ao.execute.tracer",
)
autodoc_default_options = {"members": True, "exclude-members": "source_name"}
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"npt.ArrayLike": "ArrayLike"} | {
    name: name
    for module in MODULES_OF_TYPES
    for name, value in vars(import_module(module)).items()
    if name[0].isupper() and not isinstance(value, type)
}
TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # within unions and tuples
napoleon_use_ivar = True
maximum_signature_line_length = 90
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_math_renderer = "mathml"  # made with the site: browsers need no script for it
html_title = "obscurance"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False


def defaults_in_python(app, what, name, obj, options, signature, returned):
    """`...` for a default that is made anew for each object, so that the signature can be parsed."""
    return signature and signature.replace("<factory>", "..."), returned


def formula(translator, node):
    """A formula of a page, in TeX as Git forges read it, as MathML."""
    translator.body.append(tex2mathml(node.astext(), as_block=isinstance(node, nodes.math_block)))
    raise nodes.SkipNode


def included_pages(app, doctree):
    """Links to files beside docs/ that a page of the site includes lead to that page."""
    for link in doctree.findall(pending_xref):
        path, _, heading = link["reftarget"].partition("#")
        page = re.sub(r"(?:.*/)?benchmarks/evidence/(\w+)(?:\.md)?", r"evidence/\1", path)
        page = re.sub(r"(?:.*/)?(CONTRIBUTING|CHANGELOG)(?:\.md)?", lambda name: name[1].lower(), page)
        if page != path:
            link.attributes.update(refdomain="doc", reftarget=page, reftargetid=heading or link.get("reftargetid"))


def titles_for_paths(app, doctree, page):
    """Links that show a page's path, as is best where Markdown is read as it is, show its title."""
    for link in doctree.findall(nodes.reference):
        path = link.astext().removeprefix("docs/").removesuffix(".md")
        if path != link.astext() and path in app.env.titles:
            link.children = [nodes.Text(app.env.titles[path].astext())]


def setup(app):
    app.add_html_math_renderer("mathml", (formula, None), (formula, None))
    app.connect("autodoc-process-signature", defaults_in_python)
    app.connect("doctree-read", included_pages)
    app.connect("doctree-resolved", titles_for_paths)
