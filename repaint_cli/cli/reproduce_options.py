"""The options of `repaint reproduce run`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

from repaint_cli.cli import completion
from repaint_cli.cli.engine_options import CpusPerRun, EngineName, GpusPerRun, Jobs, Retries
from repaint_cli.cli.options import LONG, WHERE, WRITE, argument, option
from repaint_cli.engines.options import LOCAL, RETRIES


class ScaleName(StrEnum):
    """How much is trained."""

    SMOKE = "smoke"
    NIGHT = "night"
    PAPER = "paper"


class ReproduceOptions(NamedTuple):
    """The options of `repaint reproduce run`."""

    names: Annotated[
        list[str],
        argument(
            "NAME",
            "Experiments' names or files (my.toml), or all.",
            autocompletion=completion.experiments,
        ),
    ]
    scale: Annotated[
        ScaleName,
        option(
            LONG,
            "NAME",
            "smoke: minutes, no results; night: a night on two cores; paper: about the paper's "
            "seeds and iterations.",
        ),
    ] = ScaleName.NIGHT
    engine: EngineName = LOCAL
    jobs: Jobs = None
    cpus_per_run: CpusPerRun = None
    gpus_per_run: GpusPerRun = None
    retries: Retries = RETRIES
    into: Annotated[
        Path, option(WHERE, "FOLDER", "The folder of experiments and of the runs they share.")
    ] = Path("reproduce")
    replace: Annotated[
        bool,
        option(WRITE, None, "Write where an experiment of the same name was another.", "--replace"),
    ] = False
