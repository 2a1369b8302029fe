"""From the frames of a video to where the robot was and how far body and tail had turned."""
