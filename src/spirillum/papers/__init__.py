"""One folder for each paper: its study, statements, constants and figures."""
