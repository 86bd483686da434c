# SPDX-License-Identifier: GPL-3.0-or-later
"""What a process takes of the machine."""

from pathlib import Path


def resident(key: str) -> int:
    """Bytes of memory that this process holds (VmRSS) or has held at most (VmHWM), by Linux's /proc."""
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{key}:")[1].split()[0]) * 1024


def forget_peak() -> None:
    """Let VmHWM count from now on: what loading or compiling took before is no part of it (Linux's clear_refs)."""
    Path("/proc/self/clear_refs").write_text("5")
