import torch
from hypothesis import settings

torch.set_num_threads(1)

settings.register_profile("repaint", deadline=None, max_examples=50, derandomize=True)
settings.load_profile("repaint")


def pytest_configure(config):
    # gradients are views into one buffer on purpose; pytest's filters replace the one nets.py sets
    config.addinivalue_line("filterwarnings", "ignore:grad and param do not obey the gradient")
