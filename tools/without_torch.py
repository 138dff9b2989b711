"""Print what the package and its tests need, but for torch and what needs it."""

import tomllib
from pathlib import Path

NEED_TORCH = ("torch", "stable-baselines3", "ipykernel", "nbclient", "nbformat")
"""torch, the library whose policies become teachers, and what runs the notebook, which trains."""

project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
wanted = project["dependencies"] + project["optional-dependencies"]["dev"]
print("\n".join(name for name in wanted if not name.startswith(NEED_TORCH)))
