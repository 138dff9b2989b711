"""Simulators behind Gymnasium's vector interface: numpy only; no torch, no files, no printing."""
