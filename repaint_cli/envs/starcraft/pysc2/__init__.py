"""The real StarCraft II through PySC2. Only `shim` may be the first to import PySC2."""
