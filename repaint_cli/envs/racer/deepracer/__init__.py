"""DeepRacer's own formats: params, reward functions, model files, logs."""
