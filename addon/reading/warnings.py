# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene asks for and does not get: collected while it is read, one message for each kind of trouble."""

from __future__ import annotations

from collections import defaultdict


class Warnings:
    """Messages about what is not rendered as the scene asks, each with the names of the objects that it concerns."""

    def __init__(self):
        self._names = defaultdict(dict)  # message -> names in order, without doubles

    def add(self, name: str, message: str) -> None:
        """name: of the object, material or light; message: what is wrong and what is done instead."""
        self._names[message][name] = None

    def of(self, name: str) -> list[str]:
        """The messages that concern a name, without it."""
        return [message for message, names in self._names.items() if name in names]

    def messages(self, most: int = 5) -> list[str]:
        """One line for each message; at most `most` names are spelt out."""
        lines = []
        for message, names in self._names.items():
            listed = ", ".join(f"'{name}'" for name in list(names)[:most])
            more = f" and {len(names) - most} more" if len(names) > most else ""
            lines.append(f"{listed}{more}: {message}")
        return lines
