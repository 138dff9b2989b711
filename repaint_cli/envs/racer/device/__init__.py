"""The racer on one NVIDIA GPU: the kernels of the CPU, launched over all cars at once."""
