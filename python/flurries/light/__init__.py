"""What shines on the weather."""
