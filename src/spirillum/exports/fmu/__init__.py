"""The held robot as a functional mock-up unit (FMI 3.0, co-simulation): description, C source, and its compilation."""
