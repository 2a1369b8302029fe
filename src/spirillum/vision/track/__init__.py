"""The robot on every frame: outline, stripes, tail, and flags."""
