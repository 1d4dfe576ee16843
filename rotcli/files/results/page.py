"""HTML pages from the templates of the package, with one style sheet for all of them."""

from typing import Any

from rotcli.files.installed import DATA
from rotcli.lazy import lazily

with lazily():
    import jinja2


def render_page(template: str, **values: Any) -> str:
    """Return a page from a template of rotcli/data; every value is escaped.

    A template may include others, such as page.css.
    """
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_read),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(**values)


def _read(name: str) -> str:
    return (DATA / name).read_text("utf-8")
