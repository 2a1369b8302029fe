"""The tracker on a live picture: a camera, a stream, or a video at its own pace."""
