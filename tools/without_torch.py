"""Print what the package and its tests need, but for torch and what needs it."""

import tomllib
from pathlib import Path

project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
wanted = project["dependencies"] + project["optional-dependencies"]["dev"]
print("\n".join(name for name in wanted if not name.startswith(("torch", "stable-baselines3"))))
