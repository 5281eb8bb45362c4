"""Reports: what differs, what came out, as text, JSON, pages and pictures."""
