"""Pictures: contact sheets of poses, confusion matrices."""
