"""What teachers give, which of it is taken, and when."""
