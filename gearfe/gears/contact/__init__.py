"""Contact of two elastic gears: flank surfaces and closest points, condensed compliance, contact laws, Newton
solver."""
