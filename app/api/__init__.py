"""HTTP and WebSocket: one router per noun, schemas, problems, security, the viewer proxy."""
