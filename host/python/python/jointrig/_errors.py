"""What jointrig raises."""

from __future__ import annotations

import re


class Error(Exception):
    """Anything that jointrig says cannot be done. The message is the command's own.

    what: the message without its advice; where: the file, or None; do: the advice at its end, or None.
    """

    def __init__(self, sentence: str, where: str | None = None, with_advice: bool = False) -> None:
        super().__init__(sentence)
        self.sentence = sentence
        self.where = where
        self.what: str = sentence
        self.do: str | None = None
        advice = re.match(r"(?s)(.*)[:;] (.+)", sentence) if with_advice else None
        if advice:
            self.what, self.do = advice.groups()

    def __str__(self) -> str:
        # OSError would make its own text of several arguments
        return self.sentence

    def __reduce__(self) -> tuple[type[Error], tuple[str, str | None, bool]]:
        return type(self), (self.sentence, self.where, self.do is not None)


class FileError(Error, OSError):
    """A file cannot be read or written."""


class Refused(Error, ValueError):
    """What was asked for cannot be done with what is there."""


class DataError(Error, ValueError):
    """Numbers or a file's content make no sense."""
