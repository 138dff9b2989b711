"""Transfer: teachers, the selection of their samples, and schedules."""
