"""What mkdocs asks for while it builds the site: the pages of the reference, and equations as MathML.

Pages hold equations as `$...$` and `$$...$$`, which code hosts show too; MathML needs no script, nothing from elsewhere. An equation that
ends in `\\tag{7}` has the number 7 and the anchor `eq-7`.
"""

import re

from latex2mathml.converter import convert
from mkdocs.structure.files import File
from reference import PAGES

CODE = re.compile(r"(^```.*?^```$|`[^`\n]+`)", re.M | re.S)
DISPLAYED = re.compile(r"\$\$(.+?)\$\$", re.S)
INLINE = re.compile(r"\$([^$\n]+?)\$")
TAG = re.compile(r"\\tag\{(\d+)\}")


def on_files(files, config):
    """Add the pages that are read off the code."""
    for name, page in PAGES.items():
        files.append(File.generated(config, f"reference/{name}.md", content=page()))
    return files


def on_page_markdown(markdown, page, config, files):
    """Equations as MathML, outside of code."""
    pieces = CODE.split(markdown)
    return "".join(piece if piece.startswith("`") else with_mathml(piece) for piece in pieces)


def with_mathml(text: str) -> str:
    """`$$...$$` as a block with its number, `$...$` within the line."""
    # a line that begins with <math> would be a block to Markdown, one that begins with <span> is none
    return INLINE.sub(lambda m: f"<span>{mathml(m[1], 'inline')}</span>", DISPLAYED.sub(_block, text))


def _block(match: re.Match) -> str:
    tag = TAG.search(match[1])
    equation = mathml(TAG.sub("", match[1]), "block")
    number = f'<a id="eq-{tag[1]}" href="#eq-{tag[1]}">({tag[1]})</a>' if tag else ""
    return f'<div class="equation">{equation}{number}</div>'


def mathml(latex: str, display: str) -> str:
    """One equation; without line breaks, which Markdown would read as its own."""
    return " ".join(convert(" ".join(latex.split()), display=display).split())
