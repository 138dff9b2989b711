"""The page of one run, in its folder."""

from pathlib import Path

from repaint_cli.errors import CardError, StoreError
from repaint_cli.files.commands import command
from repaint_cli.runs.comparison import comparison_of
from repaint_cli.runs.comparison_words import duration, whole
from repaint_cli.runs.folder import RUNS, RunFolder
from repaint_cli.runs.page import Values, write_page
from repaint_cli.runs.page_files import PageFiles, pictures_of
from repaint_cli.runs.reader import RecordedRun, newest_run, read_run
from repaint_cli.runs.run_command import command_of, shipped_card
from repaint_cli.runs.settings_shown import chosen_settings


def write_run_page(run: RecordedRun) -> Path:
    """Write the page of a run into its folder; return it.

    Raises:
        CardError: the run has no finished iteration.
        CheckpointError: its alarms are damaged.
        StoreError: the page cannot be written.
    """
    if not run.returns.size:
        raise CardError(f"expected a run with a finished iteration, found none in {run.folder}")
    files, (heads, settings) = PageFiles(run.files.page), chosen_settings(run)
    own = Values(
        title=f"{run.task.name}: {run.label}",
        kind="A run of repaint",
        subtitle=f"{run.task.summary:.300}",
        facts=_facts(run),
        films=files.films(run.files),
        pictures_title="Pictures",
        pictures=list(files.pictures(pictures_of(run.files))),
        settings_title="Settings of this run that are no defaults, or not as its card has them",
        settings_heads=heads,
        settings=settings,
        no_settings="All settings are defaults.",
        commands=_commands(run),
        versions=_versions(run),
        files_note="The folder has every number, too: metrics.csv, and run.json with all settings.",
    )
    runs = {run.label: run}
    return write_page(run.files.page, own, runs, comparison_of(runs, None))


def run_page_if_possible(run: RecordedRun) -> tuple[list[Path], list[str]]:
    """Write the page of a run; return it, or a warning: no page is worth a run."""
    try:
        return [write_run_page(run)], []
    except Exception as error:
        why = " ".join(str(error).split()) or type(error).__name__
        retry = command("repaint open {}", run.folder)
        return [], [f"there is no {run.files.page.name}: {why:.300}; to try again: {retry}"]


def fresh_page(folder: Path | None) -> Path:
    """Return the page of a run, written anew, or that of a comparison's report.

    Args:
        folder: of the run or the report; the newest run where absent.

    Raises:
        NotFound: there is no such run or report.
        CardError: the run has no finished iteration.
        CheckpointError: a file of the run is damaged.
        StoreError: the page cannot be written, and there is none.
    """
    files = RunFolder(newest_run(RUNS) if folder is None else folder)
    if files.page.is_file() and not files.is_run():
        return files.page
    try:
        return write_run_page(read_run(files.path))
    except StoreError:
        if files.page.is_file():  # of a folder that cannot be written
            return files.page
        raise


def _facts(run: RecordedRun) -> list[tuple[str, str]]:
    teachers = ", ".join(teacher.label for teacher in run.record.teachers)
    return [
        ("method", run.method),
        ("teachers", teachers or "none"),
        ("seeds", ", ".join(map(str, run.seeds))),
        ("iterations", f"{run.returns.shape[1]} of {run.task.ppo.n_iterations}"),
        ("took", duration(float(run.rows["seconds"][:, -1].max()))),
        ("environment steps", f"{whole(float(run.rows['env_steps'][:, -1].mean()))} a seed"),
    ]


def _commands(run: RecordedRun) -> list[dict[str, str]]:
    own = "" if shipped_card(run.task) else f" ({run.task.name}.toml stands for your own card)"
    play = ["repaint eval {} --render-offscreen", "repaint open {}"]
    film = "\n".join(command(form, run.folder) for form in play)
    return [
        {"what": f"Begin such a run{own}:", "text": command_of(run.record, run.task)},
        {"what": "Film its last policy, and see the film on this page:", "text": film},
    ]


def _versions(run: RecordedRun) -> str:
    """Say with what the run was trained."""
    used = ", ".join(f"{name} {version}" for name, version in run.record.versions.items())
    return f"Trained with {used}." if used else ""
