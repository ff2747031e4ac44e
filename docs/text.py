"""What turns the docstrings' text into Markdown when the pages of `docs/api` are built."""

import re

import griffe

#: A parameter or field at the start of a line, such as ``fiber, edge_um : as of `Network```.
ENTRY = re.compile(r"(?:^|; )(\w+(?:, \w+)*) : ", re.MULTILINE)


def markdown(text: str) -> str:
    """Lists of parameters as lists, examples as code, tables as they stand."""
    text = re.sub(r"^(Parameters|Returns|Raises)\n-+\n", r"**\1**\n\n", text, flags=re.MULTILINE)
    return "\n\n".join(map(_paragraph, text.split("\n\n")))


def _paragraph(text: str) -> str:
    lines = text.split("\n")
    if lines[0].startswith(">>> "):
        return "\n".join(["```pycon", *lines, "```"])
    if lines[0].startswith("==="):
        return "\n".join(["```text", *lines, "```"])
    if ENTRY.match(lines[0]):
        return ENTRY.sub(r"\n- **\1**: ", text).lstrip()
    return re.sub(r"^>", r"\>", text, flags=re.MULTILINE)  # greater than, not a quotation


class Text(griffe.Extension):
    """Applies `markdown` to every docstring."""

    def on_object(self, *, obj, **kwargs):
        """Called by Griffe for everything that it has read."""
        if obj.docstring is not None:
            obj.docstring.value = markdown(obj.docstring.value)
