"""Pages that stand alone: one HTML file with its styles, script, data and pictures, no network."""

import base64
import hashlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

FOLDER = Path(__file__).parent

POLICY = (
    "default-src 'none'; img-src data:; media-src data:; style-src '{style}'; "
    "script-src '{script}'; base-uri 'none'; form-action 'none'"
)
"""Of what the page may load and run: what is in it, and nothing that a name brought into it."""

KINDS = {".png": "image/png", ".mp4": "video/mp4"}


def render_page(values: Mapping[str, Any]) -> str:
    """Return a page as `page.html` lays it out; all texts in `values` are shown as they are."""
    style, script = _part("page.css"), _part("page.js")
    policy = POLICY.format(style=_fingerprint(style), script=_fingerprint(script))
    page = _templates().get_template("page.html")
    return page.render(values, style=style, script=script, policy=policy)


def embedded(path: Path) -> str:
    """Return a picture's or a film's contents as the address that a page shows it by."""
    contents = base64.b64encode(path.read_bytes()).decode()
    return f"data:{KINDS[path.suffix]};base64,{contents}"


@cache
def _templates() -> Environment:
    templates = Environment(
        loader=FileSystemLoader(FOLDER), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    templates.policies["json.dumps_kwargs"] = {"allow_nan": False}  # and no sorting of names
    return templates


def _part(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _fingerprint(text: str) -> str:
    """Return the hash by which a policy lets a style or a script of exactly this text run."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
