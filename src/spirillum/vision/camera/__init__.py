"""The camera: optics through the oil's surface, ruler, lens, scale."""
