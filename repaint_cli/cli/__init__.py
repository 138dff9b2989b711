"""The command line: the only floor that prints, asks or exits; a small file a command."""
