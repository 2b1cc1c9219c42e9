"""What is said about an export."""

import json


# Materials that were made of others, by name.
ALIASES = {}


class Stop(Exception):
    """There can be no export; the message says why."""


class Report:
    """Warnings tell of what is lost, notes of choices. Each is a pair of a place (the name of a material or an object;
    empty for the whole file) and a message, said once."""

    def __init__(self):
        self.warnings = []
        self.notes = []

    def warn(self, place, message):
        self._add(self.warnings, place, message)

    def note(self, place, message):
        self._add(self.notes, place, message)

    @staticmethod
    def _add(messages, place, message):
        place = ALIASES.get(place, place)
        if (place, message) not in messages:
            messages.append((place, message))

    def write(self, path, error=None):
        answer = {"error": error, "warnings": self.warnings, "notes": self.notes}
        with open(path, "w", encoding="utf-8") as file:
            json.dump(answer, file)


def listed(names, most=6):
    """Names in a sentence; of many only the first."""
    names = sorted({ALIASES.get(name, name) for name in names})
    shown = ", ".join(f"'{name}'" for name in names[:most])
    more = len(names) - most
    return f"{shown} and {more} more" if more > 0 else shown
