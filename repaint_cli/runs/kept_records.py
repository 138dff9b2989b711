"""What compare.json says of the runs of a comparison, for readers that train nothing."""

from pathlib import Path

from pydantic import ValidationError

from repaint_cli.errors import CheckpointError, NotFound, reported_as
from repaint_cli.files.limits import read_json
from repaint_cli.runs.folder import PLANS
from repaint_cli.runs.record import RunRecord
from repaint_cli.settings import first_problem


def kept_records(root: Path) -> dict[str, RunRecord]:
    """Return what runs would say at their beginning, by the names of their folders.

    Raises:
        NotFound: no plans were kept.
        CheckpointError: the file is damaged.
    """
    path = root / PLANS
    if not path.is_file():
        raise NotFound(
            f"expected the folder of repaint compare --task, with {PLANS}, found none at {root}"
        )
    with reported_as(CheckpointError):
        data = read_json(path)
    try:
        runs = dict(data["runs"])
        if not runs or any("/" in name or name.startswith(".") for name in runs):
            raise ValueError("expected names of folders")
        return {name: RunRecord.model_validate(run) for name, run in runs.items()}
    except ValidationError as error:
        raise CheckpointError(f"{path} is damaged: {first_problem(error)}") from error
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise CheckpointError(f"{path} is damaged: {error!s:.200}") from error
