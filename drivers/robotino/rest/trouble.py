"""What can be wrong with an answer before anybody reads its body."""

from __future__ import annotations

from runtime.messages import HttpAnswer, HttpFault


def trouble(answer: HttpAnswer, empty: str = "") -> tuple[str, str] | None:
    """Return of which kind it is, and in words; None if there is a body to read.

    Args:
        empty: kind of an answer without one; "": that is no trouble.
    """
    if answer.fault != HttpFault.HTTP_OK:
        return HttpFault.Name(answer.fault).removeprefix("HTTP_").lower(), f"{answer.path}: {answer.reason}"
    if answer.status != 200:
        return f"status {answer.status}", f"{answer.path}: {answer.body[:80]!r}"
    if empty and not answer.body.strip():
        return empty, f"{answer.path}: empty answer"
    return None
