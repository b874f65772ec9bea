"""The form of what every stage says of its own making."""

from typing import Any

from pydantic import Field

from awescli.artifacts.forms.words import Checked, Number, Text


class Stamp(Checked):
    """What a stage was made from; where any of it has changed, the stage runs again."""

    inputs: dict[str, Text] = Field(description="input (flight, kite file) -> its SHA-256")
    upstream: dict[str, Text | None] = Field(description="earlier stage -> SHA-256 of its artifacts; nothing where it had not run")
    settings: dict[str, Any] = Field(default={}, description="the stage's settings, defaults filled in")
    versions: dict[str, Text] = Field(default={}, description="package -> version, of all that numbers depend on")
    split: dict[str, Any] = Field(default={}, description="the plan's `split`")
    seed: int | None = Field(default=None, description="the plan's `seed`")
    code: Text = Field(default="", description="SHA-256 of awes' own package")


class Timing(Checked):
    """When, and for how long."""

    started: Text = Field(default="", description="when the stage began, ISO 8601 with time zone")
    duration_s: Number | None = Field(default=None, description="how long it ran [s]")


class Blas(Checked):
    """A library of linear algebra that was loaded while the stage ran."""

    library: Text | None = Field(default=None, description="which library")
    version: Text | None = Field(default=None, description="its version")
    kernels: Text | None = Field(default=None, description="for which processor its kernels are made")
    threads: int | None = Field(default=None, description="threads that it had")


class Machine(Checked):
    """What the last bits of the numbers may depend on besides versions."""

    system: Text = Field(default="", description="operating system")
    machine: Text = Field(default="", description="kind of the processor")
    libc: Text = Field(default="", description="C library and its version")
    cores: int | None = Field(default=None, description="processor cores")
    blas: list[Blas] = Field(default=[], description="libraries of linear algebra")


class Provenance(Checked):
    """provenance.json of every stage."""

    stage: Text = Field(default="", description="which stage")
    versions: dict[str, Text] = Field(default={}, description="package -> version, when it ran")
    machine: Machine = Field(default=Machine(), description="where it ran")
    artifacts: dict[str, Text] = Field(description="file in this folder -> its SHA-256")
    stamp: Stamp = Field(description="what the stage was made from")
    paths: dict[str, Text] = Field(default={}, description="where flight, kite file and plan lay")
    summary: dict[str, Any] = Field(default={}, description="the stage's answer, as it was printed")
    timing: Timing = Field(default=Timing(), description="when it was made; takes no part in hashes")
