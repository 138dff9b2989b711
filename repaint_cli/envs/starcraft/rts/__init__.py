"""The mini-RTS: StarCraft II's numbers and rules, as far as the tasks need them."""
