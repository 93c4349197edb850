"""From scans to residuals, detections and symbols."""
