"""Evidence of every hypothesis on one stream: nothing, another unit, or a fault and its onset."""
