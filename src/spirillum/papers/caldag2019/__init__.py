"""Caldag and Yesilyurt 2019: a one-piece magnetic swimmer in closed tubes."""
