"""``fclib doctor``: installed, missing and broken parts, with remedies."""

from __future__ import annotations

import json
from dataclasses import asdict

import typer
from rich.text import Text

from fclib import doctor
from fclib.cli._output import Json, out, progress_bar

STYLE = {"ok": "green", "absent": "yellow", "broken": "red"}


def show(finding: doctor.Finding) -> None:
    """A line, with a remedy if there is one."""
    line = Text("  ")
    line.append(f"{finding.state:6}", STYLE[finding.state])
    line.append(f"  {finding.name:14}", "bold")
    line.append("  ".join(filter(None, ("", finding.found, finding.purpose))))
    out.print(line, soft_wrap=True)
    for word in filter(None, (finding.problem, finding.remedy)):
        lead = "->" if word is finding.remedy else "  "
        out.print(Text(f"          {lead} {word}"), soft_wrap=True)


def command(as_json: Json = False) -> None:
    """Look at the installation: what is there, missing or broken.

    The exit status is 0 unless something is broken. An optional part that is missing is not broken.
    """
    with progress_bar(1) as show_progress:
        show_progress("looking")
        findings = doctor.examine()
    broken = sum(finding.state == "broken" for finding in findings)
    absent = sum(finding.state == "absent" for finding in findings)
    if as_json:
        for finding in findings:
            typer.echo(json.dumps(asdict(finding)))
        raise typer.Exit(int(broken > 0))
    part = ""
    for finding in findings:
        if finding.part != part:
            part = finding.part
            out.print(part, style="bold", highlight=False)
        show(finding)
    if broken:
        out.print(f"\n{broken} broken: do what its arrow says, then run fclib doctor again.")
    else:
        rest = (
            f"; {absent} optional {'is' if absent == 1 else 'are'} not installed" if absent else ""
        )
        out.print(f"\nNothing is broken{rest}.", highlight=False)
    raise typer.Exit(int(broken > 0))
