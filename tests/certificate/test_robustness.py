"""Damaged result documents are one line, never a traceback: export, certificate and fleet."""

import copy
import random
from collections.abc import Iterator
from typing import Any

import pytest

from rotcli.certificate.collect import certificate
from rotcli.certificate.curves import Input
from rotcli.certificate.render import to_markdown
from rotcli.errors import RotcliError
from rotcli.export.figures import collect
from rotcli.export.formats import all_formats, render
from rotcli.export.numbers import Settings
from rotcli.export.thermal import Source
from rotcli.fleet.records import Folders, rows_of
from tests.certificate import documents as docs

WEIRD = (None, 0, -1, 1e150, "x", "", [], {}, [1, 2], True, {"value": None}, -1e-320)
DOCUMENTS = {
    "allan": docs.allan(),
    "triad": docs.triad(),
    "scale": docs.scale(),
    "thermal": docs.thermal(),
}
DAMAGES = 120  # per kind: 4000 in all found nothing more


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of every key, and of the first three items of every list."""
    items = value.items() if isinstance(value, dict) else enumerate(value[:3])
    for key, item in items:
        yield (*path, key)
        if isinstance(item, dict | list):
            yield from places(item, (*path, key))


def damage(doc: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """Return the document with one value removed or replaced."""
    made = copy.deepcopy(doc)
    *path, last = rng.choice(list(places(made)))
    target = made
    for key in path:
        target = target[key]
    if rng.random() < 0.2:
        del target[last]
    else:
        target[last] = rng.choice(WEIRD)
    return made


@pytest.mark.parametrize("name", list(DOCUMENTS))
def test_a_damaged_document_is_used_or_refused_in_one_line(name: str) -> None:
    rng = random.Random(name)
    formats = list(all_formats())
    noise = (Source("b.json", "allan", "0" * 64), DOCUMENTS["allan"])
    refusals = []
    for _ in range(DAMAGES):
        doc = damage(DOCUMENTS[name], rng)
        source = Source("a.json", str(doc.get("kind")), "0" * 64)
        inputs = [(source, doc)] if name == "allan" else [(source, doc), noise]
        target = rng.choice(formats)
        for use in (
            lambda doc=doc: rows_of(doc, "a.json", "0" * 64, Folders()),
            lambda inputs=inputs, to=target: render(to, collect(inputs), Settings()),
            lambda doc=doc: to_markdown(certificate([Input("a.json", "0" * 64, doc)]), "t"),
        ):
            try:
                use()
            except RotcliError as error:
                refusals.append(str(error))
    assert refusals
    assert all("\n" not in text for text in refusals)
    assert all(".json: " in text for text in refusals)
