"""Buildings of regions: inventories, exposure models, ground motions at sites, maps."""
