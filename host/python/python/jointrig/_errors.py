"""What jointrig raises."""


class Error(Exception):
    """Anything that jointrig says cannot be done. The message is the command's own: what, where, what to do."""


class FileError(Error, OSError):
    """A file cannot be read or written."""


class Refused(Error, ValueError):
    """What was asked for cannot be done with what is there."""


class DataError(Error, ValueError):
    """Numbers or a file's content make no sense."""
