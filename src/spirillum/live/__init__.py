"""The tracker on a live picture: a camera, a stream, or a film at its own pace."""
