"""roadprint: road, sub-segment and coordinates from the cellular signal a vehicle hears."""
