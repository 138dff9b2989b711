"""Files on disk, whatever their contents: written whole or not at all, read with limits."""
