"""Simulators behind Gymnasium's vector interface: numpy in, numpy out; no torch, no files, no printing."""
