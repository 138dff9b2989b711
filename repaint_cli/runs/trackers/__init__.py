"""Tools that show the numbers of runs as they come, each a `Tracker`: TensorBoard, W&B, MLflow."""
