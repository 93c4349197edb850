"""The one reader of what others wrote, field by field."""
