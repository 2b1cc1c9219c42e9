"""Warnings and notes about an export."""

import json

# Names of temporary materials, and the names of the materials that they are copies of.
ALIASES = {}


class Stop(Exception):
    """The export is impossible; the message says why."""


class Report:
    """Warnings name what is lost, notes name choices. Each is a pair: the name of a material or object (empty for the whole file) and a
    message. Repeated messages are dropped."""

    def __init__(self):
        self.warnings = []
        self.notes = []

    def warn(self, name, message):
        self._add(self.warnings, name, message)

    def note(self, name, message):
        self._add(self.notes, name, message)

    @staticmethod
    def _add(messages, name, message):
        entry = ALIASES.get(name, name), message
        if entry not in messages:
            messages.append(entry)

    def write(self, path, error=None):
        with open(path, "w", encoding="utf-8") as file:
            json.dump({"error": error, "warnings": self.warnings, "notes": self.notes}, file)


def listed(names, most=6):
    """Names for a message; only the first of many."""
    names = sorted({ALIASES.get(name, name) for name in names})
    shown = ", ".join(f"'{name}'" for name in names[:most])
    more = len(names) - most
    return f"{shown} and {more} more" if more > 0 else shown
