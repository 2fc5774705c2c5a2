"""Pictures of a scene and of its motion: shapes of the bodies, views, SVG and PNG."""
