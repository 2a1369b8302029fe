"""What is said where there is no browser."""

LEFT_OUT = "the tests of the page in a browser are left out"
