"""Any environment of Gymnasium, by its id."""
