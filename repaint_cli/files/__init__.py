"""Files on disk: written whole or not at all, read with limits; not what they say."""
