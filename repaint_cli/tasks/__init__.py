"""Tasks, which are to be learned, and recipes, the numbers to learn them with; cards are both."""
