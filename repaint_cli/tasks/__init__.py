"""What is to be learned (a task) and with which numbers (a recipe); a card is both."""
