"""A self-contained HTML page: pictures are inside it, nothing is loaded from anywhere."""

import base64
import html
import io
from typing import List, Sequence

from . import plots

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2126; background: #fff; margin: 0 auto; padding: 24px;
  max-width: 1060px; }
h1 { font-size: 24px; margin: 0 0 2px; }
h2 { font-size: 18px; margin: 34px 0 8px; border-bottom: 1px solid #d5dade; padding-bottom: 4px; }
p.where { color: #667; margin: 0 0 16px; overflow-wrap: anywhere; }
table { border-collapse: collapse; margin: 8px 0; font-variant-numeric: tabular-nums; }
th, td { padding: 3px 12px 3px 0; text-align: right; border-bottom: 1px solid #eceff1; }
th:first-child, td:first-child { text-align: left; } th { color: #556; font-weight: 600; }
img { max-width: 100%; height: auto; display: block; margin: 10px 0; }
.facts { display: flex; flex-wrap: wrap; gap: 10px; }
.fact { background: #f3f6f8; border-radius: 6px; padding: 8px 14px; }
.fact b { display: block; font-size: 19px; }
.fact span { color: #556; font-size: 13px; }
.missing { color: #667; font-style: italic; }
.warning { background: #fff4e0; border-left: 4px solid #e0962a; padding: 4px 10px; margin: 4px 0; }
.fine { background: #edf7ee; border-left: 4px solid #57a85c; padding: 4px 10px; }
pre { background: #f3f6f8; padding: 10px; overflow-x: auto; font-size: 12px; }
"""


def text(value: object) -> str:
    """Escaped text."""
    return html.escape(str(value))


def picture(figure: plots.Figure, description: str) -> str:
    """A figure as an <img> with the PNG inside."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    plots.plt.close(figure)
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    return f'<img alt="{text(description)}" src="data:image/png;base64,{data}">\n'


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table; the first column is left-aligned."""
    lines = ["<table><tr>" + "".join(f"<th>{text(cell)}</th>" for cell in header) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{text(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    return "\n".join(lines) + "</table>\n"


def facts(items: Sequence[Sequence[str]]) -> str:
    """Large figures with a word below each: (figure, word)."""
    boxes = [
        f'<div class="fact"><b>{text(figure)}</b><span>{text(word)}</span></div>' for figure, word in items
    ]
    return '<div class="facts">' + "".join(boxes) + "</div>\n"


def missing(what: str) -> str:
    """A line in place of something that is not there."""
    return f'<p class="missing">{text(what)}</p>\n'


def section(title: str, body: str) -> str:
    """A headline and its content."""
    return f"<h2>{text(title)}</h2>\n{body}"


def page(title: str, where: str, sections: List[str]) -> str:
    """The whole page."""
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{text(title)}</title>\n'
        f"<style>{STYLE}</style></head><body>\n<h1>{text(title)}</h1>\n<p class=\"where\">{text(where)}</p>\n"
        + "\n".join(sections) + "\n</body></html>\n"
    )
