"""The robot under control: sensors and actuators that err as real ones do, controllers, and their scores."""
