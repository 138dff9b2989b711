"""The update of small dense networks, with derivatives by hand."""
